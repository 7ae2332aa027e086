#include <fmt/format.h>

#include "dataset/dataset.h"
#include "fleet/sources.h"

namespace omnifleet::fleet {

void requireAboveFloor(const CameraSpec& camera, const std::string& sensor_file) {
  const double height_m = camera.model.position_m.z();
  if (camera.role != CameraRole::kFisheye || height_m > 0.0) return;
  throw options::Error(
      fmt::format("{}: position_m: the third number is the height of the camera over the floor "
                  "in metres; it is {}, but must be greater than 0",
                  sensor_file, height_m));
}

void addDataset(Fleet& fleet) {
  const dataset::Dataset recording = dataset::Dataset::open(fleet.dataset);
  const auto addCamera = [&](const dataset::ImageStream& stream, const std::string& robot, CameraRole role) {
    CameraSpec camera;
    camera.id = stream.name;
    camera.robot = robot;
    camera.role = role;
    camera.source = CameraSource::kDataset;
    camera.model = stream.camera;
    requireAboveFloor(camera, fleet.dataset + "/" + stream.name + "/sensor.yaml");
    fleet.cameras.push_back(camera);
  };
  for (const dataset::RobotRecording& recorded : recording.robots) {
    RobotSpec robot;
    robot.name = recorded.name;
    robot.initial_pose = recorded.initial_pose;
    robot.body = recorded.body;
    robot.has_wheels = !recorded.wheels.empty();
    robot.has_observations = !recorded.observations.empty();
    if (!recorded.laser.empty()) robot.laser = recorded.laser_sensor;
    fleet.robots.push_back(robot);
    if (recorded.fisheye) addCamera(*recorded.fisheye, robot.name, CameraRole::kFisheye);
    if (recorded.front) addCamera(*recorded.front, robot.name, CameraRole::kFront);
  }
  for (const dataset::ImageStream& stream : recording.ceiling) addCamera(stream, "", CameraRole::kCeiling);
  fleet.markers = recording.markers;
  fleet.landmarks = recording.landmarks;
}

}  // namespace omnifleet::fleet
