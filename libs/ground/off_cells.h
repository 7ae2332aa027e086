#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "ground/look.h"

namespace omnifleet::ground {

/// Tolerances of FloorTolerance for the mean of a cell, multiplied out, so that no cell needs a division:
/// with g = p·r and R = |r|², p is off the floor colour r where |g − R| > along · R + along_noise · |r| or
/// |p|² R − g² > (across · R + across_noise · |r|)².
struct OffTest {
  float along, across, along_noise, across_noise;
};

/// off[i] = 1 where the i-th of n means is off the floor, else 0; three numbers a cell.
void findOff(const float* means, const float* floor, int n, const OffTest& test, std::uint8_t* off);

/// Means of cells beside the floor's colour there: gathered, then all compared at once.
class CellHues {
 public:
  /// FloorTolerance and FloorNoise of a cell's mean.
  struct Tolerance {
    float along, across;
    float noise_sigmas, channel, hue;
  };

  explicit CellHues(int most) : x_(static_cast<std::size_t>(most)) {
    for (std::vector<float>& of : numbers_) of.resize(x_.size());
  }
  void clear() { size_ = 0; }
  /// @param mean of the x-th cell of a row. @param floor there; three numbers each
  void add(int x, const float* mean, const float* floor) {
    x_[size_] = x;
    for (std::size_t c = 0; c < 3; ++c) {
      numbers_[kMean + c][size_] = mean[c];
      numbers_[kFloor + c][size_] = floor[c];
    }
    ++size_;
  }
  void compare(const Tolerance& tolerance);

  std::size_t size() const { return size_; }
  int x(std::size_t i) const { return x_[i]; }
  /// Of p beside r: p·r ÷ |r|², …
  float gain(std::size_t i) const { return numbers_[kGain][i]; }
  /// … |p|² ÷ |r|² − gain², what is left of p's squared difference beside that, …
  float across2(std::size_t i) const { return numbers_[kAcross2][i]; }
  /// … the same as a multiple of its squared tolerance, and the larger one of such multiples.
  float hueOff(std::size_t i) const { return numbers_[kHueOff][i]; }
  float off(std::size_t i) const { return numbers_[kOff][i]; }

 private:
  enum : std::size_t { kMean = 0, kFloor = 3, kGain = 6, kAcross2, kHueOff, kOff, kNumbers };
  std::vector<int> x_;
  std::array<std::vector<float>, kNumbers> numbers_;
  std::size_t size_ = 0;
};

/// out[x] = 1 where any of the 3×3 around x is 1, else 0; n + 2 bytes of each row, from x − 1 on.
void spreadMarks(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below, int n,
                 std::uint8_t* out);

/// What the 3×3 cells around one show that are object all over.
enum Around : std::uint8_t {
  kMixed,       ///< not all of them are
  kAllOfThing,  ///< they are, none of them looks like a shadow
  kSomeShade,   ///< they are, some of them look like a shadow
};
/// out[x] for n cells; n + 2 Looks of each row, from x − 1 on: kFloorLook where a cell may be mixed.
/// @param deepest shade, see isShade()
void lookAround(const Look* above, const Look* here, const Look* below, int n, float deepest, Around* out);

}  // namespace omnifleet::ground
