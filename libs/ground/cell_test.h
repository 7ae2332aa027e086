#pragma once

#include <cstddef>
#include <cstdint>

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
