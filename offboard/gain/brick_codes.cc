#include "offboard/gain/brick_codes.h"

#include <algorithm>

namespace vantage {
namespace {

constexpr std::size_t kVoxels = 64;  // of a cell
constexpr std::size_t kPad = 3;      // kernels read a code as the lowest byte of 32 bits

constexpr std::uint32_t span(int edge) { return static_cast<std::uint32_t>(edge - 1) << FieldView::kSpanShift; }

}  // namespace

void BrickCodes::reset(const Eigen::Vector3i& size_bricks, const VisitTable& table, std::size_t expected) {
  size_ = size_bricks;
  strides_ = {size_.x() + 2, (size_.x() + 2) * (size_.y() + 2)};
  stop_begin_ = static_cast<std::uint32_t>(table.stop_begin);
  octet_bit_ = table.octet_bit();
  words_.assign(kCellsPerBrick * static_cast<std::size_t>(strides_[1]) * static_cast<std::size_t>(size_.z() + 2),
                FieldView::kUniformCell | static_cast<std::uint32_t>(table.sentinel()));
  for (auto* plane : {&codes_, &proximity_}) {
    plane->clear();
    plane->reserve(expected * kCellsPerBrick * kVoxels + kPad);
    plane->insert(plane->end(), kPad, 0);
  }
  unused_.clear();
}

bool BrickCodes::set_uniform(const Eigen::Vector3i& brick, unsigned entry) {
  std::uint32_t* words = &words_[index(brick)];
  bool changed = false;
  for (std::size_t cell = 0; cell < kCellsPerBrick; ++cell) changed |= set_uniform_cell(words + cell, entry);
  return changed;
}

bool BrickCodes::set(const Eigen::Vector3i& brick, const Codes& codes) {
  std::uint32_t* words = &words_[index(brick)];
  bool changed = false;
  CellCodes of_cell;
  for (unsigned cell = 0; cell < kCellsPerBrick; ++cell) {
    const VisitCode* first = &codes[4 * (cell & 1) + 32 * (cell >> 1 & 1) + 256 * (cell >> 2)];
    for (unsigned z = 0; z < 4; ++z) {
      for (unsigned y = 0; y < 4; ++y) std::copy_n(first + 8 * y + 64 * z, 4, &of_cell[4 * y + 16 * z]);
    }
    changed |= set_cell(words + cell, of_cell);
  }
  return changed;
}

bool BrickCodes::set_uniform_cell(std::uint32_t* word, unsigned entry) {
  const std::uint32_t before = *word & ~FieldView::kSpanMask, after = FieldView::kUniformCell | entry;
  if ((*word & FieldView::kUniformCell) == 0) unused_.push_back(*word & FieldView::kCellNumber);
  *word = after;
  return after != before;
}

/// Sets the bit of octets whose voxels are alike, have no proximity and let rays through.
void BrickCodes::mark_octets(CellCodes* codes) const {
  for (unsigned octet = 0; octet < 8; ++octet) {
    VisitCode* first = &(*codes)[offset_in_cell(2 * octet & 2, octet & 2, octet >> 1 & 2)];
    if (*first > 0xff || stops(*first)) continue;
    constexpr std::array<unsigned, 8> kOffsets = {0, 1, 4, 5, 16, 17, 20, 21};  // of offset_in_cell()
    unsigned unlike = 0;
    for (const unsigned offset : kOffsets) unlike |= static_cast<unsigned>(first[offset] ^ *first);
    if (unlike != 0) continue;
    for (const unsigned offset : kOffsets) first[offset] = static_cast<VisitCode>(first[offset] | octet_bit_);
  }
}

bool BrickCodes::set_cell(std::uint32_t* word, const CellCodes& plain_codes) {
  unsigned any = 0, unlike = 0;
  for (const VisitCode code : plain_codes) {
    any |= code;
    unlike |= static_cast<unsigned>(code ^ plain_codes[0]);
  }
  if (unlike == 0 && any <= kEntryMask) return set_uniform_cell(word, any);
  CellCodes codes = plain_codes;
  if (octet_bit_ != 0) mark_octets(&codes);
  const std::uint32_t before = *word;
  std::uint32_t number = before & FieldView::kCellNumber;
  if ((before & FieldView::kUniformCell) != 0) {
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
  unsigned different = 0;
  for (std::size_t i = 0; i < kVoxels; ++i) {
    different |= low[i] ^ (codes[i] & 0xffU);
    low[i] = static_cast<std::uint8_t>(codes[i]);
  }
  const bool has_proximity = any >> kProximityShift != 0;
  for (std::size_t i = 0; i < kVoxels && has_proximity; ++i) {
    different |= high[i] ^ (static_cast<unsigned>(codes[i]) >> kProximityShift);
    high[i] = static_cast<std::uint8_t>(codes[i] >> kProximityShift);
  }
  *word = number | (has_proximity ? FieldView::kHasProximity : 0);
  return *word != before || different != 0;
}

/// Cubes of 2, 4, ... cells an edge at multiples of as many, all uniform and alike.
void BrickCodes::join_cubes() {
  Eigen::Vector3i at;
  for (at.z() = 0; at.z() < size_.z(); ++at.z()) {
    for (at.y() = 0; at.y() < size_.y(); ++at.y()) {
      for (at.x() = 0; at.x() < size_.x(); ++at.x()) {
        std::uint32_t* words = &words_[index(at)];
        const std::uint32_t entry = words[0] & ~FieldView::kSpanMask;
        bool alike = true;
        for (std::size_t cell = 0; cell < kCellsPerBrick; ++cell) {
          std::uint32_t& word = words[cell];
          if ((word & FieldView::kUniformCell) == 0) {
            alike = false;
            continue;
          }
          word &= ~FieldView::kSpanMask;
          alike = alike && word == entry;
          if (!stops(word)) word |= span(4);
        }
        if (alike && !stops(entry)) std::fill_n(words, kCellsPerBrick, entry | span(8));
      }
    }
  }
  for (int edge = 16; edge <= FieldView::kMaxEdge; edge *= 2) {
    const int bricks = edge / 8, half = bricks / 2;
    for (at.z() = 0; at.z() + bricks <= size_.z(); at.z() += bricks) {
      for (at.y() = 0; at.y() + bricks <= size_.y(); at.y() += bricks) {
        for (at.x() = 0; at.x() + bricks <= size_.x(); at.x() += bricks) {
          const std::uint32_t word = words_[index(at)];
          if ((word & FieldView::kUniformCell) == 0 || (word & FieldView::kSpanMask) != span(edge / 2)) continue;
          bool alike = true;
          for (int corner = 1; corner < 8 && alike; ++corner) {
            alike = word == words_[index(at + half * Eigen::Vector3i(corner & 1, corner >> 1 & 1, corner >> 2))];
          }
          if (!alike) continue;
          for (int z = 0; z < bricks; ++z) {
            for (int y = 0; y < bricks; ++y) {
              std::fill_n(&words_[index(at + Eigen::Vector3i(0, y, z))],
                          kCellsPerBrick * static_cast<std::size_t>(bricks),
                          (word & ~FieldView::kSpanMask) | span(edge));
            }
          }
        }
      }
    }
  }
}

VisitCode BrickCodes::code(const Eigen::Vector3i& voxel) const {
  const auto x = static_cast<unsigned>(voxel.x()), y = static_cast<unsigned>(voxel.y()),
             z = static_cast<unsigned>(voxel.z());
  const std::uint32_t word = words_[index(voxel / 8) + cell_in_brick(x, y, z)];
  if ((word & FieldView::kUniformCell) != 0) return static_cast<VisitCode>(word & kEntryMask);
  const std::size_t at = (word & FieldView::kCellNumber) * kVoxels + offset_in_cell(x, y, z);
  const unsigned proximity = (word & FieldView::kHasProximity) != 0 ? proximity_[at] : 0U;
  return static_cast<VisitCode>((codes_[at] & ~octet_bit_) | proximity << kProximityShift);
}

void BrickCodes::show(FieldView* view) const {
  view->cell_words = words_.data();
  view->cell_codes = codes_.data();
  view->cell_proximity = proximity_.data();
  view->brick_strides = strides_;
  view->first_brick = 1 + strides_[0] + strides_[1];
}

std::size_t BrickCodes::memory_bytes() const {
  return codes_.capacity() + proximity_.capacity() + (words_.capacity() + unused_.capacity()) * sizeof(std::uint32_t);
}

}  // namespace vantage
