#include "structure/border.h"

#include <array>
#include <cstddef>

namespace omnifleet::structure::detail {
namespace {

/// The cells with a margin of one unknown cell, so that every free cell has neighbours.
class PaddedCells {
 public:
  explicit PaddedCells(const SurfaceMap& map)
      : width_(map.width + 2),
        cells_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(map.height + 2), Cell::kUnknown) {
    for (int y = 0; y < map.height; ++y)
      for (int x = 0; x < map.width; ++x)
        cells_[static_cast<std::size_t>((y + 1) * width_ + x + 1)] =
            map.cells[static_cast<std::size_t>(y * map.width + x)];
  }

  int size() const { return static_cast<int>(cells_.size()); }
  int xOf(int at) const { return at % width_; }
  Cell operator[](int at) const { return cells_[static_cast<std::size_t>(at)]; }
  bool isFree(int at) const { return (*this)[at] == Cell::kFree; }
  /// Offset of the neighbour in the direction of a side: 0 = +x, 1 = +y, 2 = −x, 3 = −y.
  int step(int side) const {
    return std::array<int, 4>{1, width_, -1, -width_}[static_cast<std::size_t>(side)];
  }
  /// Index in the map.
  int unpadded(int at) const {
    const int x = at % width_ - 1, y = at / width_ - 1;
    const bool is_inside = x >= 0 && x < width_ - 2 && y >= 0 && y < size() / width_ - 2;
    return is_inside ? x + y * (width_ - 2) : kOutside;
  }

 private:
  int width_;
  std::vector<Cell> cells_;
};

class BorderWalk {
 public:
  explicit BorderWalk(const SurfaceMap& map)
      : cells_(map), walked_(static_cast<std::size_t>(cells_.size()), 0) {}

  std::vector<Border> all() {
    std::vector<Border> borders;
    for (int at = 0; at < cells_.size(); ++at) {
      if (!cells_.isFree(at)) continue;
      for (int side = 0; side < 4; ++side)
        if (!cells_.isFree(at + cells_.step(side)) && !isWalked(at, side))
          borders.push_back(follow(at, side));
    }
    return borders;
  }

 private:
  bool isWalked(int at, int side) const {
    return (walked_[static_cast<std::size_t>(at)] >> static_cast<unsigned>(side) & 1U) != 0;
  }

  /// Walks along the sides of free cells. The cell beyond the current side is on the left.
  Border follow(int at, int side) {
    Border border;
    while (!isWalked(at, side)) {
      walked_[static_cast<std::size_t>(at)] |= static_cast<std::uint8_t>(1U << static_cast<unsigned>(side));
      append(border, at + cells_.step(side));
      // ∮ x dy: the side +x is walked downwards, the side −x upwards.
      if (side == 0) border.area -= cells_.xOf(at) + 1;
      if (side == 2) border.area += cells_.xOf(at);
      const int heading = (side + 3) % 4, ahead = at + cells_.step(heading),
                diagonal = ahead + cells_.step(side);
      if (!cells_.isFree(ahead)) {
        if (cells_[diagonal] == Cell::kOccupied) append(border, diagonal);
        side = heading;
      } else if (!cells_.isFree(diagonal)) {
        at = ahead;
      } else {
        at = diagonal;
        side = (side + 1) % 4;
      }
    }
    std::vector<int>& met = border.cells;
    while (met.size() > 1 && met.front() == met.back() && met.back() != kOutside) met.pop_back();
    return border;
  }

  void append(Border& border, int padded) const {
    const int cell = cells_.unpadded(padded);
    if (border.cells.empty() || cell == kOutside || border.cells.back() != cell) border.cells.push_back(cell);
  }

  PaddedCells cells_;
  std::vector<std::uint8_t> walked_;  ///< bit per side
};

}  // namespace

std::vector<Border> bordersOf(const SurfaceMap& map) {
  return BorderWalk(map).all();
}

}  // namespace omnifleet::structure::detail
