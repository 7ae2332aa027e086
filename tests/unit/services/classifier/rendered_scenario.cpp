#include "tests/unit/services/classifier/rendered_scenario.h"

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <random>

#include "classifier/classifier.h"
#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"
#include "synthetic/randomised.h"
#include "synthetic/renderer.h"
#include "world/drivers.h"

namespace omnifleet::rendered {
namespace {

constexpr double kMatch_m = 0.3;        // m, as `evaluate` matches
constexpr double kFree_m = 0.20;        // m, free space around the path of every body
constexpr double kApart_m = 0.40;       // m, between obstacles
constexpr double kBeside_m = 1.3;       // m, largest distance of an obstacle from the nearest path
constexpr double kPoseSigma_m = 0.005;  // m, of the localizer's estimates
constexpr double kPoseSigmaRad = 0.005;
constexpr double kInitialSigma_m = 0.05,
                 kInitialSigmaRad = 0.05;  // σ of the initial poses in the classifier service
constexpr double kNearest_m = 0.35;        // m, between the centres of two robots
constexpr unsigned kRedraw = 100000;       // added to the seed when the initial poses are drawn again
constexpr int kTries = 4000;

const char* const kRoom = R"(
frames: {rate_hz: 5, duration_s: 12}
floor: {size_m: [7, 5]}
image: {noise: 1.5, shot_noise: 0.06}
rigs:
  fisheye: {camera_model: fisheye, projection: equidistant, image_width: 640, image_height: 480, focal_px: 148.65932,
            principal_point_px: [319.5, 239.5], fov_deg: 185, position_m: [0, 0, 0.5], self_mask_radius_px: 99}
random: {obstacles: [0, 0], start_jitter_m: 0.05, start_jitter_rad: 0.1}
)";

/// A pushed box touches its pusher, which must not stop for it.
world::World::Options unstopped() {
  world::World::Options options;
  options.collisions_stop = false;
  return options;
}

/// The obstacles of a seed: random sizes, colours and places, drawn until no obstacle lies on a robot's path.
class Room {
 public:
  Room(const Scenario& scenario, unsigned seed) : scenario_(scenario), seed_(seed), dice_(seed) {
    const std::string text = std::string(kRoom) + "robots:\n" + scenario.robots;
    const synthetic::Arena layout = synthetic::Arena::read(options::Section::parse(text, scenario.name));
    for (unsigned thrown = seed; paths_.empty() || closest() < kNearest_m; thrown += kRedraw) {
      arena = synthetic::randomised(layout, thrown);
      arena.duration_s = scenario.duration_s;
      driveThrough();
    }
    if (!scenario.pushed_by.empty()) addPushed();
    for (const Pose2& screen : scenario.screens) addScreen(screen);
    addObstacles();
  }
  synthetic::Arena arena;

 private:
  double in(double low, double high) { return low + (high - low) * (dice_() / 4294967295.0); }

  void driveThrough() {
    paths_.clear();
    world::World world(arena, unstopped(), seed_);
    world::Drivers drivers(world);
    for (bool more = true; more;) {
      paths_.push_back(world.now().map_from_bases);
      more = !world.finished();
      if (more) world.step(drivers.commands(world));
    }
  }

  /// Smallest distance between the centres of two robots at any time: robots must not drive through each
  /// other.
  double closest() const {
    double least_m = INFINITY;
    for (const auto& poses : paths_) {
      for (std::size_t i = 0; i < poses.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j)
          least_m = std::min(least_m, (poses[i].translation() - poses[j].translation()).norm());
      }
    }
    return least_m;
  }

  /// A box in front of the pusher that moves with it.
  void addPushed() {
    std::size_t pusher = 0;
    while (arena.robots[pusher].name != scenario_.pushed_by) ++pusher;
    synthetic::Solid box;
    box.size_m = {in(0.16, 0.26), in(0.16, 0.30)};
    box.height_m = in(0.12, 0.22);
    box.rgb = {static_cast<std::uint8_t>(in(20, 220)), 60, 120};
    const Pose2 ahead{arena.robots[pusher].body.radius_m + 0.5 * box.size_m.x() + 0.003, 0.0, 0.0};
    box.map_from_solid = paths_.front()[pusher] * ahead;
    arena.solids.push_back(box);
    for (std::size_t f = 0; f + 1 < paths_.size(); ++f) {
      arena.moves.push_back(
          {0, static_cast<double>(f) / arena.rate_hz, 1.0 / arena.rate_hz, paths_[f + 1][pusher] * ahead});
    }
  }

  /// A box nearly as high as the cameras, which hides everything that passes behind it.
  void addScreen(const Pose2& screen) {
    synthetic::Solid box;
    box.size_m = {in(0.12, 0.20), in(0.40, 0.60)};
    box.height_m = in(0.38, 0.44);
    box.rgb = {static_cast<std::uint8_t>(in(20, 220)), 120, 60};
    box.map_from_solid = screen * Pose2{in(-0.05, 0.05), in(-0.1, 0.1), in(-0.2, 0.2)};
    arena.solids.push_back(box);
  }

