#include "tests/benchmark/stage_inputs.h"

#include "classifier/classifier.h"
#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::bench {

StageInputs::StageInputs(const Recording& recording, int steps)
    : local_maps(static_cast<std::size_t>(steps)), objects(local_maps.size()) {
  std::map<std::string, RobotBody> bodies;
  for (const synthetic::ArenaRobot& robot : recording.arena().robots) bodies[robot.name] = robot.body;
  for (std::size_t r = 0; r < recording.robots().size(); ++r) {
    const std::string& name = recording.robots()[r];
    const lens::Camera camera(recording.arena().camera(name + "/fisheye").model);
    local_mapper::LocalMapper mapper(camera, {});
    motion::WheelIntegrator wheels(bodies.at(name).wheel_separation_m, {});
    classifier::Classifier classifier({}, name, bodies);
    std::vector<PoseEstimate> poses;
    for (int step = 0; step < steps; ++step) {
      const TimeNs now = recording.time(step);
      LocalMap local_map =
          mapper.process({now, static_cast<std::uint32_t>(step), FrameState::kOk, recording.image(r, step)},
                         wheels.motionTo(now));
      local_map.robot = name;
      const dataset::WheelRow row = recording.wheels(r, step);
      wheels.add(row.time_ns, row.left_mps, row.right_mps);
      local_maps[static_cast<std::size_t>(step)].push_back(local_map);
      objects[static_cast<std::size_t>(step)].push_back(classifier.process(local_map, poses));
      poses = recording.poses(step);
    }
  }
}

}  // namespace omnifleet::bench
