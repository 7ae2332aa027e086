#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "evaluate/report.h"
#include "evaluate/summary.h"

namespace omnifleet::evaluate {
namespace {

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

/// Which robots are in the common map. Empty for a run that does not say.
std::string frameTable(const Report& report) {
  std::string text;
  for (const RobotReport& r : report.robots) {
    if (!r.merge) continue;
    text += fmt::format("  {:<10} {}{}{}{}\n", r.name, toString(r.merge->status),
                        r.isInItsOwnFrame() ? ", in its own frame" : "",
                        r.merge->score ? fmt::format(", score {:.2f}", *r.merge->score) : "",
                        r.merge->reason.empty() ? "" : ": " + r.merge->reason);
  }
  return text.empty() ? "" : "Frames\n" + text;
}

std::string pathRow(const std::string& name, const std::string& poses, const evaluation::PathMetrics& p,
                    double ate_m, const evaluation::RelativeError& rpe, double shape_difference) {
  return fmt::format("  {:<10} {:>9} {} {} {} {} {} {} {} {} {} {}\n", name, poses, cell(100.0 * p.x_m, 6, 2),
                     cell(100.0 * p.y_m, 6, 2), cell(100.0 * p.distance_m, 9, 2),
                     cell(100.0 * p.rmse_m, 7, 2), cell(100.0 * p.max_m, 6, 2),
                     cell(kDegrees * p.heading_rad, 10, 3), cell(100.0 * ate_m, 7, 2),
                     cell(100.0 * rpe.translation_m.rmse, 7, 3), cell(kDegrees * rpe.rotation_rad.rmse, 7, 3),
                     cell(shape_difference, 9, 6));
}

std::string pathTable(const Report& report) {
  std::string text =
      "Paths          poses    x cm   y cm  dist. cm RMSE cm max cm  heading ° ATE cm  RPE cm   RPE °     "
      "shape\n";
  for (const RobotReport& r : report.robots) {
    const std::string poses =
        r.frames > 0 ? fmt::format("{}/{}", r.path.poses, r.frames) : std::to_string(r.path.poses);
    text += pathRow(r.name, poses, r.path, r.ate_m.rmse, r.rpe, r.shape_difference.value_or(kNone));
    if (r.own_frame) {
      text += fmt::format(
          "  {:<10} in its own frame, {} poses after rigid alignment: {} cm, RMSE {} cm, max {} cm\n", "",
          r.own_frame->poses, cell(100.0 * r.own_frame->distance_m, 0, 2),
          cell(100.0 * r.own_frame->rmse_m, 0, 2), cell(100.0 * r.own_frame->max_m, 0, 2));
    } else if (!r.has_trajectory) {
      text += fmt::format("  {:<10} has no trajectory in this run\n", "");
    }
  }
  const Overall mean = overall(report);
  for (const RobotReport& r : report.robots) {
    if (!r.dead_reckoning || r.dead_reckoning->poses == 0) continue;
    text += fmt::format("  {:<10} wheels alone {} cm, RMSE {} cm\n", r.name,
                        cell(100.0 * r.dead_reckoning->distance_m, 9, 2),
                        cell(100.0 * r.dead_reckoning->rmse_m, 9, 2));
  }
  if (report.robots.size() > 1)
    text += pathRow("mean", std::to_string(mean.path.poses), mean.path, mean.ate_m, mean.rpe,
                    mean.shape_difference);
  for (const RobotReport& r : report.robots) {
    if (!r.places_shape_difference) continue;
    text += fmt::format("  {:<10} places: shape difference {:.5f} over {} nodes\n", r.name,
                        *r.places_shape_difference, r.places);
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

/// Empty if no row of the run names a source, as those of older versions.
std::string sourceTable(const Report& report) {
  std::string text;
  for (const RobotReport& r : report.robots) {
    if (!r.localization || r.localization->sources.empty()) continue;
    std::string sources;
    for (const auto& [source, m] : r.localization->sources) {
      sources += fmt::format("{}{} {:.1f} %", sources.empty() ? "" : ", ", toString(source), 100.0 * m.used);
      if (m.rejected > 0.0) sources += fmt::format(" (rejected {:.1f} %)", 100.0 * m.rejected);
    }
    text += fmt::format("  {:<10} {}\n", r.name, sources);
  }
  return text.empty() ? "" : "Sources     share of the frames whose poses rest on them\n" + text;
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
  text += frameTable(report);
  if (!report.robots.empty())
    text += pathTable(report) + stateTable(report) + sourceTable(report) + consistencyTable(report);
  if (report.kinds) text += kindTable(*report.kinds);
  for (const std::string& warning : report.warnings) text += "warning: " + warning + "\n";
  return text;
}

}  // namespace omnifleet::evaluate
