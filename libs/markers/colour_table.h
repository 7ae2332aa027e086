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

/// Two colours that touch on a marker. Pixels on their border, and all pixels of a narrow region in a blurred
/// image, show mixtures of them.
struct ColourPair {
  std::size_t one = 0, other = 0;  ///< indices of the colours
};

/// Class of a pixel by its chroma, normalised by the brightest channel so that it does not depend on
/// illumination. A table with 32 steps per channel (32 KB, fits the cache). Class 0 is none, class i + 1 is
/// the i-th colour. The nearest colour within the tolerance is used.
class ColourTable {
 public:
  ColourTable(const std::vector<dataset::Rgb>& colours, const ColourOptions& options,
              const std::vector<ColourPair>& touching = {});

  /// Class, or kMixture for a pixel that has no class but may be a mixture of touching colours.
  std::uint8_t labelOf(const std::uint8_t* bgr) const { return table_[indexOf(bgr)]; }
  std::uint8_t classOf(const std::uint8_t* bgr) const {
    const std::uint8_t label = labelOf(bgr);
    return label == kMixture ? std::uint8_t{0} : label;
  }
  static constexpr std::uint8_t kMixture = 255;
  /// 1 for the chroma of the class, decreasing to 0 at a distance of kFarChroma. Independent of tolerances.
  float similarity(const std::uint8_t* bgr, std::uint8_t colour) const {
    return similarity_[colour - 1U][indexOf(bgr)] * (1.0F / 255.0F);
  }
  static constexpr double kFarChroma = 0.6;
  std::size_t classes() const { return similarity_.size() + 1; }
  /// Number of leading blocks of kBlock pixels in a row that certainly contain no class. A fast test that
  /// skips the floor.
  static constexpr int kBlock = 16;
  int blocksWithout(const std::uint8_t* bgr, int blocks) const;

 private:
  using Table = std::array<std::uint8_t, 32768>;
  static std::size_t indexOf(const std::uint8_t* bgr) {
    return static_cast<std::size_t>((bgr[0] >> 3) << 10 | (bgr[1] >> 3) << 5 | (bgr[2] >> 3));
  }
  Table table_{};
  std::vector<Table> similarity_;
  // Over all steps with a class: the minimum of the brightest channel, and the maximum of darkest ÷ brightest
  // channel (in 1/kWhole, rounded up).
  static constexpr int kWhole = 256;
  int least_brightest_ = 32, greatest_share_ = 0;
};

}  // namespace omnifleet::markers
