#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "ground/floor_frame.h"
#include "ground/hue_window.h"
#include "ground/look.h"

namespace omnifleet::ground {

/// What is asked of the mean colour around a pixel: whether it has another hue than the floor, or one nearer
/// to the region's core's, where the noise would hide that in the single pixel.
struct HueTest {
  static constexpr float kLeastLit =
      0.3f;  ///< of the floor's brightness: in less light faint hues are but noise
  static constexpr int kLeastAround = 8;  ///< pixels of a HueWindow: fewer are what is mixed along an outline

  cv::Vec3f floor, to_core;
  float rr, noise, tolerance;

  /// @param core_hue what the region's core, made as bright as the floor, differs from it by, as a share of
  /// that
  HueTest(const FloorFrame& frame, const cv::Vec3f& core_hue, int x, int y) : floor(floorAt(frame, x, y)) {
    rr = std::max(1.0f, floor.dot(floor));
    noise = frame.noise / std::sqrt(rr);
    tolerance = frame.hue_tolerance;
    const float core2 = core_hue.dot(core_hue), told = 2.0f * (tolerance + noise);
    if (core2 > 0.0f && core2 < told * told)
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
