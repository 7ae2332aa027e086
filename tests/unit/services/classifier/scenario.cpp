#include "tests/unit/services/classifier/scenario.h"

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>

#include "tracking/assignment.h"

namespace omnifleet::sim {
namespace {

constexpr double kMatch_m = 0.20;
constexpr std::uint32_t kSettled = 3;  // frames; before the first poses arrive, objects in line are one blob

/// One robot's classifier with the true bodies of each blob, and their tracks so far.
struct Observer {
  std::size_t self;
  classifier::Classifier classifier;
  std::map<std::size_t, std::uint32_t> id_of;
  std::map<std::size_t, ObjectKind> kind_of;
  std::vector<std::vector<std::size_t>> blobs;
};

/// Bodies visible in this frame, alone in their blob or merged.
std::vector<std::size_t> seenBodies(const Observer& observer) {
  std::vector<std::size_t> seen;
  for (const auto& blob : observer.blobs) seen.insert(seen.end(), blob.begin(), blob.end());
  return seen;
}

bool alone(const Observer& observer, std::size_t body) {
  return std::any_of(observer.blobs.begin(), observer.blobs.end(),
                     [&](const auto& blob) { return blob.size() == 1 && blob.front() == body; });
}

void countKind(const Body& body, ObjectKind kind, Score& score) {
  if (kind == ObjectKind::kUnknown) ++score.undecided;
  if (body.robot) {
    ++(kind == ObjectKind::kRobot ? score.robots_right : score.robots_missed);
  } else {
    ++(kind == ObjectKind::kRobot ? score.obstacles_as_robots : score.obstacles_right);
  }
}

void judge(const Scene& scene, const Objects& objects, Observer& observer, bool counted, Score& score) {
  const std::vector<std::size_t> seen = seenBodies(observer);
  std::vector<const Track*> tracks;
  for (const Track& track : objects.tracks) {
    if (track.visible) tracks.push_back(&track);
  }
  const Pose2& map_from_base = scene.bodies[observer.self].pose;
  Eigen::MatrixXd cost(static_cast<Eigen::Index>(seen.size()), static_cast<Eigen::Index>(tracks.size()));
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t t = 0; t < tracks.size(); ++t) {
      cost(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(t)) =
          (map_from_base * tracks[t]->position_m - scene.bodies[seen[i]].pose.translation()).norm();
    }
  }
  const std::vector<int> track_of = tracking::assign(cost, kMatch_m);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Body& body = scene.bodies[seen[i]];
    const double distance = (body.pose.translation() - map_from_base.translation()).norm();
    if (distance > 2.0) continue;
    if (track_of[i] < 0) {
      if (counted && alone(observer, seen[i])) countKind(body, ObjectKind::kUnknown, score);
      continue;
    }
    const Track& track = *tracks[static_cast<std::size_t>(track_of[i])];
    const auto id = observer.id_of.find(seen[i]);
    const bool switched = objects.sequence > kSettled && id != observer.id_of.end() && id->second != track.id;
    if (switched) ++score.switches;
    if (std::getenv("OMNIFLEET_TRACE") &&
        (switched || (body.robot != (track.kind == ObjectKind::kRobot) && counted))) {
      std::cerr << scene.bodies[observer.self].name << " frame " << objects.sequence << " " << body.name
                << " at " << distance << " m: track " << track.id << " " << toString(track.kind) << " p "
                << track.kind_probability << (switched ? " SWITCHED" : "") << " solidity " << track.solidity
                << " h " << track.height_m << "\n";
    }
    observer.id_of[seen[i]] = track.id;
    ObjectKind& before = observer.kind_of[seen[i]];
    if (before != ObjectKind::kUnknown && track.kind != before) ++score.relabels;
    before = track.kind;
    if (!counted) continue;
    countKind(body, track.kind, score);
    if (!alone(observer, seen[i])) continue;
    score.error_m += cost(static_cast<Eigen::Index>(i), track_of[i]);
    ++score.errors;
  }
}

}  // namespace

