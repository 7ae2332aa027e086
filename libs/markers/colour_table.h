#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dataset/markers.h"

namespace omnifleet::markers {

struct ColourOptions {
  double chroma_tolerance;  ///< distance of max-normalised colours
  double min_brightness;    ///< grey levels, of the brightest channel
  double min_saturation;    ///< 1 − min/max
};

/// Class of a pixel by its chroma normalised by the brightest channel, which light does not change: a table
/// of 32 steps per channel (32 KB, stays in the cache). Class 0 is none, class i + 1 the i-th colour; the
/// nearest colour within the tolerance wins.
class ColourTable {
 public:
  ColourTable(const std::vector<dataset::Rgb>& colours, const ColourOptions& options);

  std::uint8_t classOf(const std::uint8_t* bgr) const {
    return table_[static_cast<std::size_t>((bgr[0] >> 3) << 10 | (bgr[1] >> 3) << 5 | (bgr[2] >> 3))];
  }
  std::size_t classes() const { return colours_ + 1; }
  /// How many of the first blocks of kBlock pixels in a row surely have no class in them: the quick look at
  /// floor.
  static constexpr int kBlock = 16;
  int blocksWithout(const std::uint8_t* bgr, int blocks) const;

 private:
  std::array<std::uint8_t, 32768> table_{};
  std::size_t colours_ = 0;
  // Of all steps that have a class: least brightest channel, greatest darkest channel ÷ brightest, rounded
  // up.
  static constexpr int kWhole = 256;
  int least_brightest_ = 32, greatest_share_ = 0;
};

}  // namespace omnifleet::markers
