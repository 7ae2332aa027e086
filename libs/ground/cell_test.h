#pragma once

#include <cstddef>
#include <cstdint>

#include "ground/cell_columns.h"

namespace omnifleet::ground {

/// Parameters of the floor test for the pixels of a cell. A pixel p is floor where (p·r/|r|² − 1)² · along ≤
/// 1 and (|p|²/|r|² − (p·r/|r|²)²) · across ≤ 1.
struct CellTest {
  float blue, green, red;  ///< r, the floor colour at this cell
  float squared;           ///< |r|², at least 1
  float along, across;     ///< 1 / squared tolerances
  float least_hue;         ///< values of the second term up to this one count as 0
  float other_hue;         ///< a pixel with a larger second term has another hue than the floor
  /// Vector t orthogonal to r for faint hues. A pixel p also has another hue where p · t > max(p·r/|r|²,
  /// least_gain). 0 if no faint hue is known.
  float to_blue, to_green, to_red;
  float least_gain;
};

/// Floor tolerances for the pixels of selected cells (FloorTolerance::testFor).
class CellLimits : public CellColumns<7> {
 public:
  using CellColumns::CellColumns;
  /// @param floor floor colour at the x-th cell of a row, three numbers
  void add(int x, const float* floor) { putColour(kFloor, append(x), floor); }
  void settle(const CellTolerance& tolerance);

  /// |r|² of the floor colour r, at least 1.
  float squared(std::size_t i) const { return number(kSquared, i); }
  float length(std::size_t i) const { return number(kLength, i); }
  /// Squared tolerances as shares of |r|².
  float along2(std::size_t i) const { return number(kAlong2, i); }
  float across2(std::size_t i) const { return number(kAcross2, i); }

 private:
  enum : std::size_t { kFloor = 0, kSquared = 3, kLength, kAlong2, kAcross2 };
};

/// 4×4 bytes of an image or a buffer.
template <typename Byte>
struct CellBytes {
  Byte* first;
  std::ptrdiff_t row_step;
};

/// Tests the pixels of one cell.
/// @param pixels BGR8 (each row is read four bytes beyond its end) or grey
/// @param valid 255 where a pixel counts, else 0
/// @param strength 0 for floor, else the larger of the two terms, at most 255
/// @param appearances appearance class of pixels that are not floor, else kFloorAppearance
void testColourCell(CellBytes<const std::uint8_t> pixels, const CellTest& test,
                    CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                    CellBytes<std::uint8_t> appearances);
void testGreyCell(CellBytes<const std::uint8_t> pixels, const CellTest& test,
                  CellBytes<const std::uint8_t> valid, CellBytes<std::uint8_t> strength,
                  CellBytes<std::uint8_t> appearances);

}  // namespace omnifleet::ground
