#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

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

/// What the pixels of cells may be off by: gathered, then made of all at once.
class CellLimits {
 public:
  /// FloorTolerance and FloorNoise of a pixel.
  struct Tolerance {
    float along, across;
    float noise_sigmas, channel, hue;
  };

  explicit CellLimits(int most) : x_(static_cast<std::size_t>(most)) {
    for (std::vector<float>& of : numbers_) of.resize(x_.size());
  }
  void clear() { size_ = 0; }
  /// @param floor its colour at the x-th cell of a row, three numbers
  void add(int x, const float* floor) {
    x_[size_] = x;
    for (std::size_t c = 0; c < 3; ++c) numbers_[kFloor + c][size_] = floor[c];
    ++size_;
  }
  void settle(const Tolerance& tolerance);

  std::size_t size() const { return size_; }
  int x(std::size_t i) const { return x_[i]; }
  /// Of the floor's colour r: |r|², at least 1, …
  float squared(std::size_t i) const { return numbers_[kSquared][i]; }
  float length(std::size_t i) const { return numbers_[kLength][i]; }
  /// … and the squared tolerances as shares of that (FloorTolerance::testFor).
  float along2(std::size_t i) const { return numbers_[kAlong2][i]; }
  float across2(std::size_t i) const { return numbers_[kAcross2][i]; }

 private:
  enum : std::size_t { kFloor = 0, kSquared = 3, kLength, kAlong2, kAcross2, kNumbers };
  std::vector<int> x_;
  std::array<std::vector<float>, kNumbers> numbers_;
  std::size_t size_ = 0;
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
