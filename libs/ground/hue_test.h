#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "ground/appearance_class.h"
#include "ground/floor_frame.h"
#include "ground/hue_window.h"

namespace omnifleet::ground {

/// Tests the mean colour around a pixel where noise hides the hue of the single pixel. It tests whether the
/// mean has another hue than the floor, or is nearer to the hue of the region's core than to the floor's.
struct HueTest {
  static constexpr float kLeastLit =
      0.3f;  ///< share of the floor's brightness; below it, faint hues are only noise
  static constexpr int kLeastAround = 8;  ///< pixels of a HueWindow; fewer may be mixed pixels of an outline

  cv::Vec3f floor, to_core;
  float rr, noise, tolerance;

  /// @param core_hue difference between the colour of the region's core, scaled to the floor's brightness,
  /// and the floor's colour; as a share of the floor's brightness
  HueTest(const FloorFrame& frame, const cv::Vec3f& core_hue, int x, int y) : floor(floorAt(frame, x, y)) {
    rr = std::max(1.0f, floor.dot(floor));
    noise = frame.noise / std::sqrt(rr);
    tolerance = frame.hue_tolerance;
    const float core2 = core_hue.dot(core_hue), max_core = 2.0f * (tolerance + noise);
    if (core2 > 0.0f && core2 < max_core * max_core)
      to_core = std::min(2.0f, std::sqrt(core2) / tolerance) / (core2 * std::sqrt(rr)) * core_hue;
  }
  bool isFaint() const { return to_core != cv::Vec3f(); }
  bool isNeeded() const { return noise >= tolerance || isFaint(); }
  bool operator()(HueWindow::Sum around) const {
    const int count = HueWindow::count(around);
    if (count < kLeastAround) return false;
    const cv::Vec3f mean = HueWindow::mean(around);
    const float gain = mean.dot(floor) / rr;
    if (mean.dot(to_core) > std::max(gain, kLeastLit)) return true;
    const float limit = tolerance + noise * std::sqrt(1.0f / static_cast<float>(count));
    return noise >= tolerance && mean.dot(mean) / rr - gain * gain > kOtherHue * limit * limit;
  }
};

}  // namespace omnifleet::ground
