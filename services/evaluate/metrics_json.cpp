#include <limits>
#include <nlohmann/json.hpp>

#include "evaluate/report.h"
#include "evaluate/summary.h"

namespace omnifleet::evaluate {
namespace {

using Json = nlohmann::ordered_json;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();  // written as null

Json freeSpaceJson(const evaluation::FreeSpaceMetrics& free) {
  return {{"free_m2", free.free_m2},
          {"in_obstacles_m2", free.in_obstacles_m2},
          {"behind_walls_m2", free.outside_m2.value_or(kNone)},
          {"walls_found", free.walls_found.value_or(kNone)}};
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
  Json sources = Json::object();
  for (const auto& [source, s] : m.sources)
    sources[toString(source)] = {{"used", s.used}, {"rejected", s.rejected}};
  return {{"frames", m.frames},
          {"without_state", m.without_state},
          {"states", states},
          {"events", events},
          {"sources", sources}};
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
  json["shape_difference"] = r.shape_difference.value_or(kNone);
  if (r.places_shape_difference) {
    json["places_shape_difference"] = *r.places_shape_difference;
    json["places"] = r.places;
  }
  if (r.own_frame) json["own_frame_aligned"] = pathJson(*r.own_frame);
  return json;
}

Json classJson(const evaluation::ClassCounts& c) {
  return {{"f1", c.f1()}, {"right", c.right}, {"missed", c.missed}, {"wrong", c.wrong}};
}

}  // namespace

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
  Json frames = Json::object(), paths = Json::object();
  for (const RobotReport& r : report.robots) {
    if (!r.merge) continue;
    frames[r.name] = {{"status", toString(r.merge->status)},
                      {"frame", r.merge->frame},
                      {"score", r.merge->score.value_or(kNone)}};
  }
  if (!frames.empty()) json["frames"] = frames;
  for (const RobotReport& r : report.robots) paths[r.name] = robotJson(r);
  json["paths"] = paths;
  const Overall mean = overall(report);
  json["paths_mean"] = pathJson(mean.path);
  json["paths_mean"]["ate_rmse_m"] = mean.ate_m;
  json["paths_mean"]["shape_difference"] = mean.shape_difference;
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
