#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "lens/camera.h"

namespace omnifleet::localizer {

/// A robot as a ceiling camera's picture shows it.
struct ViewedRobot {
  std::string name;
  Pose2 map_from_base;
  std::optional<double> half_view_rad;  ///< of its forward camera
};

/// Draws into a BGR image of the camera: the rectangles of each robot's marker at their height, the heading
/// as a white line, the borders of the forward camera's view as a red and a yellow line, the name (Choi et
/// al. 2014 Fig. 19b, Ahmed et al. 2013 Figs. 2b and 3a).
void drawTracking(const lens::Camera& camera, const dataset::MarkerSet& markers,
                  const std::vector<ViewedRobot>& robots, cv::Mat& image);

/// Draws the map into a BGR image of the camera, cell by cell at its floor point: occupied cells white, free
/// floor tinted (Ahmed et al. 2013 Fig. 4). Pixels at and above the horizon stay as they are.
void drawMap(const lens::Camera& camera, const dataset::OccupancyGrid& grid, cv::Mat& image);

}  // namespace omnifleet::localizer
