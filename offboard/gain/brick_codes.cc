#include "offboard/gain/brick_codes.h"

#include <algorithm>

namespace vantage {
namespace {

constexpr std::size_t kVoxels = BrickCodes::Codes{}.size();
constexpr std::size_t kPad = 3;  // kernels read a code as the lowest byte of 32 bits

}  // namespace

void BrickCodes::reset(const Eigen::Vector3i& size_bricks, const VisitTable& table, std::size_t expected) {
  size_ = size_bricks;
  strides_ = {1, size_.x() + 2, (size_.x() + 2) * (size_.y() + 2)};
  stop_begin_ = static_cast<std::uint32_t>(table.stop_begin);
  words_.assign(static_cast<std::size_t>(strides_[2]) * static_cast<std::size_t>(size_.z() + 2),
                FieldView::kUniformBrick | static_cast<std::uint32_t>(table.sentinel()));
  for (auto* plane : {&codes_, &proximity_}) {
    plane->clear();
    plane->reserve((expected + expected / 8) * kVoxels + kPad);
    plane->insert(plane->end(), kPad, 0);
  }
  unused_.clear();
}

bool BrickCodes::set_uniform(const Eigen::Vector3i& brick, unsigned entry) {
  std::uint32_t& word = words_[index(brick)];
  const std::uint32_t before = word & ~FieldView::kCubeMask, after = FieldView::kUniformBrick | entry;
  if ((word & FieldView::kUniformBrick) == 0) unused_.push_back(word & FieldView::kBrickNumber);
  word = after;
  return after != before;
}

bool BrickCodes::set(const Eigen::Vector3i& brick, const Codes& codes) {
  // A brick's voxels may differ in what rays do not ask: marks of known voxels.
  const unsigned first = codes[0];
  if (first <= kEntryMask && std::all_of(codes.begin(), codes.end(), [=](VisitCode code) { return code == first; })) {
    return set_uniform(brick, first);
  }
  std::uint32_t& word = words_[index(brick)];
  const std::uint32_t before = word;
  std::uint32_t number = word & FieldView::kBrickNumber;
  if ((word & FieldView::kUniformBrick) != 0) {
    if (unused_.empty()) {
      number = static_cast<std::uint32_t>(codes_.size() / kVoxels);
      codes_.resize(codes_.size() + kVoxels);
      proximity_.resize(codes_.size());
    } else {
      number = unused_.back();
      unused_.pop_back();
    }
  }
  std::uint8_t* low = &codes_[number * kVoxels];
  std::uint8_t* high = &proximity_[number * kVoxels];
  unsigned any = 0, different = 0;
  for (const VisitCode code : codes) any |= code;
  const bool has_proximity = any >> kProximityShift != 0;
  for (unsigned row = 0; row < kVoxels; row += 8) {
    for (unsigned x = 0; x < 8; ++x) {
      const unsigned code = codes[row + x], at = offset_in_brick(x, row >> 3 & 7, row >> 6);
      different |= low[at] ^ (code & 0xff);
      low[at] = static_cast<std::uint8_t>(code);
      if (!has_proximity) continue;
      different |= high[at] ^ (code >> kProximityShift);
      high[at] = static_cast<std::uint8_t>(code >> kProximityShift);
    }
  }
  word = number | (has_proximity ? FieldView::kHasProximity : 0);
  return word != before || different != 0;
}

/// Cubes of 2, 4, 8 bricks an edge at multiples of as many, all uniform and alike.
void BrickCodes::join_cubes() {
  for (std::uint32_t& word : words_) {
    if ((word & FieldView::kUniformBrick) != 0) word &= ~FieldView::kCubeMask;
  }
  for (int log2 = 1; log2 <= FieldView::kMaxLog2Cube; ++log2) {
    const int edge = 1 << log2, half = edge / 2;
    const std::uint32_t smaller = static_cast<std::uint32_t>(log2 - 1) << FieldView::kCubeShift;
    Eigen::Vector3i at;
    for (at.z() = 0; at.z() + edge <= size_.z(); at.z() += edge) {
      for (at.y() = 0; at.y() + edge <= size_.y(); at.y() += edge) {
        for (at.x() = 0; at.x() + edge <= size_.x(); at.x() += edge) {
          std::uint32_t* first = &words_[index(at)];
          const std::uint32_t word = *first;
          if ((word & (FieldView::kUniformBrick | FieldView::kCubeMask)) != (FieldView::kUniformBrick | smaller) ||
              (word & kEntryMask) >= stop_begin_) {
            continue;
          }
          bool alike = true;
          for (int corner = 1; corner < 8 && alike; ++corner) {
            alike = word == first[half * ((corner & 1) * strides_[0] + (corner >> 1 & 1) * strides_[1] +
                                          (corner >> 2) * strides_[2])];
          }
          if (!alike) continue;
          const std::uint32_t joined = word + (1U << FieldView::kCubeShift);
          for (int z = 0; z < edge; ++z) {
            for (int y = 0; y < edge; ++y) std::fill_n(first + y * strides_[1] + z * strides_[2], edge, joined);
          }
        }
      }
    }
  }
}

VisitCode BrickCodes::code(const Eigen::Vector3i& voxel) const {
  const std::uint32_t word = words_[index(voxel / 8)];
  if ((word & FieldView::kUniformBrick) != 0) return static_cast<VisitCode>(word & kEntryMask);
  const Eigen::Vector3i in_brick = voxel - voxel / 8 * 8;
  const std::size_t at = (word & FieldView::kBrickNumber) * kVoxels +
                         offset_in_brick(static_cast<unsigned>(in_brick.x()), static_cast<unsigned>(in_brick.y()),
                                         static_cast<unsigned>(in_brick.z()));
  const unsigned proximity = (word & FieldView::kHasProximity) != 0 ? proximity_[at] : 0U;
  return static_cast<VisitCode>(codes_[at] | proximity << kProximityShift);
}

void BrickCodes::show(FieldView* view) const {
  view->brick_words = words_.data();
  view->brick_codes = codes_.data();
  view->brick_proximity = proximity_.data();
  view->brick_strides = strides_;
  view->first_brick_offset = strides_[0] + strides_[1] + strides_[2];
}

std::size_t BrickCodes::memory_bytes() const {
  return codes_.capacity() + proximity_.capacity() + (words_.capacity() + unused_.capacity()) * sizeof(std::uint32_t);
}

}  // namespace vantage