  bool isBesidePaths(const Eigen::Vector2d& place_m, double reach_m) const {
    double least_m = INFINITY;
    for (const auto& poses : paths_) {
      for (const Pose2& pose : poses) least_m = std::min(least_m, (pose.translation() - place_m).norm());
    }
    for (const synthetic::Solid& other : arena.solids) {
      for (std::size_t f = 0; f < paths_.size(); f += 5) {
        const Pose2 pose = arena.solidAt(static_cast<int>(&other - arena.solids.data()),
                                         static_cast<double>(f) / arena.rate_hz);
        if (other.distance(place_m, pose) < reach_m + kApart_m) return false;
      }
    }
    return least_m > 0.15 + reach_m + kFree_m && least_m < kBeside_m;
  }

  void addObstacles() {
    const auto wanted = arena.solids.size() + static_cast<std::size_t>(in(5.0, 8.0));
    for (int i = 0; i < kTries && arena.solids.size() < wanted; ++i) {
      synthetic::Solid solid;
      solid.kind = in(0, 1) < 0.6 ? synthetic::SolidKind::kBox : synthetic::SolidKind::kCylinder;
      solid.map_from_solid = {in(-3.2, 3.2), in(-2.2, 2.2), in(-M_PI, M_PI)};
      solid.size_m = {in(0.14, 0.36), in(0.14, 0.36)};
      solid.radius_m = in(0.07, 0.18);
      solid.height_m = in(0.10, 0.26);
      for (std::uint8_t& channel : solid.rgb) channel = static_cast<std::uint8_t>(in(15, 225));
      const auto [least, most] = std::minmax_element(solid.rgb.begin(), solid.rgb.end());
      if (*most - *least < 70) continue;  // grey obstacles are tested by the floor segmentation study
      const bool box = solid.kind == synthetic::SolidKind::kBox;
      if (isBesidePaths(solid.map_from_solid.translation(), box ? 0.5 * solid.size_m.norm() : solid.radius_m))
        arena.solids.push_back(solid);
    }
  }

  const Scenario& scenario_;
  unsigned seed_;
  std::mt19937 dice_;
  std::vector<std::vector<Pose2>> paths_;  ///< per frame
};

/// Renderer, mapper and classifier of one robot.
struct Observer {
  std::size_t robot;
  synthetic::Renderer renderer;
  local_mapper::LocalMapper mapper;
  classifier::Classifier classifier;
  motion::WheelIntegrator wheels;
  std::map<std::string, std::uint32_t> id_of;
  cv::Mat image;
};

/// The true body at the place of a track.
struct TrueObject {
  std::string name;
  bool robot = false;
  double away_m = INFINITY;
};

class Run {
 public:
  Run(const Scenario& scenario, unsigned seed)
      : scenario_(scenario),
        arena_(Room(scenario, seed).arena),
        world_(arena_, unstopped(), seed),
        drivers_(world_),
        noise_(seed + 77) {
    std::map<std::string, RobotBody> bodies;
    for (const auto& robot : arena_.robots) {
      if (!scenario.foreign.count(robot.name)) bodies[robot.name] = robot.body;
    }
    for (std::size_t i = 0; i < arena_.robots.size(); ++i) {
      const std::string& name = arena_.robots[i].name;
      if (!bodies.count(name)) continue;
      observers_.push_back(
          Observer{i,
                   synthetic::Renderer(arena_, name + "/fisheye", seed),
                   local_mapper::LocalMapper(lens::Camera(arena_.camera(name + "/fisheye").model), {}),
                   classifier::Classifier({}, name, bodies),
                   motion::WheelIntegrator(arena_.robots[i].body.wheel_separation_m, {}),
                   {},
                   {}});
    }
  }

  Score all() {
    assumeInitialPoses(world_.now());
    for (bool more = true; more;) {
      const world::World::State state = world_.now();
      const std::vector<PoseEstimate> published = publish(state);
      for (Observer& observer : observers_) observe(observer, state);
      poses_ = published;
      more = !world_.finished();
      if (!more) break;
      const world::World::Driven& driven = world_.step(drivers_.commands(world_));
      for (Observer& observer : observers_) {
        for (const auto& row : driven.wheels[observer.robot])
          observer.wheels.add(row.time_ns, row.left_mps, row.right_mps);
      }
    }
    return score_;
  }

 private:
  /// As the service reads them from the fleet file: correct to 0.5 cm.
  void assumeInitialPoses(const world::World::State& state) {
    std::vector<PoseEstimate> initial_poses = publish(state);
    for (PoseEstimate& initial : initial_poses)
      initial.covariance =
          Eigen::Vector3d(kInitialSigma_m, kInitialSigma_m, kInitialSigmaRad).cwiseAbs2().asDiagonal();
    for (Observer& observer : observers_) observer.classifier.setInitialPoses(initial_poses);
  }

