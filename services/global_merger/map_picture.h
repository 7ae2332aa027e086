#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "observation/observation.h"

namespace omnifleet::global_merger {

/// Content of the picture.
struct MapPicture {
  const dataset::OccupancyGrid& grid;
  const std::vector<dataset::MapObject>& objects;
  const std::map<std::string, std::vector<dataset::StampedPose>>& trajectories;
  const std::map<std::string, RobotBody>& bodies;
  const std::vector<dataset::RejectedPlace>& rejected;
  const std::string& frame;  ///< of the map; empty: the common one
};

/// The merged map as a picture (BGR): cells, outlines with ids, walls and furniture as lines,
/// rejected candidates as hatched places with their reason in the legend, paths and current poses of the
/// robots, metre grid, scale bar, title and legend. About 1600 pixels on the longer side.
cv::Mat drawMap(const MapPicture& picture);

}  // namespace omnifleet::global_merger
