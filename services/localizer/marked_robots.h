#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::localizer {

struct MarkedOptions {
  double distance_m = 0.005;   ///< m, motion after which the pose of a marked robot enters the map again
  double rotation_rad = 0.01;  ///< rad, rotation after which it does
  double interval_s = 1.0;     ///< s, time after which it does while the robot stands

  static MarkedOptions read(const options::Section& section);
};

/// Robots without sensors that only ceiling cameras locate, by their markers. Each has one frame per time at
/// which a camera detects it. Other robots' maps leave out their bodies, so their poses enter the map as
/// keyframe poses.
class MarkedRobots {
 public:
  MarkedRobots(std::set<std::string> robots, const MarkedOptions& options)
      : robots_(std::move(robots)), options_(options) {}

  const std::set<std::string>& names() const { return robots_; }
  /// One frame per marked robot that has an absolute pose among the measurements of this time, by name. Valid
  /// until the next call.
  const std::vector<Objects>& framesAt(TimeNs time, const std::vector<const Measurement*>& measurements);
  /// Whether the map needs this pose of a marked robot; then the pose counts as published.
  bool isDue(const PoseEstimate& pose);

 private:
  std::set<std::string> robots_;
  MarkedOptions options_;
  std::vector<Objects> frames_;
  std::map<std::string, std::uint32_t> sequences_;  ///< of the next frame
  std::map<std::string, PoseEstimate> published_;   ///< latest pose in the map
};

}  // namespace omnifleet::localizer
