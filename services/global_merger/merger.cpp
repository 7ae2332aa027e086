#include "global_merger/merger.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include "global_merger/candidates.h"
#include "global_merger/grouping.h"
#include "global_merger/hull_overlay.h"
#include "global_merger/named_landmarks.h"
#include "global_merger/save.h"
#include "occupancy/robot_paths.h"

namespace omnifleet::global_merger {

MergerOptions MergerOptions::read(const options::Section& section) {
  MergerOptions o;
  section.read("method", o.method, std::vector<std::string>{"prism", "hull"});
  section.read("hull_share", o.hull_share, {0.0, 1.0});
  section.read("observers", o.observers);
  o.prism = outline::PrismOptions::read(section.child("prism"));
  section.read("gate_m", o.gate_m, {0.001, 10.0});
  section.read("min_solidity", o.min_solidity, {0.0, 1.0});
  section.read("robot_rms_m", o.robot_rms_m, {0.0, 1.0});
  section.read("max_contact_m", o.max_contact_m, {0.1, 100.0});
  section.read("robot_gap_m", o.robot_gap_m, {0.0, 10.0});
  section.read("min_views", o.min_views, {1, 1000});
  section.read("max_spread", o.max_spread, {0.5, 1000.0});
  section.read("seldom_rms_m", o.seldom_rms_m, {0.0, 1.0});
  section.read("max_sigma_m", o.max_sigma_m, {0.001, 10.0});
  section.read("flat_m", o.flat_m, {0.0, 1.0});
  section.read("gone_after", o.gone_after, {1, 100000});
  section.finish();
  return o;
}

namespace {

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

/// Did this contribution see farther than a point and so much more, along the ray that passes it?
bool seesAlong(const occupancy::Contribution& contribution, const Pose2& map_from_base,
               const Eigen::Vector2d& point, double beyond_m) {
  const Ray ray = rayAlong(contribution, map_from_base, point);
  return ray.valid && ray.beyond_m > beyond_m;
}

/// The floor was seen through its middle in this many contributions, later than one time and up to another,
/// from this near.
int timesSeenThrough(const Group& group, const occupancy::ContributionStore& store, TimeNs after_ns,
                     TimeNs until_ns, double within_m) {
  constexpr double kBeyond_m = 0.05;
  int times = 0;
  for (const auto& [robot, path] : store.robots()) {
    for (auto it = path.upper_bound(after_ns); it != path.end() && it->first <= until_ns; ++it) {
      const auto& keyframe = it->second;
      if (!keyframe.seen || !keyframe.pose || !keyframe.pose->valid) continue;
      const Pose2 map_from_base = keyframe.pose->mapFromBase();
      if ((footOf(*keyframe.seen, map_from_base) - group.centre_m).norm() > within_m) continue;
      times += seesAlong(*keyframe.seen, map_from_base, group.centre_m, kBeyond_m);
    }
  }
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

/// Seldom seen, and each time cut off: hardly ever, or behind something else. What a wall shows over another
/// thing is a piece of the wall, and goes with the camera.
bool isPiece(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store) {
  constexpr std::size_t kSeldom = 10;
  constexpr double kBehind_m = 0.1;
  const auto isBehind = [&](const ObjectView* view) {
    const auto* path = store.find(view->robot);
    const auto at = path == nullptr ? decltype(path->end()){} : path->find(view->time_ns);
    if (path == nullptr || at == path->end() || !at->second.seen) return false;
    const Ray ray = rayAlong(*at->second.seen, view->prism.map_from_base, group.centre_m);
    const Eigen::Vector2d foot_m = view->prism.map_from_base * view->prism.foot_m;
    const Eigen::Vector2d along = (group.centre_m - foot_m).normalized();
    double before_centre_m = 0.0;  // its near side
    for (const Eigen::Vector2d& p : group.fit.footprint_m)
      before_centre_m = std::max(before_centre_m, (group.centre_m - p).dot(along));
    return ray.valid && ray.beyond_m < -(before_centre_m + kBehind_m);
  };
  const auto isCut = [](const ObjectView* view) { return view->is_cut; };
  const auto views = group.views.size();
  if (views >= kSeldom || !std::all_of(group.views.begin(), group.views.end(), isCut)) return false;
  return views < static_cast<std::size_t>(options.min_views) ||
         std::all_of(group.views.begin(), group.views.end(), isBehind);
}

/// Seldom seen, and nothing upright explains the views well.
bool isRough(const Group& group, const MergerOptions& options) {
  constexpr std::size_t kSeldom = 20;
  return group.views.size() < kSeldom && group.fit.rms_m > options.seldom_rms_m;
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

/// The floor was seen in its place later, more often in a row than it was lost while it was there: a thing of
/// about the floor's colour comes and goes, and is lost from afar.
bool hasGone(const Looks& looks, const MergerOptions& options) {
  constexpr double kSolid = 0.1;  // share of the looks that lose a thing that is plain to see
  const double lost = (looks.before + 1.0) / (looks.before + looks.seen + 2.0);
  return looks.after >= options.gone_after * std::max(1.0, std::log(kSolid) / std::log(lost));
}

/// It has gone, or was never there, which the overlay as printed, §IV.4, does not ask: since it was first
/// seen the floor was as often, from as near; or from anywhere many times as often; or it is doubtful, and
/// the floor was seen as often, or its place many times as often without it.
bool isContradicted(const Group& group, const MergerOptions& options,
                    const occupancy::ContributionStore& store) {
  constexpr int kManyTimes = 4;
  constexpr double kAnywhere_m = std::numeric_limits<double>::infinity();
  const Looks looks = looksAt(group, store);
  if (hasGone(looks, options)) return true;
  if (options.method == "hull" || isCertain(group)) return false;
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

/// No higher than a mark on the floor, as far as can be told.
bool isFlat(const Group& group, const MergerOptions& options) {
  return group.fit.height_sigma_m > 0 && group.fit.height_m + group.fit.height_sigma_m < options.flat_m;
}

/// Low, and in plain sight, or from wherever the floor is seen there, lost as often as it was seen: of tiles
/// and stains another piece shows in every view, and together they look like something low.
bool isPattern(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store) {
  constexpr double kLow_m = 0.1, kAnywhere_m = std::numeric_limits<double>::infinity();
  const bool is_low = group.fit.height_sigma_m > 0 && group.fit.height_m < kLow_m;
  if (!is_low || options.method == "hull" || isCertain(group)) return false;
  const auto seen = static_cast<int>(group.views.size());
  return timesNotSeen(group, store, false) >= seen ||
         timesSeenThrough(group, store, INT64_MIN, INT64_MAX, kAnywhere_m) >= seen;
}

/// A body of the fleet that is not accounted for by any pose fits the views: a robot that publishes nothing.
bool isSilentRobot(const Group& group, const MergerOptions& options,
                   const occupancy::ContributionStore& store,
                   const std::map<std::string, RobotBody>& bodies) {
  std::vector<outline::PrismView> views;
  for (const auto* view : group.views) views.push_back(view->prism);
  return std::any_of(bodies.begin(), bodies.end(), [&](const auto& entry) {
    const auto* path = store.find(entry.first);
    if (path != nullptr && !path->empty()) return false;
    const auto fit = outline::fitBody(views, knownBody(entry.second), options.prism, std::nan(""));
    // Twice as well as the recipe asks: an obstacle may be of about a robot's size.
    return fit.valid && fit.rms_m < 0.5 * options.robot_rms_m;
  });
}

/// 0 inside.
double distanceTo(const Polygon& outline_m, const Eigen::Vector2d& at_m) {
  if (contains(outline_m, at_m)) return 0.0;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < outline_m.size(); ++i) {
    const Eigen::Vector2d &a = outline_m[i], along = outline_m[(i + 1) % outline_m.size()] - a;
    const double share = std::clamp((at_m - a).dot(along) / std::max(1e-12, along.squaredNorm()), 0.0, 1.0);
    nearest = std::min(nearest, (a + share * along - at_m).norm());
  }
  return nearest;
}

std::uint64_t idOf(const Group& group, const std::map<std::string, RobotBody>& bodies,
                   std::set<std::uint64_t>& taken) {
  const ObjectView& first = *group.views.front();
  const auto place =
      static_cast<std::uint64_t>(std::distance(bodies.begin(), bodies.lower_bound(first.robot)));
  std::uint64_t id = (place + 1) * 1000 + first.track_id % 1000;
  while (!taken.insert(id).second) ++id;
  return id;
}

dataset::MapObject objectOf(const Group& group) {
  dataset::MapObject object;
  object.kind = "obstacle";
  object.outline_m = group.fit.footprint_m;
  object.centroid_m = centroid(group.fit.footprint_m);
  object.observations = static_cast<int>(group.views.size());
  std::set<std::string> observers;
  for (const auto* view : group.views) observers.insert(view->robot);
  object.observers.assign(observers.begin(), observers.end());
  constexpr double kVague_m = 0.05;  // else it is mostly what is thought of things before their top is seen
  // Rounded to 0.1 mm, as everything that goes into the fit is.
  const bool is_told = group.fit.height_sigma_m > 0 && group.fit.height_sigma_m < kVague_m;
  if (is_told) object.height_m = std::round(group.fit.height_m * 1e4) * 1e-4;
  return object;
}

}  // namespace

Merger::Merger(const MergerOptions& options, const occupancy::OccupancyOptions& occupancy_options,
               const std::map<std::string, RobotBody>& bodies)
    : options_(options), bodies_(bodies), map_(occupancy_options, bodies) {}

bool Merger::add(const occupancy::Contribution& contribution) {
  const bool changed = map_.add(contribution);
  is_stale_ = is_stale_ || changed;
  return changed;
}

bool Merger::add(const occupancy::KeyframePose& pose) {
  const bool changed = map_.add(pose);
  is_stale_ = is_stale_ || changed;
  return changed;
}

bool Merger::correctSome(std::size_t at_most) {
  const bool changed = map_.correctSome(at_most);
  is_stale_ = is_stale_ || changed;
  return changed;
}

void Merger::addTrajectory(const PoseEstimate& pose) {
  if (!pose.valid || !pose.map_from_base.isFinite()) return;
  auto& path = trajectories_[pose.robot];
  const auto after =
      std::upper_bound(path.begin(), path.end(), pose.acquired_ns,
                       [](TimeNs time_ns, const dataset::StampedPose& p) { return time_ns < p.time_ns; });
  // Causal: the first estimate of a time stays.
  if (after != path.begin() && std::prev(after)->time_ns == pose.acquired_ns) return;
  auto& covariances = covariances_[pose.robot];
  covariances.insert(covariances.begin() + (after - path.begin()),
                     {pose.acquired_ns, pose.covariance, pose.datum});
  path.insert(after, {pose.acquired_ns, pose.map_from_base});
}

bool Merger::isOneThing(const Group& group) const {
  if (!group.fit.valid || group.fit.spread > options_.max_spread) return false;
  const Eigen::Vector2d sigma = group.fit.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return sigma.maxCoeff() <= options_.max_sigma_m;
}

bool Merger::isObject(const Group& group) const {
  if (!isOneThing(group)) return false;
  if (options_.method != "hull" && (isPiece(group, options_, map_.store()) || isRough(group, options_)))
    return false;
  if (!finished_ && static_cast<int>(group.views.size()) < options_.min_views) return false;
  if (group.kind == ObjectKind::kUnknown &&
      (!finished_ || isSilentRobot(group, options_, map_.store(), bodies_))) {
    return false;
  }
  return !isFlat(group, options_) && !isPattern(group, options_, map_.store()) &&
         !isContradicted(group, options_, map_.store());
}

/// Why it is no object, where people should know; nothing where the floor contradicts what is no one thing
/// anyway.
std::optional<Unmapped::Why> Merger::whyUnmapped(const Group& group) const {
  if (isObject(group) || static_cast<int>(group.views.size()) < options_.min_views) return std::nullopt;
  if (isSilentRobot(group, options_, map_.store(), bodies_)) return std::nullopt;
  const bool is_flat = isFlat(group, options_);
  if (isContradicted(group, options_, map_.store())) {
    if (is_flat || !isOneThing(group)) return std::nullopt;
    return Unmapped::Why::kFloorSeen;
  }
  const bool is_mark = is_flat || isPattern(group, options_, map_.store());
  return is_mark ? Unmapped::Why::kFlat : Unmapped::Why::kNoShape;
}

/// Not told are pieces of what is mapped, and of robots: nothing stands where one drove.
void Merger::findUnmapped(const std::vector<Group>& groups) {
  constexpr double kPiece_m = 0.2, kSame_m = 0.3;
  const auto isNear = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, double within_m) {
    return (a - b).squaredNorm() < within_m * within_m;
  };
  for (const Group& group : groups) {
    const auto why = whyUnmapped(group);
    if (!why) continue;
    const Eigen::Vector2d& at_m = group.centre_m;
    const bool is_told = std::any_of(unmapped_.begin(), unmapped_.end(), [&](const Unmapped& other) {
      return isNear(other.at_m, at_m, kSame_m);
    });
    const bool is_mapped = std::any_of(
        outlines_.begin(), outlines_.end(),
        [&](const dataset::MapObject& object) { return distanceTo(object.outline_m, at_m) < kPiece_m; });
    const bool is_way = std::any_of(trajectories_.begin(), trajectories_.end(), [&](const auto& trajectory) {
      return std::any_of(trajectory.second.begin(), trajectory.second.end(), [&](const auto& pose) {
        return isNear(pose.map_from_base.translation(), at_m, kPiece_m);
      });
    });
    if (!is_told && !is_mapped && !is_way) unmapped_.push_back({at_m, *why});
  }
}

const std::vector<dataset::MapObject>& Merger::outlines(const Meanwhile& meanwhile) {
  if (!is_stale_) return outlines_;
  is_stale_ = false;
  const auto candidates = candidatesOf(map_.store(), options_, bodies_, meanwhile);
  outlines_.clear();
  kinds_.clear();
  std::set<std::uint64_t> taken;
  const auto groups = options_.method == "hull" ? overlayHulls(candidates, options_)
                                                : groupViews(candidates, options_, meanwhile);
  for (const auto& group : groups) {
    if (!isObject(group)) continue;
    outlines_.push_back(objectOf(group));
    outlines_.back().id = idOf(group, bodies_, taken);
    for (const auto* view : group.views) kinds_[{view->robot, view->track_id}] = ObjectKind::kObstacle;
  }
  unmapped_.clear();
  if (finished_ && options_.method != "hull") findUnmapped(groups);
  for (dataset::MapObject& landmark : namedLandmarks(map_.store(), options_.min_views)) {
    while (!taken.insert(landmark.id).second) ++landmark.id;
    outlines_.push_back(std::move(landmark));
  }
  std::sort(outlines_.begin(), outlines_.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return outlines_;
}

void Merger::finish() {
  finished_ = is_stale_ = true;
  map_.judge({});  // what an earlier end decided must not weigh on this one
  outlines();
  map_.judge(kinds_);
}

std::vector<std::string> Merger::save(const std::string& folder) {
  outlines();
  return saveMap(*this, folder);
}

std::vector<std::string> Merger::saveAsFitted(const std::string& folder) const {
  return saveMap(*this, folder);
}

}  // namespace omnifleet::global_merger
