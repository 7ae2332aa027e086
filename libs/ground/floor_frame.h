#pragma once

#include <algorithm>
#include <opencv2/core.hpp>

#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Inputs for brightness measurements at the outline of a grey region.
struct FloorFrame {
  const cv::Mat& image;    ///< BGR8
  const cv::Mat3f& floor;  ///< floor colour per cell
  float hue_tolerance;     ///< hue tolerance as a share of the floor's brightness
  float noise;             ///< grey levels, noise tolerance of a single pixel in addition
  cv::Point2f foot_px;     ///< the camera's foot; verticals lead away from it
  const cv::Mat1b& view;   ///< not 0 where floor may be visible
};

inline const cv::Vec3f& floorAt(const FloorFrame& frame, int x, int y) {
  return frame.floor(std::min(y / FloorView::kCell, frame.floor.rows - 1),
                     std::min(x / FloorView::kCell, frame.floor.cols - 1));
}

/// Brightness of a pixel as a share of the floor's brightness there. Pixels outside the image take the value
/// at its edge.
inline float gainAt(const FloorFrame& frame, int x, int y) {
  x = std::clamp(x, 0, frame.image.cols - 1);
  y = std::clamp(y, 0, frame.image.rows - 1);
  const auto& p = frame.image.at<cv::Vec3b>(y, x);
  const cv::Vec3f& r = floorAt(frame, x, y);
  const float rr = std::max(1.0f, r.dot(r));
  return (static_cast<float>(p[0]) * r[0] + static_cast<float>(p[1]) * r[1] +
          static_cast<float>(p[2]) * r[2]) /
         rr;
}

/// Mean of gainAt() over three pixels across the direction of a step.
inline float meanGain(const FloorFrame& frame, int x, int y, int across_x, int across_y) {
  return (gainAt(frame, x, y) + gainAt(frame, x + across_x, y + across_y) +
          gainAt(frame, x - across_x, y - across_y)) /
         3.0f;
}

}  // namespace omnifleet::ground
