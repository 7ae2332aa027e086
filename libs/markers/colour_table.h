#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dataset/markers.h"

namespace omnifleet::markers {

struct ColourOptions {
  double chroma_tolerance;  ///< maximum distance between max-normalised colours
  double min_brightness;    ///< grey levels of the brightest channel
  double min_saturation;    ///< 1 − min/max
};

/// Distance of two colours after the division by their brightest channels.
double chromaDistance(const dataset::Rgb& a, const dataset::Rgb& b);

/// Class of a pixel by its chroma, normalised by the brightest channel so that it does not depend on
/// illumination. A table with 32 steps per channel (32 KB, fits the cache). Class 0 is none, class i + 1 is
/// the i-th colour. The nearest colour within the tolerance is used.
class ColourTable {
 public:
  ColourTable(const std::vector<dataset::Rgb>& colours, const ColourOptions& options);

  std::uint8_t classOf(const std::uint8_t* bgr) const {
    return table_[static_cast<std::size_t>((bgr[0] >> 3) << 10 | (bgr[1] >> 3) << 5 | (bgr[2] >> 3))];
  }
  std::size_t classes() const { return colours_ + 1; }
  /// Number of leading blocks of kBlock pixels in a row that certainly contain no class. A fast test that
  /// skips the floor.
  static constexpr int kBlock = 16;
  int blocksWithout(const std::uint8_t* bgr, int blocks) const;

 private:
  std::array<std::uint8_t, 32768> table_{};
  std::size_t colours_ = 0;
  // Over all steps with a class: the minimum of the brightest channel, and the maximum of darkest ÷ brightest
  // channel (in 1/kWhole, rounded up).
  static constexpr int kWhole = 256;
  int least_brightest_ = 32, greatest_share_ = 0;
};

}  // namespace omnifleet::markers
