#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "distance_vector/options.h"
#include "distance_vector/smoothed_image.h"

namespace omnifleet::distance_vector {

/// Colour of the floor at the bottom of one image.
struct FloorSample {
  cv::Vec3f direction{0, 0, 0};  ///< unit vector in BGR: the floor's hue
  float level = 0.0f;            ///< length of its mean colour, grey levels (√3 × grey)
  float across = 0.0f;           ///< σ across the direction, grey levels, of smoothed pixels
  float along = 0.0f;            ///< likewise along it: texture and noise
  int column = 0;                ///< in whose surroundings most of these pixels lie
  bool remembered = false;       ///< agrees with the floor of the frames before

  /// Distance of a colour from the floor's direction, grey levels.
  float distance(const cv::Vec3f& colour) const {
    return static_cast<float>(cv::norm(colour - direction * colour.dot(direction)));
  }
};

/// Candidates for the floor's colour: the middle bottom of the image (Ahmed et al. 2013, §2.1) shows the
/// floor unless something stands there. So the floor that was seen before comes first, then the most frequent
/// colours of the bottom strip; its middle half counts three times.
class FloorColour {
 public:
  explicit FloorColour(const WalkOptions& options) : options_(options) {}

  /// The candidates of this image, the most probable first; at most three. Valid until the next call.
  const std::vector<FloorSample>& find(const SmoothedImage& image);
  /// The sample led to a plausible boundary: it is the floor from now on.
  void remember(const FloorSample& sample);
  bool hasMemory() const { return memory_.has_value(); }
  /// Direction of the remembered floor; call only with a memory.
  const cv::Vec3f& knownDirection() const { return memory_->direction; }
  /// Share of the strip that agrees with the remembered floor, 0–1.
  double rememberedShare() const { return remembered_share_; }

 private:
  struct Pixel {
    cv::Vec3f colour;
    float level;
    int u, v;
    float weight;
  };
  void readStrip(const SmoothedImage& image);
  bool agrees(const FloorSample& sample, const Pixel& pixel) const;
  std::optional<FloorSample> mode();
  std::optional<FloorSample> refined(FloorSample sample);
  float limit(const FloorSample& sample) const;

  WalkOptions options_;
  std::optional<FloorSample> memory_;
  double remembered_share_ = 0.0;
  std::vector<Pixel> strip_;
  std::vector<char> taken_;  ///< pixels that agree with a candidate found before
  std::vector<float> histogram_, levels_, differences_;
  std::vector<FloorSample> found_;
};

}  // namespace omnifleet::distance_vector
