#include "localizer/fleet_setup.h"

#include <algorithm>
#include <utility>

namespace omnifleet::services {

std::vector<estimation::RobotSetup> setups(const fleet::Fleet& fleet,
                                           const estimation::EstimatorOptions& options) {
  std::vector<estimation::RobotSetup> all;
  std::map<std::string, lens::Spread> lenses = fleet.lensSpreads();
  bool tied = !fleet.ceilingCameras().empty() || !fleet.landmarks.empty();
  for (const fleet::RobotSpec& robot : fleet.robots) {
    all.push_back({robot.name, robot.body, robot.initial_pose, false, lenses[robot.name]});
    const fleet::CameraSpec* camera = fleet.mapCameraOf(robot.name);
    const bool is_front = camera != nullptr && camera->role == fleet::CameraRole::kFront;
    all.back().match_scans = !is_front || options.scan.front;
    tied = tied || robot.initial_pose;
  }
  // Nothing defines `map`, so it is the first base_link of the first robot.
  const std::vector<std::string> located = fleet.locatedRobots();
  for (auto& setup : all) {
    if (!tied && !located.empty() && setup.name == located.front()) {
      setup.initial_pose = Pose2{};
      setup.founds_map = true;
    }
  }
  return all;
}

std::map<std::string, Pose2> ownFrames(const fleet::Fleet& fleet,
                                       const estimation::EstimatorOptions& options) {
  std::map<std::string, Pose2> first;
  if (!fleet.ceilingCameras().empty() || !fleet.landmarks.empty() || !options.alignment.use ||
      !options.scan.use)
    return first;
  const std::vector<std::string> mapping = fleet.mappingRobots();
  for (const estimation::RobotSetup& setup : setups(fleet, options)) {
    const bool maps = std::find(mapping.begin(), mapping.end(), setup.name) != mapping.end();
    if (maps && setup.match_scans && !setup.initial_pose) first[setup.name] = Pose2{};
  }
  return first;
}

std::vector<Measurement> surveyed(const fleet::Fleet& fleet) {
  std::vector<Measurement> all;
  for (const dataset::Landmark& landmark : fleet.landmarks) {
    Measurement m;
    m.source = "landmarks";
    m.kind = MeasurementKind::kPosition;
    m.to = landmark.name;
    m.value << landmark.position_m, 0.0;
    m.covariance = landmark.sigma_m * landmark.sigma_m * Eigen::Matrix3d::Identity();
    all.push_back(std::move(m));
  }
  return all;
}

}  // namespace omnifleet::services
