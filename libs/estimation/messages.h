#pragma once

#include <string>

#include "estimation/wheel_trial.h"
#include "geometry/pose2.h"
#include "observation/error_code.h"

// What the estimator reports about a robot. Messages of a robot's status leave out its name.
namespace omnifleet::estimation {

Message notLocalizedYet();
Message localizationLost();
/// Without wheels a robot may have any heading after a while in which it observes nothing known.
Message headingLost();
/// @param often three times before: the calibration is suspected
Message relocalized(bool often);
Message wheelSlip();
/// kNone for wheels that agree with what is observed.
Message wheelAssignmentWrong(Wiring wiring);
Message initialPoseNotMapped();
/// Observations of several robots contradict each other. @param has_initial_pose the robot has one of its own
Message initialPoseDoubtful(bool has_initial_pose);
Message initialPoseUnconfirmed();

// Findings name the robot.
/// @param moved map correction of the initial pose @param known false: the other robot's may be wrong instead
Message initialPoseWrong(const std::string& robot, const Pose2& moved, const Pose2& initial_pose, bool known);
Message initialPoseContradicted(const std::string& robot);
/// @param why PlaceIndex::Refusal
Message placesIncomparable(const std::string& robot, const std::string& why);
/// @param error CameraFinding::describe()
Message calibrationError(const std::string& robot, const std::string& error);
/// @param quantities CameraFinding::name()
Message calibrationErrorWithdrawn(const std::string& robot, const std::string& quantities);

}  // namespace omnifleet::estimation
