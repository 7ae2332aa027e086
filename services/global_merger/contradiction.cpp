#include "global_merger/contradiction.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace omnifleet::global_merger {

namespace {

constexpr int kManyTimes = 4;
constexpr double kBeyond_m = 0.05;  // its middle, from which the floor was seen there

/// The foot of the camera, map.
Eigen::Vector2d footOf(const occupancy::Contribution& contribution, const Pose2& map_from_base) {
  return map_from_base *
         Eigen::Vector2d(contribution.scan_origin.x_dmm * 1e-4, contribution.scan_origin.y_dmm * 1e-4);
}

/// The ray of a contribution that passes a point.
struct Ray {
  bool valid = false;
  double beyond_m = 0.0;  ///< that it was seen farther
  bool meets_thing = false;
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

/// All that are located, later than one time and up to another.
template <typename Visit>
void forContributions(const occupancy::ContributionStore& store, TimeNs after_ns, TimeNs until_ns,
                      Visit visit) {
  for (const auto& [robot, path] : store.robots()) {
    for (auto it = path.upper_bound(after_ns); it != path.end() && it->first <= until_ns; ++it) {
      const auto& keyframe = it->second;
      if (keyframe.seen && keyframe.pose && keyframe.pose->valid)
        visit(*keyframe.seen, keyframe.pose->mapFromBase());
    }
  }
}

/// From its centre to its near side, seen from there.
double beforeCentre(const Group& group, const Eigen::Vector2d& foot_m) {
  const Eigen::Vector2d along = (group.centre_m - foot_m).normalized();
  double before_m = 0.0;
  for (const Eigen::Vector2d& p : group.fit.footprint_m)
    before_m = std::max(before_m, (group.centre_m - p).dot(along));
  return before_m;
}

/// The floor was seen through its middle in this many contributions, later than one time and up to another,
/// from this near.
int timesSeenThrough(const Group& group, const occupancy::ContributionStore& store, TimeNs after_ns,
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

/// From how far it has been seen: half of its views are from farther.
double usualDistance(const Group& group) {
  std::vector<double> away_m;
  for (const auto* view : group.views)
    away_m.push_back((view->prism.map_from_base * view->prism.foot_m - group.centre_m).norm());
  const auto middle = away_m.begin() + static_cast<std::ptrdiff_t>(away_m.size() / 2);
  std::nth_element(away_m.begin(), middle, away_m.end());
  return *middle;
}

/// Contributions that had its place in plain sight, from not much farther than it was seen, and did not see
/// it: nothing hid it, though it may be a piece of what ends the ray.
/// @param thing_too that may be another thing, not only a wall
int timesNotSeen(const Group& group, const occupancy::ContributionStore& store, bool thing_too) {
  constexpr double kFarther = 1.5, kBefore_m = 0.25;
  const double within_m = kFarther * usualDistance(group);
  int times = 0;
  for (const auto& [robot, path] : store.robots()) {
    for (const auto& [time_ns, keyframe] : path) {
      if (!keyframe.seen || !keyframe.pose || !keyframe.pose->valid) continue;
      const bool is_own = std::any_of(group.views.begin(), group.views.end(),
                                      [&, &by = robot, at_ns = time_ns](const ObjectView* v) {
                                        return v->robot == by && v->time_ns == at_ns;
                                      });
      const Pose2 map_from_base = keyframe.pose->mapFromBase();
      const double away_m = (footOf(*keyframe.seen, map_from_base) - group.centre_m).norm();
      if (is_own || away_m > within_m) continue;
      const Ray ray = rayAlong(*keyframe.seen, map_from_base, group.centre_m);
      times += ray.valid && ray.beyond_m > -kBefore_m && (thing_too || !ray.meets_thing) ? 1 : 0;
    }
  }
  return times;
}

/// What its views agree on stands within so much, one σ.
bool isWithin(const Group& group, double sigma_m) {
  return group.fit.covariance.diagonal().maxCoeff() <= sigma_m * sigma_m;
}

/// Shape and place are beyond doubt.
bool isCertain(const Group& group) {
  constexpr std::size_t kViews = 10;
  constexpr double kSpread = 1.0, kSigma_m = 0.01;
  return group.fit.valid && group.views.size() >= kViews && group.fit.spread <= kSpread &&
         isWithin(group, kSigma_m);
}

/// Seen hardly at all; or seldom, and not sharply.
bool isDoubtful(const Group& group, const MergerOptions& options) {
  constexpr std::size_t kSeldom = 10;
  constexpr double kSharp_m = 0.005;
  return group.views.size() < static_cast<std::size_t>(options.gone_after) ||
         (group.views.size() < kSeldom && !isWithin(group, kSharp_m));
}

/// Contributions later than one time whose view ended at its near side or in it, from this near: something
/// is there, be it that they could not tell what.
int timesMet(const Group& group, const occupancy::ContributionStore& store, TimeNs after_ns,
             double within_m) {
  constexpr double kBefore_m = 0.1;
  int times = 0;
  forContributions(
      store, after_ns, INT64_MAX, [&](const occupancy::Contribution& seen, const Pose2& map_from_base) {
        const Eigen::Vector2d foot_m = footOf(seen, map_from_base);
        if ((foot_m - group.centre_m).norm() > within_m) return;
        const Ray ray = rayAlong(seen, map_from_base, group.centre_m);
        const double near_side_m = beforeCentre(group, foot_m) + kBefore_m;
        times +=
            ray.valid && !ray.meets_thing && ray.beyond_m <= kBeyond_m && ray.beyond_m > -near_side_m ? 1 : 0;
      });
  return times;
}

/// How often something was seen, and the floor through its middle: from as near as half of its views are.
struct Looks {
  int seen = 0;
  int before = 0, after = 0;  ///< its last view
};

Looks looksAt(const Group& group, const occupancy::ContributionStore& store) {
  const TimeNs first_ns = group.views.front()->time_ns, last_ns = group.views.back()->time_ns;
  const double near_m = usualDistance(group);
  return {static_cast<int>(group.views.size()), timesSeenThrough(group, store, first_ns, last_ns, near_m),
          timesSeenThrough(group, store, last_ns, INT64_MAX, near_m)};
}

/// One upright body explains many views to what their noise is, and they tell its height: neither the floor
/// nor a shadow or a mark on it moves in the picture as that does.
bool isUpright(const Group& group) {
  constexpr std::size_t kViews = 8;
  constexpr double kRms_m = 0.01, kLeast_m = 0.1, kSigma_m = 0.005;
  const outline::PrismFit& fit = group.fit;
  return fit.valid && group.views.size() >= kViews && fit.rms_m > 0.0 && fit.rms_m <= kRms_m &&
         fit.height_m >= kLeast_m && fit.height_sigma_m > 0.0 && fit.height_sigma_m <= kSigma_m;
}

/// The floor was seen in its place later, more often in a row than it was lost while it was there: a thing of
/// about the floor's colour comes and goes, and is lost from afar.
bool hasGone(const Looks& looks, const MergerOptions& options) {
  constexpr double kSolid = 0.1;  // share of the looks that lose a thing that is plain to see
  const double lost = (looks.before + 1.0) / (looks.before + looks.seen + 2.0);
  return looks.after >= options.gone_after * std::max(1.0, std::log(kSolid) / std::log(lost));
}

/// Since it was first seen the floor was as often, from as near; or from anywhere many times as often; or it
/// is doubtful, and the floor was seen as often, or its place many times as often without it.
bool wasNeverThere(const Group& group, const Looks& looks, const MergerOptions& options,
                   const occupancy::ContributionStore& store) {
  constexpr double kAnywhere_m = std::numeric_limits<double>::infinity();
  const TimeNs first_ns = group.views.front()->time_ns;
  if (isDoubtful(group, options) &&
      (timesSeenThrough(group, store, INT64_MIN, INT64_MAX, kAnywhere_m) >= looks.seen ||
       timesNotSeen(group, store, true) >= kManyTimes * looks.seen)) {
    return true;
  }
  if (looks.seen < options.gone_after) return false;
  return looks.before + looks.after >= looks.seen ||
         timesSeenThrough(group, store, first_ns, INT64_MAX, kAnywhere_m) >= kManyTimes * looks.seen;
}

}  // namespace

bool isPiece(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store) {
  constexpr std::size_t kSeldom = 10;
  constexpr double kBehind_m = 0.1;
  const auto isBehind = [&](const ObjectView* view) {
    const auto* path = store.find(view->robot);
    const auto at = path == nullptr ? decltype(path->end()){} : path->find(view->time_ns);
    if (path == nullptr || at == path->end() || !at->second.seen) return false;
    const Ray ray = rayAlong(*at->second.seen, view->prism.map_from_base, group.centre_m);
    const Eigen::Vector2d foot_m = view->prism.map_from_base * view->prism.foot_m;
    return ray.valid && ray.beyond_m < -(beforeCentre(group, foot_m) + kBehind_m);
  };
  const auto isCut = [](const ObjectView* view) { return view->is_cut; };
  const auto views = group.views.size();
  if (views >= kSeldom || !std::all_of(group.views.begin(), group.views.end(), isCut)) return false;
  return views < static_cast<std::size_t>(options.min_views) ||
         std::all_of(group.views.begin(), group.views.end(), isBehind);
}

bool isRough(const Group& group, const MergerOptions& options) {
  constexpr std::size_t kSeldom = 20;
  return group.views.size() < kSeldom && group.fit.rms_m > options.seldom_rms_m;
}

FloorSays floorSays(const Group& group, const MergerOptions& options,
                    const occupancy::ContributionStore& store) {
  const Looks looks = looksAt(group, store);
  if (group.is_top)  // the floor is seen in the place of its sides all the time
    return looks.after >= kManyTimes * looks.seen ? FloorSays::kNotThere : FloorSays::kLess;
  const bool has_gone = hasGone(looks, options);
  if (options.method == "hull") return has_gone ? FloorSays::kNotThere : FloorSays::kNothing;
  if (!has_gone && (isCertain(group) || !wasNeverThere(group, looks, options, store)))
    return FloorSays::kNothing;
  if (!isUpright(group)) return FloorSays::kNotThere;
  if (!has_gone) return FloorSays::kLess;
  const int met = timesMet(group, store, group.views.back()->time_ns, usualDistance(group));
  return looks.after >= kManyTimes * (1 + met) ? FloorSays::kNotThere : FloorSays::kLess;
}

bool isMostlyFloor(const Group& group, const occupancy::ContributionStore& store) {
  const Looks looks = looksAt(group, store);
  return looks.before + looks.after >= looks.seen;
}

bool isPattern(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store) {
  constexpr double kLow_m = 0.1, kAnywhere_m = std::numeric_limits<double>::infinity();
  const bool is_low = group.fit.height_sigma_m > 0 && group.fit.height_m < kLow_m;
  if (!is_low || options.method == "hull" || isCertain(group)) return false;
  const auto seen = static_cast<int>(group.views.size());
  return timesNotSeen(group, store, false) >= seen ||
         timesSeenThrough(group, store, INT64_MIN, INT64_MAX, kAnywhere_m) >= seen;
}

}  // namespace omnifleet::global_merger
