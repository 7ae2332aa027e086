#include "ground/off_cells.h"

#include <cmath>

#include "geometry/wide.h"

namespace omnifleet::ground {

OMNIFLEET_WIDE void findOff(const float* means, const float* floor, int n, const OffTest& test,
                            std::uint8_t* off) {
  const float along = test.along, across = test.across, added = test.added;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float *p = means + 3 * i, *r = floor + 3 * i;
    const float squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], rr = squared > 1.0f ? squared : 1.0f;
    const float pr = p[0] * r[0] + p[1] * r[1] + p[2] * r[2], pp = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    const float noise = added * std::sqrt(rr), hue = across * rr + noise;
    off[i] = (std::abs(pr - rr) > along * rr + noise) | (pp * rr - pr * pr > hue * hue) ? 1 : 0;
  }
}

OMNIFLEET_WIDE void spreadMarks(const std::uint8_t* above, const std::uint8_t* here,
                                const std::uint8_t* below, int n, std::uint8_t* out) {
#pragma GCC ivdep
  for (int x = 0; x < n; ++x) {
    out[x] = static_cast<std::uint8_t>(above[x] | above[x + 1] | above[x + 2] | here[x] | here[x + 1] |
                                       here[x + 2] | below[x] | below[x + 1] | below[x + 2]);
  }
}

}  // namespace omnifleet::ground
