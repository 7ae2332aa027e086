#include "tests/experiments/exploration/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "adapters/adapters.h"
#include "bus/topics.h"
#include "dataset/atomic_file.h"
#include "dataset/ground_truth.h"
#include "fleet_in_process/in_process.h"
#include "formation/formation.h"
#include "motion/motion_guard.h"

namespace omnifleet::exploration {
namespace {

constexpr double kSame_m = 0.04;  // one cell of the exploration grid

/// What the robots publish: their states, their poses, and the grid that follows from both.
class States {
 public:
  States(const std::shared_ptr<bus::FakeNetwork>& network, const motion::ExplorationGrid::Options& grid,
         const std::map<std::string, RobotBody>& bodies)
      : shared(grid, bodies),
        bus_(bus::makeFakeBus(network, {})),
        reader_(bus_->reader(bus::Topics(bus::RunMode::kLockstep).formation_state)),
        poses_(bus_->reader(bus::Topics(bus::RunMode::kLockstep).pose)) {}

  void take() {
    v1::Pose pose_wire;
    std::vector<PoseEstimate> poses;
    while (poses_->take(pose_wire))
      if (!adapters::fromWire(pose_wire, poses.emplace_back())) poses.pop_back();
    std::vector<motion::FormationState> states;
    v1::FormationState wire;
    while (reader_->take(wire)) {
      motion::FormationState state;
      if (!adapters::fromWire(wire, state)) throw std::runtime_error("formation/state: a sample is invalid");
      states.push_back(state);
      const motion::FormationState& now = latest[state.robot] = state;
      for (const auto& [robot, other] : latest) {
        if (robot == now.robot || other.acquired_ns != now.acquired_ns) continue;
        shared_frames += now.has_goal && other.has_goal && (now.goal_m - other.goal_m).norm() < kSame_m;
      }
    }
    shared.learn(poses, states);
  }

  std::map<std::string, motion::FormationState> latest;
  formation::SharedGrid shared;
  int shared_frames = 0;

