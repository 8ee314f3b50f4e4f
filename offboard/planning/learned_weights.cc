#include "offboard/planning/learned_weights.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr const char* kFirstLine = "vantage-weights 1";

std::string formulations_line() {
  std::string line = "formulations";
  for (const Formulation f : kAllFormulations) {
    if (f != Formulation::kCombined) line += " " + std::string(name_of(f));
  }
  return line;
}

std::string descriptor_line() {
  std::string line = "descriptor";
  for (const std::string_view name : ShapeDescriptor::kNames) line += " " + std::string(name);
  return line;
}

/// As many digits as it takes to read the same number back.
std::string shortest(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

std::string joined(const CombinedWeights& weights) {
  std::string line;
  for (const Formulation f : kAllFormulations) {
    if (f != Formulation::kCombined) line += " " + shortest(weights[f]);
  }
  return line;
}

/// Finite numbers of words[first] and on; false when one is none or they are not `count`.
bool read_numbers(const std::vector<std::string>& words, std::size_t first, std::size_t count, double* numbers) {
  if (words.size() != first + count) return false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string& word = words[first + i];
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), numbers[i]);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(numbers[i])) return false;
  }
  return true;
}

bool read_weights(const std::vector<std::string>& words, std::size_t first, CombinedWeights* weights) {
  std::array<double, kFormulations - 1> numbers{};
  if (!read_numbers(words, first, numbers.size(), numbers.data())) return false;
  weights->weight.fill(0);
  std::size_t i = 0;
  for (const Formulation f : kAllFormulations) {
    if (f != Formulation::kCombined) (*weights)[f] = numbers[i++];
  }
  return weights->valid();
}

}  // namespace

LearnedWeights::LearnedWeights(const CombinedWeights& all, std::vector<Object> objects)
    : all_(all), objects_(std::move(objects)) {
  std::string why;
  if (!all_.valid(&why)) throw std::invalid_argument("LearnedWeights: " + why);
  ShapeDescriptor sum, squares;
  double count = 0;
  for (const Object& object : objects_) {
    if (!object.weights.valid(&why)) throw std::invalid_argument("LearnedWeights: " + object.name + ": " + why);
    if (object.seen.empty()) throw std::invalid_argument("LearnedWeights: " + object.name + " has no descriptor");
    for (const ShapeDescriptor& shape : object.seen) {
      ++count;
      for (std::size_t i = 0; i < ShapeDescriptor::kSize; ++i) {
        sum.value[i] += shape.value[i];
        squares.value[i] += shape.value[i] * shape.value[i];
      }
    }
  }
  for (std::size_t i = 0; i < ShapeDescriptor::kSize && count > 0; ++i) {
    const double mean = sum.value[i] / count;
    scale_.value[i] = std::sqrt(std::max(0.0, squares.value[i] / count - mean * mean));
  }
}

LearnedWeights LearnedWeights::load(const std::filesystem::path& path) {
  std::ifstream stream(path);
  if (!stream) throw InputError(path.string() + ": can't be read; vantage-experiment tune writes such a file");
  std::string line;
  int number = 0;
  const auto fail = [&](const std::string& fault) -> InputError {
    return InputError(path.string() + ":" + std::to_string(number) + ": " + fault);
  };
  CombinedWeights all;
  std::vector<Object> objects;
  bool has_all = false, has_formulations = false, has_descriptor = false;
  while (std::getline(stream, line)) {
    ++number;
    if (number == 1) {
      if (line != kFirstLine) throw fail("expected \"" + std::string(kFirstLine) + "\"; not a file of learned weights");
      continue;
    }
    std::istringstream stream_of_line(line);
    std::vector<std::string> words;
    for (std::string word; stream_of_line >> word;) words.push_back(word);
    if (words.empty() || words[0][0] == '#') continue;
    if (words[0] == "formulations") {
      has_formulations = line == formulations_line();
      if (!has_formulations) throw fail("expected \"" + formulations_line() + "\"; learn them anew");
    } else if (words[0] == "descriptor") {
      has_descriptor = line == descriptor_line();
      if (!has_descriptor) throw fail("expected \"" + descriptor_line() + "\"; learn them anew");
    } else if (words[0] == "all") {
      has_all = read_weights(words, 1, &all);
      if (!has_all) throw fail("all: expected 8 weights, none negative, not all 0");
    } else if (words[0] == "object") {
      Object object;
      if (words.size() < 2 || !read_weights(words, 2, &object.weights)) {
        throw fail("object: expected a name and 8 weights, none negative, not all 0");
      }
      object.name = words[1];
      objects.push_back(std::move(object));
    } else if (words[0] == "seen") {
      ShapeDescriptor shape;
      if (objects.empty() || words.size() < 2 || words[1] != objects.back().name ||
          !read_numbers(words, 2, ShapeDescriptor::kSize, shape.value.data())) {
        throw fail("seen: expected the name of the object above and " + std::to_string(ShapeDescriptor::kSize) +
                   " numbers");
      }
      objects.back().seen.push_back(shape);
    } else {
      throw fail(words[0] + ": there are formulations, descriptor, all, object, seen");
    }
  }
  if (!has_formulations || !has_descriptor || !has_all) {
    throw fail("cut short: expected lines formulations, descriptor and all");
  }
  for (const Object& object : objects) {
    if (object.seen.empty()) throw fail("object " + object.name + " has no line seen");
  }
  return {all, std::move(objects)};
}

void LearnedWeights::save(const std::filesystem::path& path, const std::string& comment) const {
  AtomicFile file(path);
  file.stream() << kFirstLine << '\n';
  std::istringstream lines(comment);
  for (std::string line; std::getline(lines, line);) file.stream() << "# " << line << '\n';
  file.stream() << formulations_line() << '\n' << descriptor_line() << "\nall" << joined(all_) << '\n';
  for (const Object& object : objects_) {
    file.stream() << "object " << object.name << joined(object.weights) << '\n';
    for (const ShapeDescriptor& shape : object.seen) {
      file.stream() << "seen " << object.name;
      for (const double value : shape.value) file.stream() << ' ' << shortest(value);
      file.stream() << '\n';
    }
  }
  file.commit();
}

const LearnedWeights::Object* LearnedWeights::nearest_object(const ShapeDescriptor& shape) const {
  const Object* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Object& object : objects_) {
    for (const ShapeDescriptor& seen : object.seen) {
      double distance = 0;
      for (std::size_t i = 0; i < ShapeDescriptor::kSize; ++i) {
        if (scale_.value[i] > 0) distance += std::pow((shape.value[i] - seen.value[i]) / scale_.value[i], 2);
      }
      if (distance < least) {
        least = distance;
        nearest = &object;
      }
    }
  }
  return nearest;
}

const CombinedWeights& LearnedWeights::nearest(const OccupancyMap& map) const {
  const Object* object = nearest_object(describe_shape(map));
  return object == nullptr ? all_ : object->weights;
}

}  // namespace vantage
