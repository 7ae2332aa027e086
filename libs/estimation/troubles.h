#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimation/association.h"
#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// A robot's part of a moment.
struct RobotFrame {
  const Objects* objects;
  RobotNode* robot;
  bool fresh;  ///< newer than the robot's last frame
  std::vector<Seen> seen;
  bool placed_anew = false;     ///< relocalized by its observations, after a kidnapping
  bool slipped = false;         ///< its wheels disagree with what is seen
  bool floor_rejected = false;  ///< everything else contradicts its motion by the floor
  SourceSet rejected = {};      ///< landmarks or robots whose views have been rejected
  bool unfamiliar = false;      ///< of what it sees little is known, and what is known is not seen
  bool settled = false;         ///< it is where its motion has put it, or has been put elsewhere
  bool after_gap = false;       ///< no frame came for much longer than usual: a kidnapping is possible
  /// The pose by the last one and its motion alone; none on a robot's first frame.
  std::optional<Pose2> predicted = std::nullopt;
  Eigen::Matrix3d predicted_covariance = Eigen::Matrix3d::Identity();  ///< of it in map, right perturbation

  bool isPlaced() const { return fresh && robot->located(); }
  /// It was watched all the way here, and sees now.
  bool follows() const { return sees() && !after_gap; }
  bool sees() const { return objects->state == FrameState::kOk; }
};

/// What a frame shows of how the robot's wheels are to be read, while they tell all of the way from the one
/// before (`before_ns`); they count for nothing once that is otherwise than they are told.
void tryWheels(FleetState& fleet, RobotFrame& frame, TimeNs before_ns);

/// What is seen has rejected the wheels: they slip, or somebody carries the robot. Decides by the motion that
/// the pose shows after the scan is matched.
void noteRejectedWheels(const FleetState& fleet, RobotFrame& frame);

/// No frame has come for a second at least, and for several times as long as between the frames before.
bool isAfterGap(const RobotNode& robot, TimeNs time_ns);

/// Places anew, by what it sees, every robot that is not where its motion has put it.
/// First by what stands still: where all robots slip at once, none tells where another is.
void noticeJumps(FleetState& fleet, std::vector<RobotFrame>& frames);

/// Whether a robot is nowhere that it knows. What it sees is nothing then: it neither moves the map nor is it
/// put there.
void noticeLoss(FleetState& fleet, RobotFrame& frame);

/// What a robot or others see after it has seen nothing tells that it was carried away meanwhile.
void noticeCarried(FleetState& fleet, std::vector<RobotFrame>& frames);

/// Who sees two things that stand, or robots whose motion is known (one tells no heading, but that sees it
/// too): robots that see each other alone drift together.
void noteObserved(std::vector<RobotFrame>& frames);

/// How far a frame's outlines of known things that stand lie beside where they should be: median of their
/// rms, metres, 0 without any. (Robots may themselves be elsewhere.)
double misfit(const FleetState& fleet, const std::vector<ViewLink>& views);

/// How far a step may be wrong whose wheels slipped.
Eigen::Matrix3d slipCovariance();

/// The verdict on a robot's newest frame, for its status.
void noteState(const FleetState& fleet, const RobotFrame& frame);

/// The wheels have rolled what the robot has not gone.
void reportSlip(RobotFrame& frame);

/// Everything else contradicts the motion of the newest step: its wheels slip, or the texture of the floor is
/// wrong.
void rejectStep(RobotFrame& frame);

}  // namespace omnifleet::estimation
