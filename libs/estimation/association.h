#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "estimation/fleet_state.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// One silhouette of a frame, and what it is taken for.
struct Seen {
  const Track* track = nullptr;
  std::shared_ptr<View> view;
  RobotNode* peer = nullptr;  ///< a robot, or
  PoseAt peer_at;
  std::uint32_t landmark = 0;  ///< an obstacle, or neither
  bool mature = false;         ///< clean enough to be a landmark's, to found or to deny one
  /// May be a landmark's, but denies nothing: as mature; or a part of it, cut off by the edge of the view; or
  /// ragged, where nothing better is in sight of a robot that needs it.
  bool informative = false;
};

/// The visible tracks of a frame that have supports, as views, what is known of the camera's error taken off.
std::vector<Seen> silhouettes(const FleetState& fleet, const Objects& frame);

/// Rigid motion that takes points `from` to `to` (least squares); with one pair the heading stays.
Pose2 rigidMotion(const std::vector<Eigen::Vector2d>& from, const std::vector<Eigen::Vector2d>& to,
                  double heading_rad);

/// Corrects a prediction that is too uncertain to associate by (no wheels, a gap): the tracks' own ids say
/// which silhouettes were which landmarks and robots before; a rigid fit of those places the robot.
void alignByTracks(FleetState& fleet, RobotNode& observer, const Objects& frame,
                   const std::vector<Seen>& seen);

/// Tells which silhouettes are which robots: the known body is fitted to each; the nearest predicted peer
/// within the gate whose fit leaves less than sighting_rms_m takes it, each robot at most once.
void matchPeers(FleetState& fleet, RobotNode& observer, const Objects& frame, std::vector<Seen>& seen);

/// Tells which of the rest are which landmarks: Steiner centres of the single view and of the landmark, both
/// affine in the object's height, brought together by the height that the priors allow (two views from
/// opposite sides disagree by decimetres at a wrong height), and alike in size.
void matchLandmarks(FleetState& fleet, RobotNode& observer, std::vector<Seen>& seen);

/// Founds landmarks from silhouettes that are far from everything known (docs/methods/localizer.md).
void foundLandmarks(FleetState& fleet, RobotNode& observer, std::vector<Seen>& seen);

/// True where a robot cannot be where it is predicted: it sees at least two whole objects, none of them
/// known nor in a known one's place, while at least two landmarks that it saw within the last 3 s in which it
/// saw should stand around it.
bool isDisplaced(const FleetState& fleet, const RobotNode& robot, const std::vector<Seen>& seen);

/// Adds the graph's factors of all associated views.
void addViews(FleetState& fleet, RobotNode& observer, const std::vector<Seen>& seen);

/// How well one prism explains what a robot has seen of each landmark, by the views in its window.
void noteFits(FleetState& fleet, const RobotNode& robot);

}  // namespace omnifleet::estimation
