#pragma once

#include <cstdint>

#include "ground/appearance_class.h"
#include "ground/cell_columns.h"

namespace omnifleet::ground {

/// Tolerances of FloorTolerance for the mean of a cell, multiplied out so that no cell needs a division. With
/// g = p·r and R = |r|², p is off the floor colour r where |g − R| > along · R + along_noise · |r| or |p|² R
/// − g² > (across · R + across_noise · |r|)².
struct OffTest {
  float along, across, along_noise, across_noise;
};

/// off[i] = 1 where the i-th of n means is off the floor, else 0. Three floats per cell.
void findOff(const float* means, const float* floor, int n, const OffTest& test, std::uint8_t* off);

/// Means of cells compared with the floor's colour there.
class CellHues : public CellColumns<10> {
 public:
  using CellColumns::CellColumns;
  /// @param x column of the cell in its row @param mean of the cell @param floor colour there; three floats
  /// each
  void add(int x, const float* mean, const float* floor) {
    const std::size_t i = append(x);
    putColour(kMean, i, mean);
    putColour(kFloor, i, floor);
  }
  void compare(const CellTolerance& tolerance);

  /// gain = p·r ÷ |r|², of the mean p and the floor colour r.
  float gain(std::size_t i) const { return number(kGain, i); }
  /// across2 = |p|² ÷ |r|² − gain²: the part of p's squared difference that is not brightness.
  float across2(std::size_t i) const { return number(kAcross2, i); }
  /// across2 as a multiple of its squared tolerance (hueOff), and the larger of this and the same multiple
  /// for brightness (off).
  float hueOff(std::size_t i) const { return number(kHueOff, i); }
  float off(std::size_t i) const { return number(kOff, i); }

 private:
  enum : std::size_t { kMean = 0, kFloor = 3, kGain = 6, kAcross2, kHueOff, kOff };
};

/// out[x] = 1 where any of the 3×3 cells around x is 1, else 0. Reads n + 2 bytes of each row, from x − 1 on.
void spreadMarks(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below, int n,
                 std::uint8_t* out);

/// Content of the 3×3 cells around a cell, where all of them are entirely object.
enum Around : std::uint8_t {
  kMixed,        ///< not all of them are
  kAllOfObject,  ///< all of them are, and none resembles a shadow
  kSomeShadow,   ///< all of them are, and some resemble a shadow
};
/// Sets out[x] for n cells. Reads n + 2 Appearances of each row, from x − 1 on; kFloorAppearance where a cell
/// may be mixed.
/// @param deepest shadow, see isShadow()
void classifyAround(const Appearance* above, const Appearance* here, const Appearance* below, int n,
                    float deepest, Around* out);

}  // namespace omnifleet::ground
