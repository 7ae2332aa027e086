#include "ground/off_cells.h"

#include <algorithm>
#include <cmath>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {
constexpr int kChunk = 32;
}

OMNIFLEET_WIDE void findOff(const float* means, const float* floor, int n, const OffTest& test,
                            std::uint8_t* off) {
  const float along = test.along, across = test.across, along_noise = test.along_noise,
              across_noise = test.across_noise;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float *p = means + 3 * i, *r = floor + 3 * i;
    const float squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], rr = squared > 1.0f ? squared : 1.0f;
    const float pr = p[0] * r[0] + p[1] * r[1] + p[2] * r[2], pp = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    const float length = std::sqrt(rr), hue = across * rr + across_noise * length;
    off[i] =
        (std::abs(pr - rr) > along * rr + along_noise * length) | (pp * rr - pr * pr > hue * hue) ? 1 : 0;
  }
}

namespace {

struct Compared {
  const float *p0, *p1, *p2, *r0, *r1, *r2;
  float *gain, *across2, *hue_off, *off;
};

OMNIFLEET_WIDE void compareCells(const Compared& cells, std::size_t n, const CellTolerance& tolerance) {
  const auto [along, across, noise_sigmas, channel, hue] = tolerance;
  const auto [p0, p1, p2, r0, r1, r2, gain_of, across2_of, hue_off_of, off_of] = cells;
#pragma GCC ivdep
  for (std::size_t i = 0; i < n; ++i) {
    const float squared = r0[i] * r0[i] + r1[i] * r1[i] + r2[i] * r2[i], rr = squared > 1.0f ? squared : 1.0f;
    const float gain = (p0[i] * r0[i] + p1[i] * r1[i] + p2[i] * r2[i]) / rr;
    const float across2 = (p0[i] * p0[i] + p1[i] * p1[i] + p2[i] * p2[i]) / rr - gain * gain;
    const float per_level = noise_sigmas / std::sqrt(rr), a = along + channel * per_level,
                b = across + hue * per_level;
    const float along_off = (gain - 1.0f) * (gain - 1.0f) / (a * a), hue_off = across2 / (b * b);
    gain_of[i] = gain;
    across2_of[i] = across2;
    hue_off_of[i] = hue_off;
    off_of[i] = along_off < hue_off ? hue_off : along_off;
  }
}

}  // namespace

void CellHues::compare(const CellTolerance& tolerance) {
  compareCells({column(kMean), column(kMean + 1), column(kMean + 2), column(kFloor), column(kFloor + 1),
                column(kFloor + 2), column(kGain), column(kAcross2), column(kHueOff), column(kOff)},
               size(), tolerance);
}

namespace {

constexpr std::uint8_t kHole = 1, kShadow = 2;

OMNIFLEET_WIDE void classifyAround(const Appearance* above, const Appearance* here, const Appearance* below,
                                   int n, Appearance first, Appearance last, Around* out) {
  const auto marksOf = [ first, last ](const Appearance* row, int x) __attribute__((always_inline)) {
    const auto of = [ first, last ](Appearance appearance) __attribute__((always_inline)) {
      return static_cast<std::uint8_t>((appearance == kFloorAppearance ? kHole : 0) |
                                       ((appearance >= first) & (appearance <= last) ? kShadow : 0));
    };
    return static_cast<std::uint8_t>(of(row[x]) | of(row[x + 1]) | of(row[x + 2]));
  };
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const auto marks =
            static_cast<std::uint8_t>(marksOf(above, x) | marksOf(here, x) | marksOf(below, x));
        const Around whole = (marks & kShadow) != 0 ? kSomeShadow : kAllOfObject;
        out[x] = (marks & kHole) != 0 ? kMixed : whole;
      });
}

}  // namespace

void classifyAround(const Appearance* above, const Appearance* here, const Appearance* below, int n,
                    float deepest, Around* out) {
  Appearance first = greyAppearance(deepest), last = greyAppearance(1.0f);
  while (!isShadow(first, deepest)) ++first;
  while (!isShadow(last, deepest)) --last;
  classifyAround(above, here, below, n, first, last, out);
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
