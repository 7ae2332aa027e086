#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/appearance_class.h"
#include "ground/floor_light.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Shadows of a single lamp that lights the floor. Such a shadow may be as dark as a grey object. Its
/// darkness is known, because only the light that is not the lamp's remains. The position of the lamp is also
/// known, so the occluder must stand between the shadow and the lamp: on the way over the floor towards the
/// lamp's foot an object is met before lit floor.
class LampShadows {
 public:
  explicit LampShadows(const FloorView& view) : view_(&view) {}

  /// Marks pixels of the regions as kLampShadow. They have the floor's hue and are darker than other shadows.
  /// They are as dark as the lamp's shadow is there, or nearly so and an occluder stands in between.
  /// @param appearances of the pixels; changed
  void mark(FloorLight& light, const std::vector<Blob>& regions, cv::Mat1b& appearances);

 private:
  float besideAt(const cv::Point& pixel) const;
  Appearance thresholdBetweenKinds(const Blob& region, const cv::Mat1b& appearances);
  bool isCast(const cv::Point& from, Appearance threshold, const cv::Mat1b& appearances) const;

  const FloorView* view_;
  cv::Mat1f beside_;   ///< per cell: share of the light that is not the lamp's; buffer of FloorLight
  cv::Mat2f towards_;  ///< per cell: direction of the lamp; buffer of FloorLight
  std::vector<cv::Point> shadow_;
  std::array<int, 256> pixels_{};
};

}  // namespace omnifleet::ground
