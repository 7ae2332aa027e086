#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dataset/ground_truth.h"
#include "dataset/map_files.h"
#include "dataset/track_files.h"
#include "figures.h"
#include "fleet/fleet.h"
#include "local_view.h"

namespace omnifleet::choi {
namespace {

const cv::Scalar kRed(40, 40, 220);

struct Bounds {
  Eigen::Vector2d low{1e9, 1e9}, high{-1e9, -1e9};
  void add(const Eigen::Vector2d& p, double margin_m) {
    low = low.cwiseMin((p.array() - margin_m).matrix());
    high = high.cwiseMax((p.array() + margin_m).matrix());
  }
};

Plot mapPlot(const std::string& title, const Bounds& bounds, cv::Size size = {1100, 900}) {
  Axes axes;
  axes.title = title;
  axes.x_label = "x (m)";
  axes.y_label = "y (m)";
  axes.low = bounds.low;
  axes.high = bounds.high;
  axes.equal = true;
  return Plot(axes, size);
}

Polygon placed(const Pose2& map_from_base, const Polygon& polygon) {
  Polygon out;
  for (const auto& p : polygon) out.push_back(map_from_base * p);
  return out;
}

struct StandingRobot {
  std::string name;
  RobotBody body;
  Pose2 pose;
};

/// Estimated poses of the robots at the frame nearest to `time_ns`.
std::vector<StandingRobot> robotsAt(const std::string& recording, const std::string& run, TimeNs time_ns) {
  std::vector<StandingRobot> robots;
  for (const auto& [name, body] : fleet::Fleet::load("", recording, {}).bodies()) {
    const auto path = dataset::flat(dataset::readTum(run + "/trajectories/" + name + ".tum"));
    if (path.empty()) continue;
    const auto at = std::min_element(path.begin(), path.end(), [&](const auto& a, const auto& b) {
      return std::abs(a.time_ns - time_ns) < std::abs(b.time_ns - time_ns);
    });
    robots.push_back({name, body, at->map_from_base});
  }
  return robots;
}

void drawRobots(Plot& plot, const std::vector<StandingRobot>& robots) {
  for (std::size_t i = 0; i < robots.size(); ++i) {
    plot.body(placed(robots[i].pose, robots[i].body.outline()), robots[i].pose.translation(),
              robots[i].pose.theta_rad, ink::robot(i));
    plot.words(robots[i].name, robots[i].pose.translation(), ink::kBlack, -26);
  }
}

void drawTruth(Plot& plot, const std::vector<dataset::MapObject>& scene) {
  for (const auto& object : scene)
    plot.line(object.outline_m, {ink::kBlack, 1, true, true, "true footprint"});
}

Bounds roomOf(const std::vector<dataset::MapObject>& scene, const std::vector<StandingRobot>& robots) {
  Bounds bounds;
  for (const auto& object : scene) {
    for (const auto& p : object.outline_m) bounds.add(p, 0.3);
  }
  for (const auto& robot : robots) bounds.add(robot.pose.translation(), 0.4);
  return bounds;
}

/// Tracks of one robot in its last frame.
std::vector<dataset::TrackRow> lastTracks(const std::string& run, const std::string& robot) {
  std::vector<std::string> warnings;
  auto rows = dataset::readTracks(run + "/tracks/" + robot + ".csv", warnings);
  const TimeNs last = rows.empty() ? 0 : rows.back().time_ns;
  rows.erase(std::remove_if(rows.begin(), rows.end(), [&](const auto& row) { return row.time_ns != last; }),
             rows.end());
  return rows;
}

/// Fig. 11: objects that one robot tracks, with centre, distance, bearing and kind.
cv::Mat drawInformation(const SeedData& data, const std::string& method, const std::string& title) {
  const std::string run = data.fixed_runs.at(method);
  const auto scene = dataset::GroundTruth::load(data.fixed).scene;
  const auto robots = robotsAt(data.fixed, run, INT64_MAX / 2);
  Plot plot = mapPlot(title, roomOf(scene, robots));
  drawTruth(plot, scene);
  for (std::size_t i = 0; i < robots.size(); ++i) {
    plot.line(placed(robots[i].pose, robots[i].body.outline()), {ink::kGrey, 1, true, true, ""});
  }
  const StandingRobot& self = robots.front();
  for (const auto& row : lastTracks(run, self.name)) {
    const Eigen::Vector2d at = self.pose * row.position_m;
    const bool is_robot = row.kind == ObjectKind::kRobot, is_known = row.kind != ObjectKind::kUnknown;
    const cv::Scalar colour = !is_known ? ink::kGrey : is_robot ? ink::kBlue : ink::kOrange;
    plot.line({self.pose.translation(), at}, {ink::kFaint * 0.85, 1, false, false, ""});
    plot.dot(at, colour, 6,
             !is_known  ? "centre O of an unclassified object"
             : is_robot ? "centre O of a robot"
                        : "centre O of an obstacle");
    plot.words(fmt::format("{:.2f} m, {:.0f} deg", row.position_m.norm(),
                           kDegrees * std::atan2(row.position_m.y(), row.position_m.x())),
               at, colour, 14, 0.42);
  }
  plot.body(placed(self.pose, self.body.outline()), self.pose.translation(), self.pose.theta_rad,
            ink::kBlack);
  plot.words(self.name, self.pose.translation(), ink::kBlack, -28);
  return plot.image();
}

/// Fig. 12: the formation while driving, with its distances and angles.
cv::Mat drawFormation(const SeedData& data) {
  const std::string run = data.moving_runs.at("omnifleet");
  const auto truth = dataset::GroundTruth::load(data.moving);
  const auto& leader_path = truth.trajectories.begin()->second;
  const TimeNs time_ns = leader_path[leader_path.size() * 3 / 5].time_ns;
  const auto robots = robotsAt(data.moving, run, time_ns);
  Bounds bounds;
  for (const auto& robot : robots) bounds.add(robot.pose.translation(), 1.1);
  Plot plot = mapPlot("formation while driving: d and theta of the followers, seen from the leader", bounds,
                      {1200, 860});
  for (const auto& object : dataset::readObjects(run + "/objects.geojson")) {
    plot.area(object.outline_m, ink::kOrange, 0.35, "obstacle in the map");
  }
  constexpr double kSight_m = 2.0;  // SilhouetteOptions::max_contact_m
  for (std::size_t i = 0; i < robots.size(); ++i) {
    plot.circle(robots[i].pose.translation(), kSight_m,
                {ink::robot(i), 1, true, false, fmt::format("range of {}'s objects, 2 m", robots[i].name)});
  }
  const StandingRobot& leader = robots.front();
  const Eigen::Vector2d from = leader.pose.translation();
  for (std::size_t i = 1; i < robots.size(); ++i) {
    const Eigen::Vector2d to = robots[i].pose.translation(), in_leader = leader.pose.inverse() * to;
    plot.line({from, to}, {ink::kBlack, 1, false, false, ""});
    plot.words(fmt::format("d {:.2f} m, theta {:.0f} deg", in_leader.norm(),
                           kDegrees * std::atan2(in_leader.y(), in_leader.x())),
               to, ink::kBlack, in_leader.y() > 0.0 ? 74 : -74, 0.5);
  }
  for (std::size_t i = 0; i < robots.size(); ++i) {
    std::vector<Eigen::Vector2d> path;
    for (const auto& pose :
         dataset::flat(dataset::readTum(run + "/trajectories/" + robots[i].name + ".tum"))) {
      if (pose.time_ns <= time_ns) path.push_back(pose.map_from_base.translation());
    }
    plot.line(path, {ink::robot(i), 2, false, false, "path of " + robots[i].name});
  }
  drawRobots(plot, robots);
  return plot.image();
}

/// Fig. 13: local maps of all robots overlaid, and the global map made of them.
cv::Mat drawOverlay(const SeedData& data, const std::string& method, const std::string& title) {
  const std::vector<std::string> overlays =
      method == "literal" ? std::vector<std::string>{data.overlay} : std::vector<std::string>{};
  const auto views = localViews(data.fixed, overlays);
  const auto scene = dataset::GroundTruth::load(data.fixed).scene;
  const auto robots = robotsAt(data.fixed, data.fixed_runs.at(method), INT64_MAX / 2);
  Plot plot = mapPlot(title, roomOf(scene, robots));
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (const auto& object : views[i].map.objects) {
      if (!hasOutline(object)) continue;
      const Polygon hull = placed(robots[i].pose, object.hull_m);
      plot.area(hull, ink::robot(i), 0.18);
      plot.line(hull, {ink::robot(i), 1, false, true, "hulls of " + views[i].robot});
    }
  }
  for (const auto& object : dataset::readObjects(data.fixed_runs.at(method) + "/objects.geojson"))
    plot.line(object.outline_m, {kRed, 2, false, true, "global map"});
  drawTruth(plot, scene);
  drawRobots(plot, robots);
  return plot.image();
}

/// Fig. 18: global map of §V.1 and the true footprints.
cv::Mat drawStaticMap(const SeedData& data) {
  const auto scene = dataset::GroundTruth::load(data.fixed).scene;
  const auto robots = robotsAt(data.fixed, data.fixed_runs.at("omnifleet"), INT64_MAX / 2);
  Plot plot = mapPlot("global map of V.1", roomOf(scene, robots), {1200, 960});
  for (const auto& object : dataset::readObjects(data.fixed_runs.at("literal") + "/objects.geojson")) {
    plot.line(object.outline_m, {ink::kOrange, 2, false, true, "as printed"});
    plot.dot(centroid(object.outline_m), ink::kOrange, 4);
  }
  for (const auto& object : dataset::readObjects(data.fixed_runs.at("omnifleet") + "/objects.geojson")) {
    plot.area(object.outline_m, ink::kBlue, 0.3);
    plot.line(object.outline_m, {ink::kBlue, 2, false, true, "omnifleet"});
    plot.dot(centroid(object.outline_m), ink::kBlue, 4);
  }
  drawTruth(plot, scene);
  drawRobots(plot, robots);
  return plot.image();
}

}  // namespace

void drawGlobalFigures(const SeedData& data, const std::string& folder) {
  const std::string to = folder + "/";
  save(to + "fig11_information.png",
       beside({drawInformation(data, "literal", "robots and objects observed by r1: as printed"),
               drawInformation(data, "omnifleet", "omnifleet")},
              {"distance and bearing from r1"}));
  save(to + "fig12_formation.png", drawFormation(data));
  save(to + "fig13_global_map.png",
       beside({drawOverlay(data, "literal", "local maps overlaid: as printed"),
               drawOverlay(data, "omnifleet", "silhouettes and fitted footprints: omnifleet")},
              {}));
  save(to + "fig18_static_map.png", drawStaticMap(data));
}

}  // namespace omnifleet::choi
