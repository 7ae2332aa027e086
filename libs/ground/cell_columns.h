#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace omnifleet::ground {

/// Values of FloorTolerance and FloorNoise, for a pixel or for the mean of a cell.
struct CellTolerance {
  float along, across;
  float noise_sigmas, channel, hue;
};

/// Structure of arrays for selected cells of a row: kKinds numbers per cell, one array per kind, for
/// vectorised arithmetic.
template <std::size_t kKinds>
class CellColumns {
 public:
  /// @param most maximum number of cells in a row
  explicit CellColumns(int most) : x_(static_cast<std::size_t>(most)) {
    for (std::vector<float>& of : numbers_) of.resize(x_.size());
  }
  void clear() { size_ = 0; }
  std::size_t size() const { return size_; }
  int x(std::size_t i) const { return x_[i]; }

 protected:
  /// Appends the x-th cell of the row.
  /// @return its index here
  std::size_t append(int x) {
    x_[size_] = x;
    return size_++;
  }
  /// Writes three channels to the kinds from `first` on.
  void putColour(std::size_t first, std::size_t i, const float* colour) {
    for (std::size_t c = 0; c < 3; ++c) numbers_[first + c][i] = colour[c];
  }
  float* column(std::size_t kind) { return numbers_[kind].data(); }
  float number(std::size_t kind, std::size_t i) const { return numbers_[kind][i]; }

 private:
  std::vector<int> x_;
  std::array<std::vector<float>, kKinds> numbers_;
  std::size_t size_ = 0;
};

}  // namespace omnifleet::ground
