#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "local_mapper/local_mapper.h"
#include "plot.h"

namespace omnifleet::choi {

/// Local map of one robot from its first and last frame of §V.1, 5 cm apart.
struct LocalView {
  std::string robot;
  cv::Mat image;  ///< the last frame
  LocalMap map;
  std::vector<ground::Blob> labelled, connected;
  RobotBody body;
  Pose2 map_from_base;  ///< true pose at the last frame
};

/// Views of all robots of a recording. `overlays` override the default options.
std::vector<LocalView> localViews(const std::string& recording, const std::vector<std::string>& overlays);

/// Returns false for a region with too few feature points (Choi §III.5).
bool hasOutline(const ObjectObservation& object);

/// Figs. 4–6 show the square around the image circle, figs. 8 and 9 base_link in metres.
cv::Mat labelPicture(const LocalView& view);
cv::Mat connectedPicture(const LocalView& view);
cv::Mat vectorPicture(const LocalView& view);
cv::Mat correctedPicture(const LocalView& view);
cv::Mat hullPicture(const LocalView& view);

}  // namespace omnifleet::choi
