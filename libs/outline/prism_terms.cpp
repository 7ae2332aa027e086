#include "outline/prism_terms.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "outline/half_planes.h"

namespace omnifleet::outline::detail {
namespace {

bool isUsable(const PrismView& view) {
  return view.supports.size() >= 3 && view.camera_height_m >= 0 && view.map_from_base.isFinite() &&
         view.foot_m.allFinite();
}

void appendView(const PrismView& view, int index, double noise_m, Terms& terms) {
  const Eigen::Vector2d foot = view.map_from_base * view.foot_m;
  for (int k = 0; k < terms.directions; ++k) {
    const double angle = 2.0 * M_PI * k / terms.directions;
    const auto value = view.supports.at(angle - view.map_from_base.theta_rad);
    Term term;
    if (std::isfinite(value.b_m)) {
      term.a = terms.normals[static_cast<std::size_t>(k)].dot(foot) + value.b_m;
      term.b = view.perHeight(value.b_m);
      term.sigma = std::max(value.sigma_m, 0.1 * noise_m);
    }
    terms.term.push_back(term);
  }
  terms.view.push_back(index);
  terms.top_faces_only = terms.top_faces_only || view.top_face_only;
  terms.camera_height_m.push_back(view.camera_height_m);
}

/// Sector of the camera's foot as seen from the centre of its silhouette, and the information in the view.
std::pair<int, double> sectorAndScore(const Terms& terms, std::size_t v, int sectors) {
  Eigen::Vector2d away = Eigen::Vector2d::Zero(), facing = Eigen::Vector2d::Zero();
  double score = 0.0;
  for (int k = 0; k < terms.directions; ++k) {
    const Term& term = terms.at(v, k);
    if (term.sigma <= 0) continue;
    score += 1.0 / (term.sigma * term.sigma);
    if (term.b > 0) away += term.b * terms.normals[static_cast<std::size_t>(k)];
    facing += terms.normals[static_cast<std::size_t>(k)];
  }
  if (!(terms.camera_height_m[v] > 0)) away = -facing;  // a laser sees only the sides that face it
  const double turn = (std::atan2(away.y(), away.x()) + M_PI) / (2.0 * M_PI);
  return {std::min(static_cast<int>(turn * sectors), sectors - 1), score};
}

}  // namespace

double Terms::sigmaAt(std::size_t v, int k, double height_m, double noise_m) const {
  const Term& t = at(v, k);
  const double scale = t.b != 0 ? std::max(1.0 - height_m / camera_height_m[v], 0.05) : 1.0;
  return std::hypot(t.sigma * scale, noise_m);
}

double lowestCamera(const Terms& terms) {
  double lowest = 0.0;
  for (const double height_m : terms.camera_height_m) {
    if (height_m > 0 && (lowest <= 0 || height_m < lowest)) lowest = height_m;
  }
  return lowest;
}

Terms termsOf(const std::vector<PrismView>& views, int directions, double noise_m) {
  Terms terms;
  terms.directions = directions;
  for (int k = 0; k < directions; ++k) {
    const double angle = 2.0 * M_PI * k / directions;
    terms.normals.emplace_back(std::cos(angle), std::sin(angle));
  }
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (isUsable(views[v])) appendView(views[v], static_cast<int>(v), noise_m, terms);
  }
  return terms;
}

Terms mostInformative(const Terms& terms, const std::vector<PrismView>& views, std::size_t count) {
  if (terms.views() <= count) return terms;
  constexpr int kSectors = 24;
  std::vector<std::vector<std::pair<double, std::size_t>>> sectors(kSectors);
  for (std::size_t v = 0; v < terms.views(); ++v) {
    const auto [sector, score] = sectorAndScore(terms, v, kSectors);
    sectors[static_cast<std::size_t>(sector)].emplace_back(-score, v);
  }
  std::vector<std::size_t> chosen;
  for (auto& sector : sectors) std::sort(sector.begin(), sector.end());
  for (std::size_t round = 0; chosen.size() < count; ++round) {
    for (const auto& sector : sectors) {
      if (round < sector.size() && chosen.size() < count) chosen.push_back(sector[round].second);
    }
  }
  std::sort(chosen.begin(), chosen.end());
  std::vector<PrismView> kept(views.size());  // the other views stay empty and are omitted
  for (const std::size_t v : chosen) {
    const auto index = static_cast<std::size_t>(terms.view[v]);
    kept[index] = views[index];
  }
  return termsOf(kept, terms.directions, 0.0);
}

