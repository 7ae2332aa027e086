#include "global_merger/named_landmarks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

namespace omnifleet::global_merger {
namespace {

constexpr int kVertices = 24, kIterations = 10;
constexpr double kCauchy = 2.0;              // σ at which a view has half the weight
constexpr std::uint64_t kFirstId = 1000000;  // beyond the ids of outlines

struct NamedViews {
  std::vector<Eigen::Vector2d> places_m;  ///< map
  std::vector<double> sigmas_m;
  double radius_m = 0.0;  ///< sum over the views
  std::set<std::string> observers;
};

void addView(const occupancy::Contribution& contribution, const Pose2& map_from_base,
             const occupancy::SupportView& seen, NamedViews& views) {
  const SupportFunction supports = supportsOf(seen);
  if (supports.size() < 3) return;
  const Eigen::Vector2d to = metres(seen.position) - metres(contribution.scan_origin);
  double radius = 0.0, variance = 0.0;
  for (std::size_t k = 0; k < supports.size(); ++k) {
    const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(supports.size());
    radius += supports.b_m[k] - to.dot(Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    variance += static_cast<double>(supports.sigma_m[k]) * supports.sigma_m[k];
  }
  const double n = static_cast<double>(supports.size());
  views.places_m.push_back(map_from_base * metres(seen.position));
  views.sigmas_m.push_back(std::sqrt(variance / n) + 0.02);  // plus the error of the pose
  views.radius_m += radius / n;
  views.observers.insert(contribution.robot);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Vector2d robustMean(const NamedViews& views) {
  std::vector<double> x, y;
  for (const Eigen::Vector2d& p : views.places_m) x.push_back(p.x()), y.push_back(p.y());
  Eigen::Vector2d mean(median(x), median(y));
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Vector2d sum(0, 0);
    double weights = 0.0;
    for (std::size_t v = 0; v < views.places_m.size(); ++v) {
      const double off = (views.places_m[v] - mean).norm() / (kCauchy * views.sigmas_m[v]);
      const double weight = 1.0 / (views.sigmas_m[v] * views.sigmas_m[v] * (1.0 + off * off));
      sum += weight * views.places_m[v];
      weights += weight;
    }
    mean = sum / weights;
  }
  return mean;
}

std::map<std::string, NamedViews> gather(const occupancy::ContributionStore& store) {
  std::map<std::string, NamedViews> all;
  for (const auto& [robot, path] : store.robots()) {
    for (const auto& [time_ns, keyframe] : path) {
      const occupancy::KeyframePose* pose = store.poseOf(keyframe);
      if (!keyframe.corrected || pose == nullptr) continue;
      const Pose2 map_from_base = pose->mapFromBase();
      for (const occupancy::SupportView& seen : keyframe.corrected->views) {
        if (!seen.name.empty()) addView(*keyframe.corrected, map_from_base, seen, all[seen.name]);
      }
    }
  }
  return all;
}

}  // namespace

std::vector<dataset::MapObject> namedLandmarks(const occupancy::ContributionStore& store, int min_views) {
  std::vector<dataset::MapObject> landmarks;
  for (const auto& [name, views] : gather(store)) {
    const auto count = static_cast<int>(views.places_m.size());
    if (count < min_views) continue;
    dataset::MapObject landmark;
    landmark.id = kFirstId + occupancy::digest(name) % kFirstId;
    landmark.name = name;
    landmark.centroid_m = robustMean(views);
    const double radius_m = std::max(0.01, views.radius_m / count);
    for (int k = 0; k < kVertices; ++k) {
      const double phi = 2.0 * M_PI * k / kVertices;
      landmark.outline_m.emplace_back(landmark.centroid_m +
                                      radius_m * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    }
    landmark.observations = count;
    landmark.observers.assign(views.observers.begin(), views.observers.end());
    landmarks.push_back(std::move(landmark));
  }
  return landmarks;
}

}  // namespace omnifleet::global_merger
