#include "offboard/mapping/tsdf.h"

#include <numeric>
#include <stdexcept>

namespace vantage {

bool TsdfOptions::valid(std::string* why) const {
  if (!(truncation_voxels >= 2 && truncation_voxels <= 16)) {
    if (why != nullptr) *why = "truncation_voxels must lie between 2 and 16";
    return false;
  }
  if (!(jump_share > 0 && jump_share <= 1)) {
    if (why != nullptr) *why = "jump_share must lie between 0 and 1";
    return false;
  }
  return true;
}

Tsdf::Tsdf(const Region& region, const TsdfOptions& options)
    : region_(region),
      options_(options),
      truncation_m_(options.truncation_voxels * region.resolution_m),
      size_bricks_((region.size_voxels.array() + 7) / 8) {
  std::string why;
  if (!region.valid(&why) || !options.valid(&why)) throw std::invalid_argument(why);
  slots_.assign(static_cast<std::size_t>(size_bricks_.cast<std::int64_t>().prod()), kNone);
}

bool Tsdf::distance_at(const Eigen::Vector3i& voxel, float* distance_m) const {
  if (!region_.contains(voxel)) return false;
  const Eigen::Vector3i at = voxel / 8;
  const Brick* brick = find(static_cast<std::size_t>(at.x()) +
                            static_cast<std::size_t>(size_bricks_.x()) *
                                (static_cast<std::size_t>(at.y()) +
                                 static_cast<std::size_t>(size_bricks_.y()) * static_cast<std::size_t>(at.z())));
  if (brick == nullptr) return false;
  const auto i = static_cast<std::size_t>((voxel.x() & 7) | (voxel.y() & 7) << 3 | (voxel.z() & 7) << 6);
  *distance_m = brick->distance[i];
  return brick->weight[i] > 0;
}

Tsdf::Brick& Tsdf::allocate(std::size_t brick) {
  std::uint32_t& slot = slots_[brick];
  if (slot == kNone) {
    if (unused_.empty()) {
      slot = static_cast<std::uint32_t>(storage_.size());
      storage_.add();
    } else {
      slot = unused_.back();
      unused_.pop_back();
      storage_[slot] = Brick{};
    }
  }
  return storage_[slot];
}

void Tsdf::clear(std::size_t brick) {
  if (slots_[brick] == kNone) return;
  unused_.push_back(slots_[brick]);
  slots_[brick] = kNone;
}

void Tsdf::clear() {
  slots_.assign(slots_.size(), kNone);
  unused_.resize(storage_.size());
  std::iota(unused_.begin(), unused_.end(), 0U);
}

std::size_t Tsdf::memory_bytes() const {
  return sizeof *this + slots_.capacity() * sizeof(std::uint32_t) + storage_.size() * sizeof(Brick) +
         unused_.capacity() * sizeof(std::uint32_t);
}

bool Tsdf::operator==(const Tsdf& other) const {
  if (!(region_ == other.region_ && truncation_m_ == other.truncation_m_)) return false;
  for (std::size_t b = 0; b < slots_.size(); ++b) {
    const Brick *mine = find(b), *others = other.find(b);
    if ((mine == nullptr) != (others == nullptr)) return false;
    if (mine != nullptr && !(mine->distance == others->distance && mine->weight == others->weight)) return false;
  }
  return true;
}

}  // namespace vantage
