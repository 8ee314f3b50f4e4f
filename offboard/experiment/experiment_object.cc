#include "offboard/experiment/experiment_object.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/digest.h"

namespace vantage {
namespace {

struct KnownModel {
  const char* name;
  const char* file;
};
constexpr std::array<KnownModel, 3> kModels = {
    {{"teapot", "teapot.ply"}, {"bunny", "bunny.obj"}, {"dragon", "dragon.ply"}}};

}  // namespace

std::string digest_of_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const Digest digest = digest_of({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  std::string text;
  for (std::size_t i = 0; i < 8; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

ExperimentObject load_object(const std::string& item, const std::filesystem::path& models) {
  ExperimentObject object;
  const auto known =
      std::find_if(kModels.begin(), kModels.end(), [&](const KnownModel& model) { return item == model.name; });
  if (known != kModels.end()) {
    object.name = item;
    object.file = models / known->file;
    if (!std::filesystem::exists(object.file)) {
      throw InputError(object.file.string() + ": missing; fetch it with  scripts/fetch-models " + item);
    }
  } else {
    object.file = item;
    object.name = object.file.stem().string();
    const std::string allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
    if (object.name.empty() || object.name.find_first_not_of(allowed) != std::string::npos) {
      throw InputError(item +
                       ": a mesh file's name may hold letters, digits, '_' and '-' before its ending; rename it");
    }
  }
  object.mesh = sim::load_mesh(object.file);
  object.digest = digest_of_file(object.file);
  return object;
}

std::vector<ExperimentObject> load_objects(const std::vector<std::string>& items, const std::filesystem::path& models) {
  if (items.empty()) throw InputError("--objects: names no object; e.g. teapot,bunny,dragon or a mesh file");
  std::vector<ExperimentObject> objects;
  for (const std::string& item : items) {
    ExperimentObject object = load_object(item, models);
    for (const ExperimentObject& other : objects) {
      if (other.name == object.name) throw InputError("--objects: there are two objects called " + object.name);
    }
    objects.push_back(std::move(object));
  }
  return objects;
}

}  // namespace vantage
