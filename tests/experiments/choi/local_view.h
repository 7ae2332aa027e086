#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "local_mapper/local_mapper.h"
#include "plot.h"

namespace omnifleet::choi {

/// What one robot makes of its first and last frame of §V.1, 5 cm apart.
struct LocalView {
  std::string robot;
  cv::Mat image;  ///< the last frame
  LocalMap map;
  std::vector<ground::Blob> labelled, connected;
  RobotBody body;
  Pose2 map_from_base;  ///< true pose at the last frame
};

/// All robots of a recording, with the options of the data set and `overlays` on top.
std::vector<LocalView> localViews(const std::string& recording, const std::vector<std::string>& overlays);

/// False for a region of too few feature points (Choi §III.5).
bool hasOutline(const ObjectObservation& object);

/// Figs. 4–6, 8, 9: the square around the image circle, or base_link in metres.
cv::Mat labelPicture(const LocalView& view);
cv::Mat connectedPicture(const LocalView& view);
cv::Mat vectorPicture(const LocalView& view);
cv::Mat correctedPicture(const LocalView& view);
cv::Mat hullPicture(const LocalView& view);

}  // namespace omnifleet::choi
