#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimation/keyframe_map.h"
#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// The published poses of one robot's frames that have left the window, each relative to a keyframe. When
/// keyframes move, because a loop was closed or two maps were joined, the frames move with them.
class PathMemory {
 public:
  using Id = KeyframeMap::Id;

  /// A frame that has left the window. @param published its pose as last published
  void add(const PoseEstimate& published);
  /// Likewise, relative to a keyframe. @param map_from_keyframe its pose now
  void add(const PoseEstimate& published, Id keyframe, const Pose2& map_from_keyframe);

  /// Appends poses of frames whose keyframes have moved since these poses were published: by more than the
  /// bounds at a frame (m, rad).
  void follow(const KeyframeMap& map, double moved_m, double moved_rad, std::vector<PoseEstimate>& revised);

  /// Takes over the frames of another memory whose keyframes now begin at `first`, and appends all their
  /// poses in this map. Frames without a keyframe are moved by map_from_other.
  void append(const PathMemory& other, Id first, const Pose2& map_from_other, const KeyframeMap& map,
              std::vector<PoseEstimate>& revised);

  /// All frames as published.
  std::vector<PoseEstimate> poses() const;
  std::size_t size() const { return size_; }

 private:
  struct Frame {
    PoseEstimate published;
    Pose2 keyframe_from_base;
  };
  struct Group {
    Pose2 map_from_keyframe;  ///< for which all published poses hold to the bounds
    std::vector<Frame> frames;
  };

  std::vector<Group> groups_;  ///< by keyframe
  std::vector<PoseEstimate> free_;
  std::size_t size_ = 0;
};

}  // namespace omnifleet::estimation
