#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "offboard/mapping/large_pages.h"

namespace vantage {

/// Storage of a map's bricks by number, in pieces of whole large pages: bricks stand where they are while others come,
/// and a fine map of a hundred thousand does not cost a page fault for each and a miss of the translation buffers for
/// each visit.
template <typename Brick>
class BrickPool {
 public:
  Brick& operator[](std::uint32_t i) { return pieces_[i / kPiece][i % kPiece]; }
  const Brick& operator[](std::uint32_t i) const { return pieces_[i / kPiece][i % kPiece]; }

  std::size_t size() const { return size_; }
  /// Adds a brick, which has the number size() - 1 then. After the pool was copied, the first call may move bricks.
  void add() {
    if (size_ % kPiece == 0) pieces_.emplace_back();
    pieces_.back().reserve(kPiece);
    pieces_.back().emplace_back();
    ++size_;
  }

 private:
  static constexpr std::uint32_t kPiece = 4096;
  static_assert(kPiece * sizeof(Brick) % LargePageAllocator<Brick>::kPage == 0);

  std::vector<std::vector<Brick, LargePageAllocator<Brick>>> pieces_;
  std::size_t size_ = 0;
};

}  // namespace vantage
