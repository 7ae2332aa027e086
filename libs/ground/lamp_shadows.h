#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_light.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "ground/look.h"

namespace omnifleet::ground {

/// Where one lamp lights the floor, its shadows may be darker than any other, as dark as grey things are. But
/// how dark is known, as it is what light there is beside the lamp's; and where the lamp hangs, so that what
/// throws a shadow must stand between that and the lamp: over the floor towards the lamp's foot something is
/// met that is no shadow before the floor is in its light again.
class LampShadows {
 public:
  explicit LampShadows(const FloorView& view) : view_(&view) {}

  /// Of the regions' pixels of the floor's hue that are darker than other shade those get kLampShade that are
  /// as dark as the lamp's shadow is there, or nearly so and something stands between.
  /// @param looks of the pixels; changed
  void mark(FloorLight& light, const std::vector<Blob>& regions, cv::Mat1b& looks);

 private:
  float besideAt(const cv::Point& pixel) const;
  Look partingOfKinds(const Blob& region, const cv::Mat1b& looks);
  bool isThrown(const cv::Point& from, Look parting, const cv::Mat1b& looks) const;

  const FloorView* view_;
  cv::Mat1f beside_;   ///< share of the light that is not the lamp's, per cell; the light's own
  cv::Mat2f towards_;  ///< the lamp, likewise
  std::vector<cv::Point> shade_;
  std::array<int, 256> pixels_{};
};

}  // namespace omnifleet::ground
