#pragma once

#include <cstddef>
#include <cstdint>

#include "ground/cell_columns.h"

namespace omnifleet::ground {

/// What a cell's pixels are compared with: p is floor where (p·r/|r|² − 1)² · along ≤ 1 and
/// (|p|²/|r|² − (p·r/|r|²)²) · across ≤ 1.
struct CellTest {
  float blue, green, red;  ///< r, the floor's colour there
  float squared;           ///< |r|², at least 1
  float along, across;     ///< 1 ÷ the squared tolerances
  float least_hue;         ///< the second term, up to which it is nothing
  float other_hue;         ///< the second term, beyond which a pixel has another hue than the floor
  /// A colour that multiples of r give 0 with: p has another hue, too, where p · this > p·r/|r|², or more
  /// than least_gain where that is less. 0 where no such is known.
  float to_blue, to_green, to_red;
  float least_gain;
};

/// What the pixels of cells may be off by (FloorTolerance::testFor).
class CellLimits : public CellColumns<7> {
 public:
  using CellColumns::CellColumns;
  /// @param floor its colour at the x-th cell of a row, three numbers
  void add(int x, const float* floor) { putColour(kFloor, append(x), floor); }
  void settle(const CellTolerance& tolerance);

  /// Of the floor's colour r: |r|², at least 1, …
  float squared(std::size_t i) const { return number(kSquared, i); }
  float length(std::size_t i) const { return number(kLength, i); }
  /// … and the squared tolerances as shares of that.
  float along2(std::size_t i) const { return number(kAlong2, i); }
  float across2(std::size_t i) const { return number(kAcross2, i); }

 private:
  enum : std::size_t { kFloor = 0, kSquared = 3, kLength, kAlong2, kAcross2 };
};

/// 4×4 bytes of a larger image, or of a buffer.
template <typename Byte>
struct CellBytes {
  Byte* first;
  std::ptrdiff_t row_step;
};

/// Tests the pixels of one cell.
/// @param pixels BGR8 (the rows are read four bytes beyond their end) or grey
/// @param valid 255 where a pixel counts, else 0
/// @param strength 0 for floor, else the larger of the two terms, at most 255
/// @param looks Look of what is not floor, else kFloorLook
void testColourCell(CellBytes<const std::uint8_t> pixels, const CellTest& test,
                    CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                    CellBytes<std::uint8_t> looks);
void testGreyCell(CellBytes<const std::uint8_t> pixels, const CellTest& test,
                  CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                  CellBytes<std::uint8_t> looks);

}  // namespace omnifleet::ground
