#include "merger_scenes.h"

#include <algorithm>
#include <iterator>

#include "outline/polygon_set.h"

namespace omnifleet::global_merger::testing {

using dataset::MapObject;
using omnifleet::testing::boxPolygon;
using omnifleet::testing::SimRobot;

std::vector<SimObstacle> fiveObstacles() {
  return {{boxPolygon({0.0, -1.0}, 0.40, 0.25, 0.3), 0.20},
          {boxPolygon({1.7, 0.7}, 0.30, 0.30, 0.1), 0.25},
          {circlePolygon({-0.2, 0.95}, 0.12, 48), 0.30},
          {boxPolygon({-1.5, -0.9}, 0.50, 0.15, -0.6), 0.15},
          {circlePolygon({0.8, -0.1}, 0.15, 6), 0.10}};
}

FleetSim arena(SimOptions options, unsigned seed, std::vector<SimObstacle> obstacles) {
  std::vector<SimRobot> robots;
  robots.push_back({"r1", [](double t) { return Pose2{-1.0 + 0.15 * t, 0.1, 0.1 + 0.05 * t}; }});
  robots.push_back({"r2", [](double t) { return Pose2{0.9, -0.9 + 0.02 * t, 1.5 - 0.1 * t}; }});
  robots.push_back({"r3", [](double) { return Pose2{0.9, 1.2, -2.0}; }});  // stationary
  return FleetSim(std::move(obstacles), robots, options, seed);
}

SimOptions noisy() {
  SimOptions options;
  options.range_noise_m = 0.004;
  options.support_noise = 1.0;
  options.pose_noise_m = 0.002;
  return options;
}

Sets record(FleetSim& sim, double from_s, double to_s, double step_s) {
  std::map<std::string, ContributionMaker> makers;
  Sets sets;
  for (double t = from_s; t < to_s; t += step_s) {
    for (auto& frame : sim.at(t)) {
      auto made = makers.try_emplace(frame.pose.robot, KeyframeOptions{})
                      .first->second.make(frame.objects, frame.pose);
      if (!made) continue;
      sets.contributions.push_back(made->contribution);
      sets.poses.push_back(made->pose);
    }
  }
  return sets;
}

Merger merged(const Sets& sets, const std::map<std::string, RobotBody>& bodies,
              const MergerOptions& options) {
  Merger merger(options, {}, bodies);
  for (const auto& c : sets.contributions) merger.add(c);
  for (const auto& p : sets.poses) merger.add(p);
  return merger;
}

Score score(const std::vector<MapObject>& all, const std::vector<SimObstacle>& truth) {
  std::vector<MapObject> objects;
  std::copy_if(all.begin(), all.end(), std::back_inserter(objects),
               [](const MapObject& object) { return !object.isOpen(); });
  Score s;
  std::vector<bool> used(objects.size(), false);
  for (const auto& obstacle : truth) {
    std::size_t best = objects.size();
    double least = 0.15;  // as in evaluate
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const double apart = (objects[i].centroid_m - centroid(obstacle.footprint_m)).norm();
      if (!used[i] && apart < least) best = i, least = apart;
    }
    if (best == objects.size()) {
      ++s.missed;
      continue;
    }
    used[best] = true;
    ++s.matched;
    s.error_m += least;
    s.iou += outline::iou(objects[best].outline_m, obstacle.footprint_m);
    s.height_m += std::abs(objects[best].height_m - obstacle.height_m);
  }
  s.extra = static_cast<int>(std::count(used.begin(), used.end(), false));
  const double n = std::max(s.matched, 1);
  s.error_m /= n, s.iou /= n, s.height_m /= n;
  return s;
}

std::vector<dataset::MapObject> obstaclesOf(Merger& merger) {
  std::vector<dataset::MapObject> obstacles;
  for (const dataset::MapObject& object : merger.outlines())
    if (!object.isOpen()) obstacles.push_back(object);
  return obstacles;
}

std::vector<Eigen::Vector2d> flagged(Merger& merger, Quality quality) {
  std::vector<Eigen::Vector2d> at_m;
  for (const dataset::MapObject& object : merger.outlines())
    if (std::count(object.quality.begin(), object.quality.end(), toString(quality)) > 0)
      at_m.push_back(object.centroid_m);
  return at_m;
}

std::string text(Merger& merger) {
  return dataset::objectsText(merger.outlines());
}

}  // namespace omnifleet::global_merger::testing
