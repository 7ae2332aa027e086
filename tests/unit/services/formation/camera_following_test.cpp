// Followers that use their own camera: the leader turns for an obstacle, the others see it turn and turn too,
// whether or not poses are published. Also the opposite: followers that do not see the leader use published
// poses. Perfect tracks and scans in the simulated world, commands one frame late.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "formation/formation.h"
#include "world/observer.h"
#include "world/world.h"

namespace omnifleet::world {
namespace {

using formation::Formation;

/// Inputs available to the followers. The leader always has its own pose and sees everything.
struct Inputs {
  bool published = true;  ///< poses of the other robots
  int late_frames = 0;    ///< additional age of published poses
  double blind_from_m = 1e9,
         blind_to_m = -1e9;  ///< range of the leader's x in which no follower sees a robot
};

/// A formation that drives through an arena frame by frame.
class Fleet {
 public:
  Fleet(const synthetic::Arena& arena, Inputs inputs)
      : world(arena, {}, 1), inputs_(inputs), next_(3), before_(world.now().map_from_bases) {
    std::map<std::string, RobotBody> bodies;
    for (const auto& robot : arena.robots) bodies[robot.name] = robot.body;
    const auto options = Formation::Options::read(arena.formation);
    for (const auto& robot : arena.robots) formations_.emplace_back(robot.name, bodies, options);
    states.resize(3);
  }

  void step() {
    const std::vector<motion::WheelSpeeds> commands = next_;
    for (std::size_t i = 0; i < 3; ++i) {
      const Formation::Output output = formations_[i].process(observed(i), poses(i), received_);
      next_[i] = output.command.speeds;
      states[i] = output.state;
    }
    received_ = states;
    before_ = world.now().map_from_bases;
    before_ns_ = world.now().time_ns;
    published_.push_front(exactPoses(world));
    if (published_.size() > 20) published_.pop_back();
    collisions += world.step(commands).collisions.size();
  }
  bool arrived() const { return world.finished() || states[0].arrived; }
  const Pose2& pose(std::size_t robot) const { return world.now().map_from_bases[robot]; }
  /// Distance of a follower from its place beside the leader.
  double outOfPlace(std::size_t robot) const {
    motion::FormationCommand wedge;
    wedge.distance_m = 0.75;
    return (pose(robot).translation() - pose(0) * motion::placesOf(wedge, 3)[robot]).norm();
  }

  World world;
  std::vector<motion::FormationState> states;
  std::size_t collisions = 0;

 private:
  Objects observed(std::size_t robot) const {
    Objects objects = observe(world, robot);
    if (before_ns_ > 0)
      objects.motion = exactMotion(before_[robot], world.now().map_from_bases[robot], before_ns_);
    const double leader_m = pose(0).x_m;
    const bool blind = robot > 0 && leader_m >= inputs_.blind_from_m && leader_m <= inputs_.blind_to_m;
    if (blind) objects.tracks.clear();
    return objects;
  }
  std::vector<PoseEstimate> poses(std::size_t robot) const {
    if (published_.empty()) return {};
    const std::vector<PoseEstimate>& now = published_.front();
    if (robot == 0) return now;
    std::vector<PoseEstimate> known{now[robot]};
    const auto late = std::min<std::size_t>(inputs_.late_frames, published_.size() - 1);
    for (std::size_t other = 0; other < 3 && inputs_.published; ++other) {
      if (other != robot) known.push_back(published_[late][other]);
    }
    return known;
  }

  Inputs inputs_;
  std::vector<Formation> formations_;
  std::vector<motion::WheelSpeeds> next_;
  std::vector<Pose2> before_;
  TimeNs before_ns_ = 0;
  std::deque<std::vector<PoseEstimate>> published_;  ///< newest first
  std::vector<motion::FormationState> received_;
};

/// Three robots in a wedge, heading for x = 2.5 m.
synthetic::Arena arena(const std::string& more = "") {
  return synthetic::Arena::read(options::Section::parse(R"(
frames: {rate_hz: 5, duration_s: 60}
floor: {size_m: [8, 5]}
robots:
  r1: {initial_pose: [-2.4, 0.0, 0.0]}
  r2: {initial_pose: [-3.02, 0.42, 0.0]}
  r3: {initial_pose: [-3.02, -0.42, 0.0]}
formation: {shape: wedge, distance_m: 0.75, angle_rad: 0.6, waypoints: [[2.5, 0.0]]}
)" + more,
                                                        "arena.yaml"));
}

/// In the leader's way only: the leader passes on its right. r3's own path at y = −0.42 m has 40 cm of free
/// space (15 cm of body, 22 cm of margin), so r3 moves aside only to keep the formation.
const char* const kInTheLeadersWay =
    "obstacles: [{kind: cylinder, pose: [0.2, 0.1, 0], radius_m: 0.12, height_m: 0.2}]\n";

struct Turned {
  double leader_m = 0.0, follower_m = 0.0;  ///< largest displacement to the right
  double worst_m = 0.0;                     ///< position error of any follower at the end
  std::size_t collisions = 0;
  bool arrived = false;
};

Turned driveAround(const Inputs& inputs) {
  Fleet fleet(arena(kInTheLeadersWay), inputs);
  Turned turned;
  while (!fleet.arrived()) {
    fleet.step();
    turned.leader_m = std::max(turned.leader_m, -fleet.pose(0).y_m);
    turned.follower_m = std::max(turned.follower_m, -0.42 - fleet.pose(2).y_m);
  }
  turned.arrived = fleet.states[0].arrived;
  turned.collisions = fleet.collisions;
  turned.worst_m = std::max(fleet.outOfPlace(1), fleet.outOfPlace(2));
  return turned;
}

void expectAllTurned(const Turned& run) {
  EXPECT_TRUE(run.arrived);
  EXPECT_EQ(run.collisions, 0u);
  EXPECT_GT(run.leader_m, 0.25) << "the leader passes the obstacle on its right";
  EXPECT_GT(run.follower_m, 0.5 * run.leader_m) << "the follower turns because the leader turns";
  EXPECT_LT(run.worst_m, 0.15) << "more than half a body out of place is out of formation";
}

TEST(CameraFollowing, TurnsWithTheLeaderUsingCamerasOnly) {
  Inputs inputs;
  inputs.published = false;
  expectAllTurned(driveAround(inputs));
}

TEST(CameraFollowing, TurnsWithTheLeaderIfPosesAreLate) {
  Inputs inputs;
  inputs.late_frames = 3;  // 0.8 s old: still in use
  expectAllTurned(driveAround(inputs));
  inputs.late_frames = 8;  // 1.8 s: older than pose_age_limit_s, not used
  expectAllTurned(driveAround(inputs));
}

TEST(CameraFollowing, UsesPublishedPosesWhenLeaderIsNotVisible) {
  Inputs inputs;
  inputs.blind_from_m = -1.0;  // from before the obstacle until after it
  inputs.blind_to_m = 1.5;
  expectAllTurned(driveAround(inputs));
}

TEST(CameraFollowing, StopsWithoutCameraAndPublishedPoses) {
  Inputs inputs;
  inputs.published = false;
  inputs.blind_from_m = -1.0;
  inputs.blind_to_m = 10.0;
  Fleet fleet(arena(), inputs);
  while (!fleet.arrived()) fleet.step();
  EXPECT_EQ(fleet.collisions, 0u);
  for (const std::size_t robot : {1u, 2u}) EXPECT_LT(fleet.pose(robot).x_m, -1.0 - 0.62 + 0.75) << robot;
}

}  // namespace
}  // namespace omnifleet::world