  std::vector<PoseEstimate> publish(const world::World::State& state) {
    std::normal_distribution<double> normal;
    std::vector<PoseEstimate> poses;
    for (const Observer& observer : observers_) {
      PoseEstimate pose;
      pose.robot = arena_.robots[observer.robot].name;
      pose.acquired_ns = state.time_ns;
      pose.valid = true;
      pose.map_from_base =
          state.map_from_bases[observer.robot] *
          Pose2{kPoseSigma_m * normal(noise_), kPoseSigma_m * normal(noise_), kPoseSigmaRad * normal(noise_)};
      pose.covariance = Eigen::Vector3d(kPoseSigma_m, kPoseSigma_m, kPoseSigmaRad).cwiseAbs2().asDiagonal();
      poses.push_back(pose);
    }
    return poses;
  }

  void observe(Observer& observer, const world::World::State& state) {
    local_mapper::Frame frame;
    frame.acquired_ns = state.time_ns;
    frame.sequence = static_cast<std::uint32_t>(state.frame);
    observer.renderer.render(state.frame, state.map_from_bases, observer.image);
    frame.image = observer.image;
    LocalMap map = observer.mapper.process(frame, observer.wheels.motionTo(state.time_ns));
    map.robot = arena_.robots[observer.robot].name;
    judge(observer, observer.classifier.process(map, poses_), state);
  }

  TrueObject nearest(const Eigen::Vector2d& place_m, std::size_t self,
                     const world::World::State& state) const {
    TrueObject object;
    for (std::size_t i = 0; i < arena_.robots.size(); ++i) {
      const double away_m = (state.map_from_bases[i].translation() - place_m).norm();
      if (i != self && away_m < object.away_m) object = {arena_.robots[i].name, true, away_m};
    }
    const double time_s = static_cast<double>(state.frame) / arena_.rate_hz;
    for (std::size_t i = 0; i < arena_.solids.size(); ++i) {
      const Pose2 pose = arena_.solidAt(static_cast<int>(i), time_s);
      const double inside_m = arena_.solids[i].distance(place_m, pose);
      const double away_m = inside_m <= 0.0 ? 0.0 : (pose.translation() - place_m).norm();
      if (away_m < object.away_m) object = {"o" + std::to_string(i), false, away_m};
    }
    return object;
  }

  void judge(Observer& observer, const Objects& objects, const world::World::State& state) {
    const bool counted = state.frame >= scenario_.warm_up_s * arena_.rate_hz;
    std::map<std::string, std::pair<double, const Track*>> seen;
    for (const Track& track : objects.tracks) {
      if (!track.visible) continue;
      const TrueObject object =
          nearest(state.map_from_bases[observer.robot] * track.position_m, observer.robot, state);
      const bool any = object.away_m <= kMatch_m;
      if (counted) count(any && object.robot, any && !object.robot, track.kind);
      if (counted) trace(observer, track, object, state);
      if (!any) continue;
      const auto best = seen.emplace(object.name, std::make_pair(object.away_m, &track)).first;
      if (object.away_m < best->second.first) best->second = {object.away_m, &track};
    }
    for (const auto& [name, match] : seen) {
      const auto [id, first] = observer.id_of.emplace(name, match.second->id);
      if (first || id->second == match.second->id) continue;
      if (std::getenv("OMNIFLEET_TRACE"))
        std::cerr << arena_.robots[observer.robot].name << " " << state.frame << " " << name << " was track "
                  << id->second << ", is " << match.second->id << "\n";
      id->second = match.second->id;
      ++score_.switches;
    }
  }

  void count(bool is_robot, bool is_obstacle, ObjectKind label) {
    const auto add = [](bool is, bool labelled, evaluation::ClassCounts& counts) {
      counts.right += is && labelled;
      counts.missed += is && !labelled;
      counts.wrong += !is && labelled;
    };
    add(is_robot, label == ObjectKind::kRobot, score_.robots);
    add(is_obstacle, label == ObjectKind::kObstacle, score_.obstacles);
    score_.nothing += !is_robot && !is_obstacle;
  }

  void trace(const Observer& observer, const Track& track, const TrueObject& object,
             const world::World::State& state) const {
    if (!std::getenv("OMNIFLEET_TRACE")) return;
    const bool any = object.away_m <= kMatch_m;
    if (any && (object.robot ? track.kind == ObjectKind::kRobot : track.kind == ObjectKind::kObstacle))
      return;
    std::cerr << arena_.robots[observer.robot].name << " " << state.frame << " "
              << (any ? object.name : "nothing") << " " << object.away_m << " m off: track " << track.id
              << " " << toString(track.kind) << " p " << track.kind_probability << " at "
              << track.position_m.norm() << " m, v " << track.velocity_mps.norm() << " h " << track.height_m
              << " solidity " << track.solidity << (track.truncated ? " truncated" : "") << "\n";
  }

  const Scenario& scenario_;
  synthetic::Arena arena_;
  world::World world_;
  world::Drivers drivers_;
  std::mt19937 noise_;
  std::vector<Observer> observers_;
  std::vector<PoseEstimate> poses_;
  Score score_;
};

}  // namespace

Score& Score::operator+=(const Score& other) {
  robots += other.robots;
  obstacles += other.obstacles;
  nothing += other.nothing;
  switches += other.switches;
  return *this;
}

Score run(const Scenario& scenario, unsigned seed) {
  return Run(scenario, seed).all();
}

}  // namespace omnifleet::rendered
