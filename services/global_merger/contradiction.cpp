#include "global_merger/contradiction.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace omnifleet::global_merger {

namespace {

constexpr int kManyTimes = 4;
constexpr double kBeyond_m = 0.05;  // m behind the centre; a ray that goes this far has seen the floor there

/// Foot of the camera, map.
Eigen::Vector2d footOf(const occupancy::Contribution& contribution, const Pose2& map_from_base) {
  return map_from_base *
         Eigen::Vector2d(contribution.scan_origin.x_dmm * 1e-4, contribution.scan_origin.y_dmm * 1e-4);
}

/// The ray of a contribution through a point.
struct Ray {
  bool valid = false;
  double beyond_m = 0.0;  ///< range of the ray beyond the point
  bool meets_object = false;
};

Ray rayAlong(const occupancy::Contribution& contribution, const Pose2& map_from_base,
             const Eigen::Vector2d& point) {
  const std::size_t rays = std::min(contribution.range_dmm.size(), contribution.label.size());
  if (rays == 0) return {};
  const Eigen::Vector2d foot(contribution.scan_origin.x_dmm * 1e-4, contribution.scan_origin.y_dmm * 1e-4);
  const Eigen::Vector2d to = map_from_base.inverse() * point - foot;
  const double turns = std::atan2(to.y(), to.x()) / (2.0 * M_PI);
  const auto k = static_cast<std::size_t>(std::lround((turns + 1.0) * static_cast<double>(rays))) % rays;
  return {contribution.label[k] != RayLabel::kInvalid, contribution.range_dmm[k] * 1e-4 - to.norm(),
          k < contribution.object.size() && contribution.object[k] != 0};
}

/// Visits all localized contributions later than one time and up to another.
template <typename Visit>
void forContributions(const occupancy::ContributionStore& store, TimeNs after_ns, TimeNs until_ns,
                      Visit visit) {
  for (const auto& [robot, path] : store.robots()) {
    for (auto it = path.upper_bound(after_ns); it != path.end() && it->first <= until_ns; ++it) {
      const auto& keyframe = it->second;
      if (keyframe.corrected && keyframe.pose && keyframe.pose->valid)
        visit(*keyframe.corrected, keyframe.pose->mapFromBase());
    }
  }
}

/// Distance from its centre to its near side, as seen from the foot.
double beforeCentre(const Group& group, const Eigen::Vector2d& foot_m) {
  const Eigen::Vector2d along = (group.centre_m - foot_m).normalized();
  double before_m = 0.0;
  for (const Eigen::Vector2d& p : group.fit.footprint_m)
    before_m = std::max(before_m, (group.centre_m - p).dot(along));
  return before_m;
}

/// Number of contributions that saw the floor through its centre, later than one time, up to another, and
/// from within a distance.
int timesFloorSeen(const Group& group, const occupancy::ContributionStore& store, TimeNs after_ns,
                   TimeNs until_ns, double within_m) {
  int times = 0;
  forContributions(store, after_ns, until_ns,
                   [&](const occupancy::Contribution& seen, const Pose2& map_from_base) {
                     if ((footOf(seen, map_from_base) - group.centre_m).norm() > within_m) return;
                     const Ray ray = rayAlong(seen, map_from_base, group.centre_m);
                     times += ray.valid && ray.beyond_m > kBeyond_m ? 1 : 0;
                   });
  return times;
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

/// Number of contributions that had its place in plain sight, from not much farther than its views, and did
/// not see it. Nothing occluded it, but it may be a piece of what ends the ray.
/// @param object_too also counts rays that end at another object, not only those that end at a wall
int timesMissed(const Group& group, const occupancy::ContributionStore& store, bool object_too) {
  constexpr double kFarther = 1.5, kBefore_m = 0.25;
  const double within_m = kFarther * usualDistance(group);
  int times = 0;
  for (const auto& [robot, path] : store.robots()) {
    for (const auto& [time_ns, keyframe] : path) {
      if (!keyframe.corrected || !keyframe.pose || !keyframe.pose->valid) continue;
      const bool is_own = std::any_of(group.views.begin(), group.views.end(),
                                      [&, &by = robot, at_ns = time_ns](const ObjectView* v) {
                                        return v->robot == by && v->time_ns == at_ns;
                                      });
      const Pose2 map_from_base = keyframe.pose->mapFromBase();
      const double away_m = (footOf(*keyframe.corrected, map_from_base) - group.centre_m).norm();
      if (is_own || away_m > within_m) continue;
      const Ray ray = rayAlong(*keyframe.corrected, map_from_base, group.centre_m);
      times += ray.valid && ray.beyond_m > -kBefore_m && (object_too || !ray.meets_object) ? 1 : 0;
    }
  }
  return times;
}

/// The σ of its centre is at most this.
bool isWithin(const Group& group, double sigma_m) {
  return group.fit.covariance.diagonal().maxCoeff() <= sigma_m * sigma_m;
}

/// Shape and place are certain.
bool isCertain(const Group& group) {
  constexpr std::size_t kViews = 10;
  constexpr double kSpread = 1.0, kSigma_m = 0.01;
  return group.fit.valid && group.views.size() >= kViews && group.fit.spread <= kSpread &&
         isWithin(group, kSigma_m);
}

/// Very few views, or few views and an inaccurate centre.
bool isUncertain(const Group& group, const MergerOptions& options) {
  constexpr std::size_t kRarely = 10;
  constexpr double kSharp_m = 0.005;
  return group.views.size() < static_cast<std::size_t>(options.gone_after) ||
         (group.views.size() < kRarely && !isWithin(group, kSharp_m));
}

/// Number of contributions later than one time, from within a distance, whose ray ended at its near side or
/// inside it without an object: something is there that was not identified.
int timesRayEnded(const Group& group, const occupancy::ContributionStore& store, TimeNs after_ns,
                  double within_m) {
  constexpr double kBefore_m = 0.1;
  int times = 0;
  forContributions(
      store, after_ns, INT64_MAX, [&](const occupancy::Contribution& seen, const Pose2& map_from_base) {
        const Eigen::Vector2d foot_m = footOf(seen, map_from_base);
        if ((foot_m - group.centre_m).norm() > within_m) return;
        const Ray ray = rayAlong(seen, map_from_base, group.centre_m);
        const double near_side_m = beforeCentre(group, foot_m) + kBefore_m;
        times += ray.valid && !ray.meets_object && ray.beyond_m <= kBeyond_m && ray.beyond_m > -near_side_m
                     ? 1
                     : 0;
      });
  return times;
}

/// Number of views of a candidate, and of contributions that saw the floor through its centre from within the
/// median distance of its views.
struct ViewCounts {
  int views = 0;
  int floor_before = 0, floor_after = 0;  ///< relative to the last view
};

ViewCounts countViews(const Group& group, const occupancy::ContributionStore& store) {
  const TimeNs first_ns = group.views.front()->time_ns, last_ns = group.views.back()->time_ns;
  const double near_m = usualDistance(group);
  return {static_cast<int>(group.views.size()), timesFloorSeen(group, store, first_ns, last_ns, near_m),
          timesFloorSeen(group, store, last_ns, INT64_MAX, near_m)};
}

/// One upright body explains many views within their noise, and its height is well known. Neither the floor
/// nor a shadow or marking on it moves in the image like that.
bool isUpright(const Group& group) {
  constexpr std::size_t kViews = 8;
  constexpr double kRms_m = 0.01, kLeast_m = 0.1, kSigma_m = 0.005;
  const outline::PrismFit& fit = group.fit;
  return fit.valid && group.views.size() >= kViews && fit.rms_m > 0.0 && fit.rms_m <= kRms_m &&
         fit.height_m >= kLeast_m && fit.height_sigma_m > 0.0 && fit.height_sigma_m <= kSigma_m;
}

/// The floor was seen at its place later, more often in a row than the object was missed while it was there.
/// An object of about the floor's colour is missed now and then, and from far away.
bool isGone(const ViewCounts& counts, const MergerOptions& options) {
  constexpr double kClearMissShare = 0.1;  // share of misses for an object that is clearly visible
  const double missed = (counts.floor_before + 1.0) / (counts.floor_before + counts.views + 2.0);
  return counts.floor_after >=
         options.gone_after * std::max(1.0, std::log(kClearMissShare) / std::log(missed));
}

/// Since it was first seen the floor was seen as often, from as near; or from anywhere many times as often;
/// or the candidate is uncertain, and the floor was seen as often, or its place many times as often without
/// it.
bool wasNeverThere(const Group& group, const ViewCounts& counts, const MergerOptions& options,
                   const occupancy::ContributionStore& store) {
  constexpr double kAnywhere_m = std::numeric_limits<double>::infinity();
  const TimeNs first_ns = group.views.front()->time_ns;
  if (isUncertain(group, options) &&
      (timesFloorSeen(group, store, INT64_MIN, INT64_MAX, kAnywhere_m) >= counts.views ||
       timesMissed(group, store, true) >= kManyTimes * counts.views)) {
    return true;
  }
  if (counts.views < options.gone_after) return false;
  return counts.floor_before + counts.floor_after >= counts.views ||
         timesFloorSeen(group, store, first_ns, INT64_MAX, kAnywhere_m) >= kManyTimes * counts.views;
}

}  // namespace

bool isPiece(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store) {
  constexpr std::size_t kRarely = 10;
  constexpr double kBehind_m = 0.1;
  const auto isBehind = [&](const ObjectView* view) {
    const auto* path = store.find(view->robot);
    const auto at = path == nullptr ? decltype(path->end()){} : path->find(view->time_ns);
    if (path == nullptr || at == path->end() || !at->second.corrected) return false;
    const Ray ray = rayAlong(*at->second.corrected, view->prism.map_from_base, group.centre_m);
    const Eigen::Vector2d foot_m = view->prism.map_from_base * view->prism.foot_m;
    return ray.valid && ray.beyond_m < -(beforeCentre(group, foot_m) + kBehind_m);
  };
  const auto isCut = [](const ObjectView* view) { return view->is_cut; };
  const auto views = group.views.size();
  if (views >= kRarely || !std::all_of(group.views.begin(), group.views.end(), isCut)) return false;
  return views < static_cast<std::size_t>(options.min_views) ||
         std::all_of(group.views.begin(), group.views.end(), isBehind);
}

bool isRough(const Group& group, const MergerOptions& options) {
  constexpr std::size_t kRarely = 20;
  return group.views.size() < kRarely && group.fit.rms_m > options.seldom_rms_m;
}

FloorEvidence floorEvidence(const Group& group, const MergerOptions& options,
                            const occupancy::ContributionStore& store) {
  const ViewCounts counts = countViews(group, store);
  if (group.is_top_face)  // the floor is always seen at the place of its sides
    return counts.floor_after >= kManyTimes * counts.views ? FloorEvidence::kAbsent
                                                           : FloorEvidence::kConflicting;
  const bool is_gone = isGone(counts, options);
  if (options.method == "hull") return is_gone ? FloorEvidence::kAbsent : FloorEvidence::kNothing;
  if (!is_gone && (isCertain(group) || !wasNeverThere(group, counts, options, store)))
    return FloorEvidence::kNothing;
  if (!isUpright(group)) return FloorEvidence::kAbsent;
  if (!is_gone) return FloorEvidence::kConflicting;
  const int met = timesRayEnded(group, store, group.views.back()->time_ns, usualDistance(group));
  return counts.floor_after >= kManyTimes * (1 + met) ? FloorEvidence::kAbsent : FloorEvidence::kConflicting;
}

bool isMostlyFloor(const Group& group, const occupancy::ContributionStore& store) {
  const ViewCounts counts = countViews(group, store);
  return counts.floor_before + counts.floor_after >= counts.views;
}

bool isPattern(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store) {
  constexpr double kLow_m = 0.1, kAnywhere_m = std::numeric_limits<double>::infinity();
  const bool is_low = group.fit.height_sigma_m > 0 && group.fit.height_m < kLow_m;
  if (!is_low || options.method == "hull" || isCertain(group)) return false;
  const auto seen = static_cast<int>(group.views.size());
  return timesMissed(group, store, false) >= seen ||
         timesFloorSeen(group, store, INT64_MIN, INT64_MAX, kAnywhere_m) >= seen;
}

}  // namespace omnifleet::global_merger
