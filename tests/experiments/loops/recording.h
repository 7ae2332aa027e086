#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/trajectory_files.h"
#include "geometry/pose2.h"
#include "observation/appearance.h"
#include "scan/line_scan.h"

namespace omnifleet::loops {

/// What the pipeline knows of one frame as a place: the lines of its floor boundary and its signature.
struct Shot {
  scan::LineScan scan;
  Pose2 base_from_scan;
  Appearance appearance;
};

/// One frame of a recording: robot (in the order of the dataset) and row of its fisheye stream.
using FrameId = std::pair<std::size_t, std::size_t>;

/// A recording of rooms with its truth. In a recording of look-alike rooms each robot has its own room.
class Recording {
 public:
  /// Throws options::Error or std::runtime_error if the recording or its truth cannot be read.
  explicit Recording(const std::string& folder);

  /// Kind of the pair in groundtruth/pair.json (same, lookalike, disjoint); "loop" without that file.
  const std::string& kind() const { return kind_; }
  const std::string& name() const { return name_; }
  std::size_t robots() const { return truth_.size(); }
  /// Truth of the frames of a robot that have an image, by row: the pose in the frame of its room.
  const std::map<std::size_t, dataset::StampedPose>& truth(std::size_t robot) const { return truth_[robot]; }

  /// Frames of the same robot around one, spaced by at least `spacing_m`, up to `reach_m` away along its
  /// path.
  std::vector<FrameId> around(const FrameId& frame, double spacing_m, double reach_m) const;

  /// Processes single frames by the local mapper and the appearance source, in order of time. Frames without
  /// enough lines are not in the result.
  std::map<FrameId, Shot> shots(const std::vector<FrameId>& frames) const;

 private:
  std::string name_, kind_;
  dataset::Dataset data_;
  std::vector<std::map<std::size_t, dataset::StampedPose>> truth_;
};

}  // namespace omnifleet::loops