double widestGap(const std::vector<DirectionEvidence>& evidence) {
  const std::size_t n = evidence.size();
  std::size_t run = 0, widest = 0;
  for (std::size_t k = 0; k < 2 * n; ++k) {
    run = evidence[k % n].sigma_m > 0 ? 0 : run + 1;
    widest = std::max(widest, run);
  }
  if (widest >= n) return 2.0 * M_PI;
  return 2.0 * M_PI * static_cast<double>(widest + 1) / static_cast<double>(n);
}

double supportOf(const Polygon& polygon, const Eigen::Vector2d& normal) {
  double best = -std::numeric_limits<double>::infinity();
  for (const auto& p : polygon) best = std::max(best, normal.dot(p));
  return best;
}

Polygon polygonOf(const std::vector<DirectionEvidence>& evidence) {
  std::vector<HalfPlane> planes;
  std::vector<double> measured, weight;
  for (std::size_t k = 0; k < evidence.size(); ++k) {
    if (evidence[k].sigma_m <= 0) continue;
    const double angle = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(evidence.size());
    planes.push_back({{std::cos(angle), std::sin(angle)}, evidence[k].support_m});
    measured.push_back(evidence[k].support_m);
    weight.push_back(1.0 / (evidence[k].sigma_m * evidence[k].sigma_m));
  }
  Polygon polygon;
  // Noise makes some half-planes cut off parts that belong to others. The weighted mean deficit is added
  // back.
  for (int round = 0; round < 3; ++round) {
    polygon = intersectHalfPlanes(planes);
    if (polygon.empty()) break;
    double deficit = 0.0, sum = 0.0;
    for (std::size_t i = 0; i < planes.size(); ++i) {
      deficit += weight[i] * (measured[i] - supportOf(polygon, planes[i].normal));
      sum += weight[i];
    }
    for (auto& plane : planes) plane.offset_m += deficit / sum;
  }
  return polygon;
}

HeightPrior heightByTangents(const Terms& terms, std::size_t v) {
  // Curvature of a support function, h(φ − δ) + h(φ + δ) − 2 cos δ·h(φ) ≥ 0, summed around each sign change
  // of b(n): the curvature of a must be at least h times that of b.
  const int n = terms.directions;
  const double two_cos = 2.0 * std::cos(2.0 * M_PI / n);
  constexpr int kReach = 3;
  HeightPrior found;
  int tangents = 0;
  for (int k = 0; k < n; ++k) {
    const bool starts = (terms.at(v, k).b > 0) != (terms.at(v, (k + 1) % n).b > 0);
    if (!starts) continue;
    double curve_a = 0.0, curve_b = 0.0, variance = 0.0;
    bool usable = true;
    for (int j = k - kReach; j <= k + 1 + kReach; ++j) {
      const Term &left = terms.at(v, (j - 1 + n) % n), &mid = terms.at(v, (j + n) % n),
                 &right = terms.at(v, (j + 1 + n) % n);
      usable = usable && left.sigma > 0 && mid.sigma > 0 && right.sigma > 0;
      curve_a += left.a + right.a - two_cos * mid.a;
      curve_b += left.b + right.b - two_cos * mid.b;
      variance = std::max(variance, 4.0 * mid.sigma * mid.sigma);
    }
    if (!usable || curve_b <= 0) continue;
    const double height = curve_a / curve_b, sigma = std::sqrt(variance) / curve_b;
    ++tangents;
    if (tangents == 1 || height < found.height_m) found = {height, sigma};
  }
  return tangents == 2 ? found : HeightPrior{};
}

double weightedMedian(std::vector<std::pair<double, double>>& values) {
  std::sort(values.begin(), values.end());
  double total = 0.0, below = 0.0;
  for (const auto& value : values) total += value.second;
  for (std::size_t i = 0; i < values.size(); ++i) {
    below += values[i].second;
    if (below > 0.5 * total) return values[i].first;
    if (below == 0.5 * total && i + 1 < values.size()) return 0.5 * (values[i].first + values[i + 1].first);
  }
  return values.empty() ? 0.0 : values.back().first;
}

}  // namespace omnifleet::outline::detail
