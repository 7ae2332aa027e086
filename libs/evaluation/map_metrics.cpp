#include "evaluation/map_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluation/assignment.h"
#include "evaluation/overlap.h"

namespace omnifleet::evaluation {
namespace {

constexpr double kNoPairs = std::numeric_limits<double>::quiet_NaN();
using Objects = std::vector<dataset::MapObject>;

std::vector<int> obstacles(const Objects& objects) {
  std::vector<int> indices;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (objects[i].kind == "obstacle") indices.push_back(static_cast<int>(i));
  }
  return indices;
}

/// Centroid of the polygon itself, which the metric compares, not the centroid property of the file.
Eigen::Vector2d centre(const dataset::MapObject& object) {
  return centroid(object.outline_m);
}

/// Pairwise centroid distances; +inf beyond the gate or below the required overlap. Also fills `iou`.
Eigen::MatrixXd costs(const Objects& truth, const Objects& estimate, const std::vector<int>& t,
                      const std::vector<int>& e, const MapOptions& options, Eigen::MatrixXd& iou) {
  const auto rows = static_cast<Eigen::Index>(t.size()), columns = static_cast<Eigen::Index>(e.size());
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(rows, columns, std::numeric_limits<double>::infinity());
  iou = Eigen::MatrixXd::Zero(rows, columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j) {
      const dataset::MapObject &a = truth[t[i]], &b = estimate[e[j]];
      const double distance_m = (centre(a) - centre(b)).norm();
      if (!(distance_m <= options.gate_m)) continue;
      iou(i, j) = intersectionOverUnion(a.outline_m, b.outline_m);
      if (iou(i, j) >= options.min_iou) cost(i, j) = distance_m;
    }
  }
  return cost;
}

/// Whether enough of the outline of a true obstacle lies at lines of kind "structure".
bool isDrawnAsStructure(const dataset::MapObject& truth, const Objects& estimate) {
  constexpr double kStep_m = 0.02, kNear_m = 0.05, kLeastShare = 0.2;
  int points = 0, near = 0;
  for (std::size_t i = 0; i < truth.outline_m.size(); ++i) {
    const Eigen::Vector2d& a = truth.outline_m[i];
    const Eigen::Vector2d side = truth.outline_m[(i + 1) % truth.outline_m.size()] - a;
    const int steps = std::max(1, static_cast<int>(side.norm() / kStep_m));
    for (int k = 0; k < steps; ++k, ++points) {
      const Eigen::Vector2d at = a + side * (k / static_cast<double>(steps));
      near += std::any_of(estimate.begin(), estimate.end(),
                          [&](const dataset::MapObject& object) {
                            return object.kind == "structure" && object.distanceTo(at) <= kNear_m;
                          })
                  ? 1
                  : 0;
    }
  }
  return near >= kLeastShare * points;
}

double distancesError(const Objects& truth, const Objects& estimate,
                      const std::vector<ObstacleMatch>& matches) {
  double sum = 0.0;
  int pairs = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    for (std::size_t j = i + 1; j < matches.size(); ++j, ++pairs) {
      const double true_m = (centre(truth[matches[i].truth]) - centre(truth[matches[j].truth])).norm();
      const double got_m =
          (centre(estimate[matches[i].estimate]) - centre(estimate[matches[j].estimate])).norm();
      sum += std::abs(got_m - true_m);
    }
  }
  return pairs > 0 ? sum / pairs : kNoPairs;
}

void averages(MapMetrics& m) {
  const double n = static_cast<double>(m.matches.size());
  m.recall = m.truths > 0 ? n / m.truths : 1.0;
  m.precision = m.estimates > 0 ? n / m.estimates : 1.0;
  m.x_error_m = m.y_error_m = m.iou = n > 0.0 ? 0.0 : kNoPairs;
  for (const ObstacleMatch& match : m.matches) {
    m.x_error_m += std::abs(match.dx_m) / n;
    m.y_error_m += std::abs(match.dy_m) / n;
    m.iou += match.iou / n;
  }
}

}  // namespace

MapOptions MapOptions::read(const options::Section& section) {
  MapOptions options;
  section.read("gate_m", options.gate_m, options::kPositive);
  section.read("min_iou", options.min_iou, {0.0, 1.0});
  section.finish();
  return options;
}

MapMetrics compareMaps(const Objects& truth, const Objects& estimate, const MapOptions& options) {
  const std::vector<int> t = obstacles(truth), e = obstacles(estimate);
  Eigen::MatrixXd iou;
  const std::vector<int> partner = assign(costs(truth, estimate, t, e, options, iou));
  MapMetrics metrics;
  metrics.truths = static_cast<int>(t.size());
  metrics.estimates = static_cast<int>(e.size());
  std::vector<bool> used(e.size(), false);
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (partner[i] < 0) {
      metrics.missed.push_back(t[i]);
      if (isDrawnAsStructure(truth[t[i]], estimate)) metrics.drawn_as_structure.push_back(t[i]);
      continue;
    }
    const int j = partner[i];
    used[j] = true;
    const Eigen::Vector2d d = centre(estimate[e[j]]) - centre(truth[t[i]]);
    metrics.matches.push_back({t[i], e[j], d.x(), d.y(), iou(static_cast<Eigen::Index>(i), j)});
  }
  for (std::size_t j = 0; j < e.size(); ++j) {
    if (!used[j]) metrics.falsely_found.push_back(e[j]);
  }
  averages(metrics);
  metrics.distances_error_m = distancesError(truth, estimate, metrics.matches);
  return metrics;
}

}  // namespace omnifleet::evaluation
