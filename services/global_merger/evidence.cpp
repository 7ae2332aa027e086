#include "global_merger/evidence.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include "global_merger/map_warnings.h"

namespace omnifleet::global_merger {
namespace {

constexpr double kBeyond_m = 0.05;  // m behind the centre; a ray that goes this far has seen the floor there

/// The ray of a contribution through a point.
struct Ray {
  bool valid = false;
  double beyond_m = 0.0;  ///< range of the ray beyond the point
  bool meets_object = false;
  bool shows_floor = false;  ///< up to its end
};

Ray rayAlong(const occupancy::Contribution& contribution, const Pose2& map_from_base,
             const Eigen::Vector2d& point) {
  const std::size_t rays = std::min(contribution.range_dmm.size(), contribution.label.size());
  if (rays == 0) return {};
  const Eigen::Vector2d to = map_from_base.inverse() * point - occupancy::metres(contribution.scan_origin);
  const double turns = std::atan2(to.y(), to.x()) / (2.0 * M_PI);
  const auto k = static_cast<std::size_t>(std::lround((turns + 1.0) * static_cast<double>(rays))) % rays;
  return {contribution.label[k] != RayLabel::kInvalid,
          contribution.range_dmm[k] / occupancy::kDmmPerMetre - to.norm(),
          k < contribution.object.size() && contribution.object[k] != 0,
          (contribution.label[k] != RayLabel::kUnknown && contribution.label[k] != RayLabel::kBeyond) ||
              (k < contribution.object.size() && contribution.object[k] != 0)};
}

/// Distance from its centre to its near side, as seen from the foot.
double beforeCentre(const Group& group, const Eigen::Vector2d& foot_m) {
  const Eigen::Vector2d along = (group.centre_m - foot_m).normalized();
  double before_m = 0.0;
  for (const Eigen::Vector2d& p : group.fit.footprint_m)
    before_m = std::max(before_m, (group.centre_m - p).dot(along));
  return before_m;
}

/// Median distance of its views.
double usualDistance(const Group& group) {
  std::vector<double> away_m;
  for (const auto* view : group.views)
    away_m.push_back((view->prism.map_from_base * view->prism.foot_m - group.centre_m).norm());
  const auto middle = away_m.begin() + static_cast<std::ptrdiff_t>(away_m.size() / 2);
  std::nth_element(away_m.begin(), middle, away_m.end());
  return *middle;
}

/// Counts the rays of all contributions at the group's place.
void countRays(const Group& group, const occupancy::ContributionStore& store, Evidence& evidence) {
  constexpr double kFarther = 1.5, kBefore_m = 0.25, kSide_m = 0.1;
  const double near_m = usualDistance(group);
  const TimeNs first_ns = group.views.front()->time_ns, last_ns = group.views.back()->time_ns;
  std::set<std::pair<std::string, TimeNs>> own;
  for (const ObjectView* view : group.views) own.emplace(view->robot, view->time_ns);
  for (const auto& [robot, path] : store.robots()) {
    for (const auto& [time_ns, keyframe] : path) {
      const occupancy::KeyframePose* pose = store.poseOf(keyframe);
      if (!keyframe.corrected || pose == nullptr) continue;
      const occupancy::Contribution& seen = *keyframe.corrected;
      const Pose2 map_from_base = pose->mapFromBase();
      const Ray ray = rayAlong(seen, map_from_base, group.centre_m);
      if (!ray.valid) continue;
      const Eigen::Vector2d foot_m = map_from_base * occupancy::metres(seen.scan_origin);
      const double away_m = (foot_m - group.centre_m).norm();
      const bool is_floor = ray.shows_floor && ray.beyond_m > kBeyond_m, is_near = away_m <= near_m;
      evidence.floor_ever += is_floor ? 1 : 0;
      evidence.floor_since_first += is_floor && time_ns > first_ns ? 1 : 0;
      evidence.floor_before += is_floor && is_near && time_ns > first_ns && time_ns <= last_ns ? 1 : 0;
      evidence.floor_after += is_floor && is_near && time_ns > last_ns ? 1 : 0;
      if (ray.beyond_m > -kBefore_m && away_m <= kFarther * near_m && own.count({robot, time_ns}) == 0) {
        ++evidence.missed;
        evidence.missed_by_walls += ray.meets_object ? 0 : 1;
      }
      if (time_ns > last_ns && is_near && !ray.meets_object && !is_floor &&
          ray.beyond_m > -(beforeCentre(group, foot_m) + kSide_m))
        ++evidence.ended_after;
    }
  }
}

/// Whether the ray of each view ended at something nearer.
bool isAlwaysBehind(const Group& group, const occupancy::ContributionStore& store) {
  constexpr double kBehind_m = 0.1;
  return std::all_of(group.views.begin(), group.views.end(), [&](const ObjectView* view) {
    const auto* keyframe = store.find(view->robot, view->time_ns);
    if (keyframe == nullptr || !keyframe->corrected) return false;
    const Ray ray = rayAlong(*keyframe->corrected, view->prism.map_from_base, group.centre_m);
    const Eigen::Vector2d foot_m = view->prism.map_from_base * view->prism.foot_m;
    return ray.valid && ray.beyond_m < -(beforeCentre(group, foot_m) + kBehind_m);
  });
}

/// Share of its outline that faced a camera, at less than 80° from the surface normal.
double facedShare(const Group& group) {
  constexpr double kStep_m = 0.02, kLeastCosine = 0.17;
  const Polygon& outline_m = group.fit.footprint_m;
  std::vector<Eigen::Vector2d> cameras_m;
  for (const ObjectView* view : group.views)
    cameras_m.push_back(view->prism.map_from_base * view->prism.foot_m);
  int all = 0, faced = 0;
  for (std::size_t i = 0; i < outline_m.size(); ++i) {
    const Eigen::Vector2d& a = outline_m[i];
    const Eigen::Vector2d along = outline_m[(i + 1) % outline_m.size()] - a;
    const Eigen::Vector2d outward = Eigen::Vector2d(along.y(), -along.x()).normalized();
    const int steps = std::max(1, static_cast<int>(std::ceil(along.norm() / kStep_m)));
    for (int k = 0; k < steps; ++k) {
      const Eigen::Vector2d at_m = a + along * ((k + 0.5) / steps);
      ++all;
      faced += std::any_of(cameras_m.begin(), cameras_m.end(), [&](const Eigen::Vector2d& camera_m) {
        return outward.dot((camera_m - at_m).normalized()) > kLeastCosine;
      });
    }
  }
  return all > 0 ? faced / static_cast<double>(all) : 0.0;
}

}  // namespace

Evidence evidenceOf(const Group& group, const occupancy::ContributionStore& store) {
  Evidence e;
  e.views = static_cast<int>(group.views.size());
  for (const ObjectView* view : group.views) {
    e.cut_views += view->is_cut ? 1 : 0;
    e.flawed_views += view->is_flawed ? 1 : 0;
  }
  e.from_camera = group.views.front()->prism.camera_height_m > 0.0;
  e.kind = group.kind;
  e.is_top_face = group.is_top_face;
  e.always_behind = isAlwaysBehind(group, store);
  e.has_shape = group.fit.valid;
  e.spread = group.fit.spread;
  e.rms_m = group.fit.rms_m;
  const Eigen::Matrix2d& covariance = group.fit.covariance;
  const double mean = 0.5 * covariance.trace(), difference = 0.5 * (covariance(0, 0) - covariance(1, 1));
  e.sigma_m = std::sqrt(std::max(0.0, mean + std::hypot(difference, covariance(0, 1))));  // larger axis
  e.height_m = group.fit.height_m;
  e.height_sigma_m = group.fit.height_sigma_m;
  e.is_thin = e.has_shape && isSliver(group.fit.footprint_m);
  if (e.has_shape) e.faced = facedShare(group);
  countRays(group, store, e);
  return e;
}

}  // namespace omnifleet::global_merger
