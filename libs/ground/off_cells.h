#pragma once

#include <cstdint>

#include "ground/cell_columns.h"
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

/// Means of cells beside the floor's colour there.
class CellHues : public CellColumns<10> {
 public:
  using CellColumns::CellColumns;
  /// @param mean of the x-th cell of a row. @param floor there; three numbers each
  void add(int x, const float* mean, const float* floor) {
    const std::size_t i = append(x);
    putColour(kMean, i, mean);
    putColour(kFloor, i, floor);
  }
  void compare(const CellTolerance& tolerance);

  /// Of p beside r: p·r ÷ |r|², …
  float gain(std::size_t i) const { return number(kGain, i); }
  /// … |p|² ÷ |r|² − gain², what is left of p's squared difference beside that, …
  float across2(std::size_t i) const { return number(kAcross2, i); }
  /// … the same as a multiple of its squared tolerance, and the larger one of such multiples.
  float hueOff(std::size_t i) const { return number(kHueOff, i); }
  float off(std::size_t i) const { return number(kOff, i); }

 private:
  enum : std::size_t { kMean = 0, kFloor = 3, kGain = 6, kAcross2, kHueOff, kOff };
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
