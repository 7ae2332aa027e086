#include "fleet/sources.h"

namespace omnifleet::fleet {

void addArena(Fleet& fleet) {
  const synthetic::Arena& arena = *fleet.arena;
  for (const synthetic::ArenaRobot& simulated : arena.robots) {
    RobotSpec robot;
    robot.name = simulated.name;
    if (simulated.initial_pose_known) robot.initial_pose = simulated.initial_map_from_base;
    robot.body = simulated.body;
    robot.has_wheels = simulated.has("wheels");
    if (arena.laser && simulated.has("laser")) robot.laser = arena.laser->sensor;
    fleet.robots.push_back(robot);
  }
  for (const synthetic::ArenaCamera& simulated : arena.cameras) {
    CameraSpec camera;
    camera.id = simulated.id;
    camera.robot = simulated.robot;
    camera.role = simulated.robot.empty()                                      ? CameraRole::kCeiling
                  : simulated.id.substr(simulated.id.find('/') + 1) == "front" ? CameraRole::kFront
                                                                               : CameraRole::kFisheye;
    camera.source = CameraSource::kArena;
    camera.rate_hz = arena.rate_hz;
    camera.model = simulated.model;
    fleet.cameras.push_back(camera);
  }
  fleet.markers = arena.markers;
}

}  // namespace omnifleet::fleet
