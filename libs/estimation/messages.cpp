#include "estimation/messages.h"

#include <cmath>
#include <cstdio>

#include "geometry/pose2.h"

namespace omnifleet::estimation {

Message notLocalizedYet() {
  return {
      ErrorCode::kNotLocalized,
      "not localized yet; its observations are not mapped. It needs an initial_pose, a ceiling camera or a "
      "localized robot that observes it"};
}

Message localizationLost() {
  return {
      ErrorCode::kLocalizationLost,
      "localization lost, its observations do not match the map; its map updates are paused. If the robot "
      "was lifted, let it drive on; else check its sensor.yaml and wheels"};
}

Message headingLost() {
  return {ErrorCode::kLocalizationLost,
          "localization lost, no wheel motion and heading sigma above 0.5 rad; its map updates are paused. "
          "Check that wheel samples arrive and use the clock of the frames; without wheels, check the "
          "ceiling cameras"};
}

Message relocalized(bool often) {
  if (often)
    return {
        ErrorCode::kKidnapped,
        "relocalized for the fourth time or more, its map is unreliable; its sensor.yaml probably belongs to "
        "another camera"};
  return {
      ErrorCode::kKidnapped,
      "kidnapped (moved without its wheels), relocalized by its observations; mapping continues. No action "
      "if somebody moved it, else check its wheels"};
}

Message wheelSlip() {
  return {
      ErrorCode::kWheelSlip,
      "wheel slip, odometry contradicts the observations; odometry is ignored for this step. If it repeats, "
      "check unit, scale and clock of the wheels"};
}

Message wheelAssignmentWrong(Wiring wiring) {
  constexpr const char* kUntil = "; its odometry is ignored for the rest of the run";
  const auto message = [&](const std::string& text) {
    return Message{ErrorCode::kWheelAssignment, text + kUntil};
  };
  switch (wiring) {
    case Wiring::kAsConfigured:
      return {};
    case Wiring::kReversed:
      return message("both wheels run backwards; change the signs of left and right");
    case Wiring::kSwapped:
      return message("the wheels are swapped; exchange left and right");
    case Wiring::kBoth:
      return message(
          "the wheels are swapped and run backwards; exchange left and right and change their signs, or "
          "check whether the camera is turned by 180°");
    case Wiring::kLeftReversed:
      return message("the left wheel runs backwards; change its sign");
    case Wiring::kRightReversed:
      return message("the right wheel runs backwards; change its sign");
  }
  return {};
}

Message initialPoseNotMapped() {
  return {ErrorCode::kInitialPoseRejected,
          "its observations contradict its initial_pose; they are not mapped. Correct initial_pose"};
}

Message initialPoseDoubtful(bool has_initial_pose) {
  return {ErrorCode::kInitialPoseRejected,
          std::string("its observations and those of other robots contradict each other") +
              (has_initial_pose ? "; check its initial_pose" : "; check the initial_pose of the others")};
}

Message initialPoseUnconfirmed() {
  return {ErrorCode::kInitialPoseUnconfirmed,
          "its initial_pose is not confirmed, too few obstacles are seen by it and by other robots; an error "
          "would "
          "double obstacles in the map. Measure initial_pose or let the robots meet"};
}

Message initialPoseWrong(const std::string& robot, const Pose2& moved, const Pose2& initial_pose,
                         bool known) {
  const Pose2 found = moved * initial_pose, by = initial_pose.inverse() * found;
  char line[240];
  std::snprintf(line, sizeof line,
                "%s: initial_pose is wrong by %.2f m and %.1f degrees; the robot began at [%.3f, %.3f, "
                "%.3f]%s. The map is corrected; correct the fleet file",
                robot.c_str(), by.translation().norm(), std::abs(wrapAngle(by.theta_rad)) * 180.0 / M_PI,
                found.x_m, found.y_m, wrapAngle(found.theta_rad),
                known ? "" : ", or the other robot's initial_pose is wrong");
  return {ErrorCode::kInitialPoseRejected, line};
}

Message initialPoseContradicted(const std::string& robot) {
  return {ErrorCode::kInitialPoseRejected,
          robot +
              ": what it observes and what observes it contradict its initial_pose; its observations are "
              "not mapped. Correct initial_pose"};
}

Message placesIncomparable(const std::string& robot, const std::string& why) {
  return {ErrorCode::kPlacesIncomparable,
          robot + ": its places are not compared with those of the robots before it: " + why +
              ". Use the same lens projection, image size and options for all robots"};
}

Message calibrationError(const std::string& robot, const std::string& error) {
  return {ErrorCode::kCalibrationError,
          robot + ": calibration error of its camera (sensor.yaml minus estimate): " + error +
              "; it is compensated. Recalibrate or correct sensor.yaml"};
}

Message calibrationErrorWithdrawn(const std::string& robot, const std::string& quantities) {
  return {ErrorCode::kCalibrationError, robot + ": calibration of its camera: the reported error of " +
                                            quantities +
                                            " is withdrawn, later observations do not confirm it"};
}

}  // namespace omnifleet::estimation
