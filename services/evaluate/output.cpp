#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "evaluate/report.h"

namespace omnifleet::evaluate {
namespace {

using Json = nlohmann::ordered_json;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();  // shown as a dash
constexpr double kDegrees = 180.0 / M_PI;

/// A number in a column; a dash for NaN.
std::string cell(double value, int width, int decimals) {
  return std::isfinite(value) ? fmt::format("{:>{}.{}f}", value, width, decimals)
                              : fmt::format("{:>{}}", "-", width);
}

std::string mapTable(const Report& report) {
  const evaluation::MapMetrics& m = *report.map;
  const std::string drawn = m.drawn_as_structure.empty() ? ""
                                                         : fmt::format(" ({} of them drawn as structure)",
                                                                       m.drawn_as_structure.size());
  std::string text = fmt::format(
      "Obstacles   found {} of {}, missed {}{}, false {}   recall {}, precision {}\n", m.matches.size(),
      m.truths, m.missed.size(), drawn, m.falsely_found.size(), cell(m.truths > 0 ? m.recall : kNone, 5, 3),
      cell(m.estimates > 0 ? m.precision : kNone, 5, 3));
  text += fmt::format("  mean error x / y                 {} / {} cm\n", cell(100.0 * m.x_error_m, 6, 2),
                      cell(100.0 * m.y_error_m, 5, 2));
  text += fmt::format("  overlap of footprints (IoU)      {}\n", cell(m.iou, 7, 3));
  text += fmt::format("  error of mutual distances        {} cm\n", cell(100.0 * m.distances_error_m, 6, 2));
  text += "  true   map   dx cm   dy cm    IoU\n";
  for (const evaluation::ObstacleMatch& match : m.matches) {
    text += fmt::format("  {:>4}  {:>4} {} {} {}\n", report.truth[match.truth].id,
                        report.objects[match.estimate].id, cell(100.0 * match.dx_m, 7, 2),
                        cell(100.0 * match.dy_m, 7, 2), cell(match.iou, 6, 3));
  }
  const auto place = [](const dataset::MapObject& object) {
    const Eigen::Vector2d c = centroid(object.outline_m);
    return fmt::format("({:.2f}, {:.2f}) m", c.x(), c.y());
  };
  for (const int i : m.missed) {
    const bool is_drawn =
        std::find(m.drawn_as_structure.begin(), m.drawn_as_structure.end(), i) != m.drawn_as_structure.end();
    text +=
        fmt::format("  {:>4}     -   {}, at {}\n", report.truth[i].id,
                    is_drawn ? "no closed outline, drawn as structure" : "missed", place(report.truth[i]));
  }
  for (const int i : m.falsely_found)
    text += fmt::format("     -  {:>4}   false, at {}\n", report.objects[i].id, place(report.objects[i]));
  return text;
}

std::string pathRow(const std::string& name, const std::string& poses, const evaluation::PathMetrics& p,
                    double ate_m, const evaluation::RelativeError& rpe) {
  return fmt::format(
      "  {:<10} {:>9} {} {} {} {} {} {} {} {} {}\n", name, poses, cell(100.0 * p.x_m, 6, 2),
      cell(100.0 * p.y_m, 6, 2), cell(100.0 * p.distance_m, 9, 2), cell(100.0 * p.rmse_m, 7, 2),
      cell(100.0 * p.max_m, 6, 2), cell(kDegrees * p.heading_rad, 10, 3), cell(100.0 * ate_m, 7, 2),
      cell(100.0 * rpe.translation_m.rmse, 7, 3), cell(kDegrees * rpe.rotation_rad.rmse, 7, 3));
}

/// Means over the robots that have a path.
struct Overall {
  evaluation::PathMetrics path;
  double ate_m = 0.0;
  evaluation::RelativeError rpe;
  int robots = 0;
};

Overall overall(const Report& report) {
  Overall sum;
  for (const RobotReport& r : report.robots) sum.robots += r.path.poses > 0;
  if (sum.robots == 0) {
    sum.path.x_m = sum.path.y_m = sum.path.distance_m = sum.path.rmse_m = sum.path.heading_rad =
        sum.path.max_m = kNone;
    sum.ate_m = sum.rpe.translation_m.rmse = sum.rpe.rotation_rad.rmse = kNone;
    return sum;
  }
  const double n = sum.robots;
  for (const RobotReport& r : report.robots) {
    if (r.path.poses == 0) continue;
    sum.path.poses += r.path.poses;
    sum.path.x_m += r.path.x_m / n;
    sum.path.y_m += r.path.y_m / n;
    sum.path.distance_m += r.path.distance_m / n;
    sum.path.rmse_m += r.path.rmse_m / n;
    sum.path.heading_rad += r.path.heading_rad / n;
    sum.path.max_m = std::max(sum.path.max_m, r.path.max_m);
    sum.ate_m += r.ate_m.rmse / n;
    sum.rpe.translation_m.rmse += r.rpe.translation_m.rmse / n;
    sum.rpe.rotation_rad.rmse += r.rpe.rotation_rad.rmse / n;
  }
  return sum;
}

std::string pathTable(const Report& report) {
  std::string text =
      "Paths          poses    x cm   y cm  dist. cm RMSE cm max cm  heading ° ATE cm  RPE cm   RPE °\n";
  for (const RobotReport& r : report.robots) {
    const std::string poses =
        r.frames > 0 ? fmt::format("{}/{}", r.path.poses, r.frames) : std::to_string(r.path.poses);
    text += pathRow(r.name, poses, r.path, r.ate_m.rmse, r.rpe);
    if (!r.has_trajectory) text += fmt::format("  {:<10} has no trajectory in this run\n", "");
  }
  const Overall mean = overall(report);
  for (const RobotReport& r : report.robots) {
    if (!r.dead_reckoning || r.dead_reckoning->poses == 0) continue;
    text += fmt::format("  {:<10} wheels alone {} cm, RMSE {} cm\n", r.name,
                        cell(100.0 * r.dead_reckoning->distance_m, 9, 2),
                        cell(100.0 * r.dead_reckoning->rmse_m, 9, 2));
  }
  if (report.robots.size() > 1)
    text += pathRow("mean", std::to_string(mean.path.poses), mean.path, mean.ate_m, mean.rpe);
  for (const RobotReport& r : report.robots) {
    if (!r.shape_difference) continue;
    text += fmt::format("  {:<10} places: shape difference {:.5f} over {} nodes\n", r.name,
                        *r.shape_difference, r.places);
  }
  return text;
}

/// "localized 96.2 % (0.21 / 0.90 cm, 0.05 / 0.31°)"; without brackets if no pose has truth.
std::string stateText(LocalizationState state, const evaluation::StateMetrics& m) {
  std::string text = fmt::format("{} {:.1f} %", toString(state), 100.0 * m.share);
  if (m.poses > 0)
    text += fmt::format(" ({:.2f} / {:.2f} cm, {:.2f} / {:.2f}°)", 100.0 * m.mean_m, 100.0 * m.max_m,
                        kDegrees * m.mean_heading_rad, kDegrees * m.max_heading_rad);
  return text;
}

std::string eventsText(const std::map<PoseEvent, evaluation::EventMetrics>& events) {
  std::string text;
  double largest_sigmas = 0.0;
  for (const auto& [kind, event] : events) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", toString(kind), event.count);
    largest_sigmas = std::max(largest_sigmas, event.largest_sigmas);
  }
  if (text.empty()) return "none";
  return text + fmt::format(", largest correction {:.1f} σ", largest_sigmas);
}

/// Always lists localized, odometry_only and lost; the other states if they have frames.
std::string stateTable(const Report& report) {
  std::string text;
  for (const RobotReport& r : report.robots) {
    if (!r.localization) continue;
    std::string states;
    for (const auto& [state, metrics] : r.localization->states) {
      const bool is_optional =
          state == LocalizationState::kUnlocated || state == LocalizationState::kRelocalized;
      if (is_optional && metrics.frames == 0) continue;
      states += (states.empty() ? "" : ", ") + stateText(state, metrics);
    }
    if (r.localization->without_state > 0)
      states += fmt::format(", no pose sample {:.1f} %",
                            100.0 * r.localization->without_state / r.localization->frames);
    text += fmt::format("  {:<10} {}; events: {}\n", r.name, states, eventsText(r.localization->events));
  }
  return text.empty() ? "" : "States      share of the frames (mean / max error of their poses)\n" + text;
}

/// Robots with covariances, then all of them combined.
std::vector<std::pair<std::string, evaluation::Consistency>> consistencies(const Report& report) {
  std::vector<std::pair<std::string, evaluation::Consistency>> rows;
  for (const RobotReport& r : report.robots) {
    if (!r.consistency) continue;
    rows.emplace_back(r.name, *r.consistency);
  }
  if (report.consistency) rows.emplace_back("all", *report.consistency);
  return rows;
}

std::string consistencyTable(const Report& report) {
  const auto rows = consistencies(report);
  if (rows.empty()) return {};
  std::string text =
      "Covariances    NEES  x, y   of samples: 95 % bounds  independent samples: 95 % bounds   within 95 %\n";
  for (const auto& [name, c] : rows) {
    const char* verdict = c.consistent()            ? ""
                          : c.mean > c.bounds.upper ? "  over-confident"
                                                    : "  conservative";
    text += fmt::format("  {:<10} {} {} {:>11}: {} – {} {:>19.0f}: {} – {} {} %{}\n", name,
                        cell(c.mean, 6, 2), cell(c.position, 5, 2), c.samples, cell(c.strict.lower, 4, 2),
                        cell(c.strict.upper, 4, 2), c.independent, cell(c.bounds.lower, 4, 2),
                        cell(c.bounds.upper, 5, 2), cell(100.0 * c.inside, 11, 1), verdict);
  }
  const auto isConservative = [](const auto& row) { return row.second.mean < row.second.bounds.lower; };
  if (std::any_of(rows.begin(), rows.end(), isConservative))
    text +=
        "  (conservative: lens or initial poses are more exact than assumed, as in simulation; "
        "docs/methods/evaluation.md)\n";
  return text;
}

std::string kindTable(const evaluation::KindMetrics& kinds) {
  return fmt::format(
      "Kinds       F1 robots {}, obstacles {}   (per object and frame; tracks without a true object: {})\n",
      cell(kinds.robot.f1(), 5, 3), cell(kinds.obstacle.f1(), 5, 3), kinds.phantoms);
}

std::string freeSpaceTable(const evaluation::FreeSpaceMetrics& free) {
  std::string text = fmt::format("Free        {} m², of it in obstacles {}", cell(free.free_m2, 6, 2),
                                 cell(free.in_obstacles_m2, 5, 3));
  if (free.outside_m2) text += fmt::format(", outside the walls {} m²", cell(*free.outside_m2, 6, 2));
  if (free.walls_found)
    text += fmt::format("; walls found along {} %", cell(100.0 * *free.walls_found, 5, 1));
  return text + "\n";
}

Json freeSpaceJson(const evaluation::FreeSpaceMetrics& free) {
  return {{"free_m2", free.free_m2},
          {"in_obstacles_m2", free.in_obstacles_m2},
          {"behind_walls_m2", free.outside_m2.value_or(kNone)},
          {"walls_found", free.walls_found.value_or(kNone)}};
}

/// A share in per cent; a dash for NaN.
std::string percent(double share) {
  return cell(100.0 * share, 0, 1) + " %";
}

/// "96.4 % (obstacles 95.0 %, structure 97.2 %)"
std::string splitShare(const evaluation::CellMetrics& cells, double evaluation::FaceMetrics::*share) {
  return fmt::format("{} (obstacles {}, structure {})", percent(cells.all.*share),
                     percent(cells.obstacles.*share), percent(cells.structure.*share));
}

std::string cellTable(const evaluation::CellMetrics& cells) {
  using evaluation::FaceMetrics;
  return fmt::format(
      "Cells       occupied {}; of these, {} fill known outlines and do not count below\n"
      "            within 1.5 cm of a true face {}, within 2 cm {}\n"
      "            within 5 cm of a true face {}\n"
      "            faces seen within 1.8 m occupied {}\n"
      "            occupied per crossed cell {}; free area wrong {}; floor of the room free {}\n"
      "            mean error of faces seen within 1 m {} cm, of others {} cm; cells on robots {}\n",
      cells.occupied, cells.filled, percent(cells.all.within_1_5cm),
      splitShare(cells, &FaceMetrics::within_2cm), splitShare(cells, &FaceMetrics::within_5cm),
      splitShare(cells, &FaceMetrics::seen_occupied), cell(cells.occupied_per_crossed, 0, 2),
      percent(cells.free_wrong), percent(cells.free_complete), cell(100.0 * cells.near_error_m, 0, 2),
      cell(100.0 * cells.far_error_m, 0, 2), cells.on_robots);
}

Json faceJson(const evaluation::FaceMetrics& faces) {
  return {{"cells", faces.cells},           {"within_1_5cm", faces.within_1_5cm},
          {"within_2cm", faces.within_2cm}, {"within_5cm", faces.within_5cm},
          {"seen_points", faces.seen},      {"seen_occupied", faces.seen_occupied}};
}

Json cellJson(const evaluation::CellMetrics& cells) {
  return {{"occupied", cells.occupied},
          {"inside_outlines", cells.filled},
          {"all", faceJson(cells.all)},
          {"obstacles", faceJson(cells.obstacles)},
          {"structure", faceJson(cells.structure)},
          {"crossed", cells.crossed},
          {"occupied_per_crossed", cells.occupied_per_crossed},
          {"near_error_m", cells.near_error_m},
          {"far_error_m", cells.far_error_m},
          {"on_robots", cells.on_robots},
          {"free", cells.free},
          {"free_wrong", cells.free_wrong},
          {"free_complete", cells.free_complete}};
}

Json statistics(const evaluation::Statistics& s) {
  return {{"count", s.count}, {"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median},
          {"std", s.std},     {"min", s.min},   {"max", s.max}};
}

Json pathJson(const evaluation::PathMetrics& p) {
  return {
      {"poses", p.poses},   {"x_error_m", p.x_m}, {"y_error_m", p.y_m},          {"distance_m", p.distance_m},
      {"rmse_m", p.rmse_m}, {"max_m", p.max_m},   {"heading_rad", p.heading_rad}};
}

Json consistencyJson(const evaluation::Consistency& c) {
  return {{"nees_mean", c.mean},
          {"nees_position", c.position},
          {"samples", c.samples},
          {"bounds_95", {c.strict.lower, c.strict.upper}},
          {"independent_samples", c.independent},
          {"independent_bounds_95", {c.bounds.lower, c.bounds.upper}},
          {"consistent", c.consistent()},
          {"inside_95", c.inside}};
}

Json localizationJson(const evaluation::LocalizationMetrics& m) {
  Json states = Json::object(), events = Json::object();
  for (const auto& [state, s] : m.states) {
    states[toString(state)] = {{"frames", s.frames},
                               {"share", s.share},
                               {"poses", s.poses},
                               {"mean_m", s.mean_m},
                               {"max_m", s.max_m},
                               {"mean_heading_rad", s.mean_heading_rad},
                               {"max_heading_rad", s.max_heading_rad}};
  }
  for (const auto& [kind, event] : m.events)
    events[toString(kind)] = {{"count", event.count}, {"largest_correction_sigmas", event.largest_sigmas}};
  return {{"frames", m.frames}, {"without_state", m.without_state}, {"states", states}, {"events", events}};
}

Json mapJson(const Report& report) {
  const evaluation::MapMetrics& m = *report.map;
  Json matches = Json::array(), missed = Json::array(), drawn = Json::array(), wrong = Json::array();
  for (const evaluation::ObstacleMatch& match : m.matches) {
    matches.push_back({{"truth", report.truth[match.truth].id},
                       {"object", report.objects[match.estimate].id},
                       {"dx_m", match.dx_m},
                       {"dy_m", match.dy_m},
                       {"iou", match.iou}});
  }
  for (const int i : m.missed) missed.push_back(report.truth[i].id);
  for (const int i : m.drawn_as_structure) drawn.push_back(report.truth[i].id);
  for (const int i : m.falsely_found) wrong.push_back(report.objects[i].id);
  return {{"truths", m.truths},
          {"estimates", m.estimates},
          {"matched", m.matches.size()},
          {"recall", m.recall},
          {"precision", m.precision},
          {"x_error_m", m.x_error_m},
          {"y_error_m", m.y_error_m},
          {"iou", m.iou},
          {"distances_error_m", m.distances_error_m},
          {"matches", matches},
          {"missed", missed},
          {"drawn_as_structure", drawn},
          {"false", wrong}};
}

Json robotJson(const RobotReport& r) {
  Json json = pathJson(r.path);
  json["frames"] = r.frames;
  json["outside_truth"] = r.path.outside;
  json["ate_m"] = statistics(r.ate_m);
  json["rpe_translation_m"] = statistics(r.rpe.translation_m);
  json["rpe_rotation_rad"] = statistics(r.rpe.rotation_rad);
  if (r.consistency) json["consistency"] = consistencyJson(*r.consistency);
  if (r.localization) json["localization"] = localizationJson(*r.localization);
  if (r.dead_reckoning) json["dead_reckoning"] = pathJson(*r.dead_reckoning);
  if (r.shape_difference) json["shape_difference"] = *r.shape_difference;
  if (r.shape_difference) json["places"] = r.places;
  return json;
}

Json classJson(const evaluation::ClassCounts& c) {
  return {{"f1", c.f1()}, {"right", c.right}, {"missed", c.missed}, {"wrong", c.wrong}};
}

}  // namespace

std::string table(const Report& report) {
  std::string text;
  if (report.map) text += mapTable(report);
  if (report.space) {
    text += fmt::format(
        "Space       {} voxels above the floor, distance outside the true obstacles: median {}, 90 % within "
        "{}, max {} "
        "cm\n",
        report.space->points, cell(100.0 * report.space->median_m, 4, 1),
        cell(100.0 * report.space->share90_m, 4, 1), cell(100.0 * report.space->max_m, 4, 1));
  }
  if (report.free_space) text += freeSpaceTable(*report.free_space);
  if (report.cells) text += cellTable(*report.cells);
  if (report.landmarks) {
    text +=
        fmt::format("Landmarks   found {} of {}, mean error {} cm, largest {} cm\n", report.landmarks->found,
                    report.landmarks->truths, cell(100.0 * report.landmarks->mean_m, 5, 2),
                    cell(100.0 * report.landmarks->max_m, 5, 2));
  }
  if (report.truth_from_map) {
    const Pose2& moved = *report.truth_from_map;
    text += fmt::format("Frame       the run is aligned to the truth by ({:.3f}, {:.3f}) m, {:.2f}°\n",
                        moved.x_m, moved.y_m, kDegrees * moved.theta_rad);
  }
  if (!report.robots.empty()) text += pathTable(report) + stateTable(report) + consistencyTable(report);
  if (report.kinds) text += kindTable(*report.kinds);
  for (const std::string& warning : report.warnings) text += "warning: " + warning + "\n";
  return text;
}

std::string metricsJson(const Report& report) {
  Json json{{"format", "omnifleet-metrics"}, {"version", 1}};
  if (report.map) json["map"] = mapJson(report);
  if (report.space) {
    json["space"] = {{"voxels", report.space->points},
                     {"outside_median_m", report.space->median_m},
                     {"outside_90_m", report.space->share90_m},
                     {"outside_max_m", report.space->max_m}};
  }
  if (report.free_space) json["free_space"] = freeSpaceJson(*report.free_space);
  if (report.cells) json["cells"] = cellJson(*report.cells);
  if (report.landmarks) {
    json["landmarks"] = {{"truths", report.landmarks->truths},
                         {"found", report.landmarks->found},
                         {"mean_m", report.landmarks->mean_m},
                         {"max_m", report.landmarks->max_m}};
  }
  if (report.truth_from_map) {
    const Eigen::Vector3d moved = report.truth_from_map->vector();
    json["truth_from_map"] = {moved.x(), moved.y(), moved.z()};
  }
  Json paths = Json::object();
  for (const RobotReport& r : report.robots) paths[r.name] = robotJson(r);
  json["paths"] = paths;
  const Overall mean = overall(report);
  json["paths_mean"] = pathJson(mean.path);
  json["paths_mean"]["ate_rmse_m"] = mean.ate_m;
  json["paths_mean"]["robots"] = mean.robots;
  if (const auto rows = consistencies(report); !rows.empty())
    json["paths_mean"]["consistency"] = consistencyJson(rows.back().second);
  if (report.kinds) {
    json["kinds"] = {{"robot", classJson(report.kinds->robot)},
                     {"obstacle", classJson(report.kinds->obstacle)},
                     {"phantoms", report.kinds->phantoms}};
  }
  return json.dump(2) + "\n";
}

}  // namespace omnifleet::evaluate