Score& Score::operator+=(const Score& other) {
  robots_right += other.robots_right;
  robots_missed += other.robots_missed;
  obstacles_right += other.obstacles_right;
  obstacles_as_robots += other.obstacles_as_robots;
  undecided += other.undecided;
  switches += other.switches;
  relabels += other.relabels;
  error_m += other.error_m;
  errors += other.errors;
  slowest_ms = std::max(slowest_ms, other.slowest_ms);
  total_ms += other.total_ms;
  processed += other.processed;
  return *this;
}

Score run(const Scenario& scenario, unsigned seed, const classifier::Classifier::Options& options) {
  std::mt19937 rng(seed);
  Scene scene = scenario.make(rng), before;
  std::map<std::string, RobotBody> bodies;
  for (const Body& body : scene.bodies) {
    if (!body.robot || !body.declared) continue;
    bodies[body.name].radius_m = 0.15;
    bodies[body.name].height_m = body.height_m;
  }
  std::vector<Observer> observers;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    observers.push_back({i, classifier::Classifier(options, scene.bodies[i].name, bodies), {}, {}, {}});
  }
  Score score;
  std::vector<PoseEstimate> poses;
  for (int frame = 0; frame < scenario.frames; ++frame) {
    for (Observer& observer : observers) {
      LocalMap map = localMapOf(scene, observer.self, frame ? &before : nullptr, frame, rng, &observer.blobs);
      for (std::size_t b = observer.blobs.size(); b-- > 0;) {
        if (observer.blobs[b].size() != 1 || !scenario.lost(observer.blobs[b].front(), frame)) continue;
        observer.blobs.erase(observer.blobs.begin() + static_cast<std::ptrdiff_t>(b));
        map.objects.erase(map.objects.begin() + static_cast<std::ptrdiff_t>(b));
      }
      const auto begun = std::chrono::steady_clock::now();
      const Objects& objects = observer.classifier.process(map, poses);
      const double ms =
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun).count();
      score.total_ms += ms;
      score.slowest_ms = std::max(score.slowest_ms, ms);
      ++score.processed;
      scenario.watch(scene, objects, frame);
      judge(scene, objects, observer, frame >= scenario.warm_up, score);
    }
    if (scenario.feedback) poses = publish(scene, frame, rng);
    scenario.garble(poses);
    before = scene;
    scenario.drive(scene, frame, rng);
    scene.advance();
  }
  return score;
}

Scene mixedScene(std::mt19937& rng) {
  std::uniform_real_distribution<double> place(-1.6, 1.6), turn(-M_PI, M_PI), size(0.10, 0.30),
      height(0.08, 0.32);
  Scene scene;
  scene.noise.focal_scale = 1.0 + 0.002 * std::uniform_real_distribution<double>(-1.0, 1.0)(rng);
  while (scene.bodies.size() < 8) {
    const std::size_t i = scene.bodies.size();
    const Pose2 pose{place(rng), place(rng), turn(rng)};
    Body body = i < 3        ? round("r" + std::to_string(i + 1), 0.15, 0.30, pose)
                : i % 2 == 0 ? round("o" + std::to_string(i), 0.5 * size(rng), height(rng), pose)
                             : box("o" + std::to_string(i), size(rng), size(rng), height(rng), pose);
    body.robot = i < 3;
    if (std::all_of(scene.bodies.begin(), scene.bodies.end(),
                    [&](const Body& other) { return gap(body, other) > 0.25; })) {
      scene.bodies.push_back(body);
    }
  }
  return scene;
}

Scene apartScene(std::mt19937& rng) {
  std::uniform_real_distribution<double> shift(-0.1, 0.1);
  Scene scene;
  const std::vector<Eigen::Vector2d> places{{-1.0, -0.9}, {-1.0, 0.9}, {1.1, 0.0},
                                            {0.1, 0.0},   {0.0, 1.6},  {0.0, -1.6}};
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Pose2 pose{places[i].x() + shift(rng), places[i].y() + shift(rng), 10.0 * shift(rng)};
    scene.bodies.push_back(i < 3 ? round("r" + std::to_string(i + 1), 0.15, 0.3, pose)
                                 : box("o" + std::to_string(i), 0.2, 0.15, 0.12, pose));
    scene.bodies.back().robot = i < 3;
  }
  return scene;
}

}  // namespace omnifleet::sim