 private:
  std::unique_ptr<bus::Bus> bus_;
  std::unique_ptr<bus::Reader<v1::FormationState>> reader_;
  std::unique_ptr<bus::Reader<v1::Pose>> poses_;
};

using Paths = std::map<std::string, std::vector<dataset::StampedPose>>;

TrueRoom roomOf(const dataset::GroundTruth& truth, const fleet::Fleet& fleet) {
  TrueRoom room;
  room.room_m = truth.room;
  for (const dataset::MapObject& object : truth.scene)
    if (object.kind == "obstacle") room.solids_m.push_back(object.outline_m);
  for (const auto& [robot, path] : truth.trajectories) {
    if (fleet.maps(robot))
      room.starts.push_back(path.front().map_from_base);
    else
      room.solids_m.push_back(motion::placed(path.front().map_from_base, fleet.robot(robot).body.outline()));
  }
  return room;
}

void followPaths(const Paths& paths, const fleet::Fleet& fleet, const TrueRoom& room, Outcome& outcome) {
  outcome.gap_m = INFINITY;
  const auto outlineAt = [&](const std::string& robot, std::size_t frame) {
    return motion::placed(paths.at(robot)[frame].map_from_base, fleet.robot(robot).body.outline());
  };
  for (const auto& [robot, path] : paths) {
    if (!fleet.maps(robot)) continue;
    for (std::size_t f = 0; f < path.size(); ++f) {
      const Polygon outline = outlineAt(robot, f);
      if (f > 0)
        outcome.driven_m +=
            (path[f].map_from_base.translation() - path[f - 1].map_from_base.translation()).norm();
      for (const Polygon& solid : room.solids_m)
        outcome.gap_m = std::min(outcome.gap_m, motion::distanceBetween(outline, solid));
      for (const auto& [other, its] : paths)
        if (other < robot && fleet.maps(other) && f < its.size())
          outcome.gap_m = std::min(outcome.gap_m, motion::distanceBetween(outline, outlineAt(other, f)));
      for (const Eigen::Vector2d& vertex : outline)
        for (std::size_t k = 0; k < room.room_m.size(); ++k) {
          const Eigen::Vector2d a = room.room_m[k], way = room.room_m[(k + 1) % room.room_m.size()] - a;
          const double to_m = (way.x() * (vertex - a).y() - way.y() * (vertex - a).x()) / way.norm();
          outcome.gap_m = std::min(outcome.gap_m, std::max(0.0, to_m));
        }
    }
  }
}

}  // namespace

namespace {

/// The exploration grid in the form of a map.
dataset::OccupancyGrid mapOf(const motion::ExplorationGrid& grid) {
  dataset::OccupancyGrid map;
  map.width = grid.size().width;
  map.height = grid.size().height;
  map.resolution_m = grid.cell_m();
  map.origin_m = grid.centreOf({0, 0}) - 0.5 * grid.cell_m() * Eigen::Vector2d::Ones();
  for (const std::uint8_t cell : grid.cells())
    map.cells.push_back(cell == static_cast<std::uint8_t>(motion::Cell::kUnknown) ? -1
                        : cell == static_cast<std::uint8_t>(motion::Cell::kFree)  ? 0
                                                                                  : 100);
  return map;
}

}  // namespace

Outcome explore(std::uint32_t seed, const std::string& fleet_file, const std::string& out) {
  Outcome outcome;
  outcome.seed = seed;
  services::InProcessRun run;
  run.fleet_file = fleet_file;
  run.out = out;
  run.log_level = "off";
  run.network = bus::makeFakeNetwork();
  std::string log;
  run.on_message = [&](const std::string& service, const Message& message) {
    outcome.collisions += message.code == ErrorCode::kCollision;
    log += service + ": " + toLogLine(message) + "\n";
  };
  const fleet::Fleet fleet = fleet::Fleet::load(fleet_file, {}, {});
  const auto options = formation::Formation::Options::read(fleet.service("formation"));
  States states(run.network, options.grid, fleet.bodies());
  if (!services::runInProcess(run, [&](std::uint64_t) { states.take(); }))
    throw std::runtime_error(out + ": the map could not be saved");
  states.take();
  dataset::writeAtomic(out + "/messages.log", log);

  const dataset::GroundTruth truth = dataset::GroundTruth::load(out + "/recording");
  const TrueRoom room = roomOf(truth, fleet);
  outcome.ended = !states.latest.empty() && std::all_of(states.latest.begin(), states.latest.end(),
                                                        [](const auto& s) { return s.second.arrived; });
  for (const auto& [robot, state] : states.latest) outcome.skipped += static_cast<int>(state.skipped.size());
  outcome.shared_frames = states.shared_frames;
  const auto& path = truth.trajectories.begin()->second;
  outcome.time_s = 1e-9 * static_cast<double>(path.back().time_ns - path.front().time_ns);
  followPaths(truth.trajectories, fleet, room, outcome);

  double reach_m = 0.0;
  for (const fleet::RobotSpec& robot : fleet.robots)
    if (fleet.maps(robot.name)) reach_m = std::max(reach_m, motion::reachOf(robot.body.outline()));
  const dataset::OccupancyGrid map = dataset::readMapServer(out + "/map.yaml");
  const ReachableFloor floor =
      ReachableFloor::of(room, reach_m, options.exploration.plan.margin_m, options.grid.sight_m);
  outcome.coverage = compare(map, floor, room);
  const dataset::OccupancyGrid explored = mapOf(states.shared.grid());
  outcome.explored_share = compare(explored, floor, room).covered_share;
  drawMissing(map, floor, out + "/missing.png");
  drawMissing(explored, floor, out + "/explored.png");
  return outcome;
}

std::string heading() {
  return "seed  ended   time  mapped of reachable   of visible  grid      wrong   least gap  collisions  "
         "shared  "
         "given up  driven\n";
}

std::string row(const Outcome& o) {
  const Coverage& c = o.coverage;
  return fmt::format(
      "{:4}  {:5}  {:4.0f} s  {:6.2f} % of {:.2f} m2  {:6.2f} %  {:6.2f} %  {:4.0f} cm2  {:6.1f} cm  {:10}  "
      "{:6}  {:8}  "
      "{:4.1f} m\n",
      o.seed, o.ended ? "yes" : "NO", o.time_s, 100.0 * c.covered_share, c.covered_m2,
      100.0 * c.visible_share, 100.0 * o.explored_share, 1e4 * c.wrong_m2, 100.0 * o.gap_m, o.collisions,
      o.shared_frames, o.skipped, o.driven_m);
}

}  // namespace omnifleet::exploration
