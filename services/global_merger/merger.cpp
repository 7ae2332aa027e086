#include "global_merger/merger.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <set>

#include "global_merger/candidates.h"
#include "global_merger/contradiction.h"
#include "global_merger/floor_markings.h"
#include "global_merger/grouping.h"
#include "global_merger/hull_overlay.h"
#include "global_merger/named_landmarks.h"
#include "global_merger/save.h"
#include "global_merger/unlisted_robots.h"

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

bool isOftenSeen(const Group& group) {
  constexpr std::size_t kViews = 10;
  return group.views.size() >= kViews;
}

/// The views fit the body of a fleet robot of which nothing has been received: a robot that publishes
/// nothing.
bool isSilentFleetRobot(const Group& group, const MergerOptions& options,
                        const occupancy::ContributionStore& store,
                        const std::map<std::string, RobotBody>& bodies) {
  std::vector<outline::PrismView> views;
  for (const auto* view : group.views) views.push_back(view->prism);
  return std::any_of(bodies.begin(), bodies.end(), [&](const auto& entry) {
    const auto* path = store.find(entry.first);
    if (path != nullptr && !path->empty()) return false;
    const auto fit = outline::fitBody(views, knownBody(entry.second), options.prism, std::nan(""));
    // Twice as strict as robot_rms_m: an obstacle may have about a robot's size.
    return fit.valid && fit.rms_m < 0.5 * options.robot_rms_m;
  });
}

/// The views disagree, or disagree slightly and hardly ever show the candidate alone. In the latter case the
/// outline may belong to a neighbour, or to the half of it that differs from the floor.
bool isDisagreeing(const Group& group) {
  constexpr double kShare = 0.8, kAgree = 0.7, kDisagree = 1.5;  // share of the views; spreads in σ
  if (!(group.views.front()->prism.camera_height_m > 0.0)) return false;
  const auto flawed = std::count_if(group.views.begin(), group.views.end(),
                                    [](const ObjectView* view) { return view->is_flawed; });
  const bool is_seldom_seen = static_cast<double>(flawed) >= kShare * static_cast<double>(group.views.size());
  return group.fit.spread > (is_seldom_seen ? kAgree : kDisagree);
}

/// Its height, from the parallax of its points, is surely above 8 cm.
bool isTall(const Group& group) {
  constexpr double kLeast_m = 0.08, kSigmas = 3.0;
  return group.fit.height_sigma_m > 0 && group.fit.height_m - kSigmas * group.fit.height_sigma_m > kLeast_m;
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
  constexpr double kVague_m =
      0.05;  // m, with a larger σ the height is mostly the prior for objects whose top was not seen
  // Rounded to 0.1 mm, like all inputs of the fit.
  const bool is_known = group.fit.height_sigma_m > 0 && group.fit.height_sigma_m < kVague_m;
  if (is_known) object.height_m = std::round(group.fit.height_m * 1e4) * 1e-4;
  return object;
}

/// Where a row of this time belongs in rows in order of time. Empty if there is a row of this time.
template <typename Row>
std::optional<std::ptrdiff_t> freePlace(const std::vector<Row>& rows, TimeNs time_ns) {
  const auto after = std::upper_bound(rows.begin(), rows.end(), time_ns,
                                      [](TimeNs time, const Row& row) { return time < row.time_ns; });
  if (after != rows.begin() && std::prev(after)->time_ns == time_ns) return std::nullopt;
  return after - rows.begin();
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
  auto& states = localization_[pose.robot];
  if (const auto place = freePlace(states, pose.acquired_ns))
    states.insert(states.begin() + *place,
                  {pose.acquired_ns, pose.state, pose.event, pose.correction_sigmas});
  if (!pose.valid || !pose.map_from_base.isFinite()) return;
  auto& path = trajectories_[pose.robot];
  const auto place = freePlace(path, pose.acquired_ns);
  if (!place) return;
  auto& covariances = covariances_[pose.robot];
  covariances.insert(covariances.begin() + *place, {pose.acquired_ns, pose.covariance, pose.datum});
  path.insert(path.begin() + *place, {pose.acquired_ns, pose.map_from_base});
}

bool Merger::isOneObject(const Group& group) const {
  if (!group.fit.valid || group.fit.spread > options_.max_spread) return false;
  const Eigen::Vector2d sigma = group.fit.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return sigma.maxCoeff() <= options_.max_sigma_m;
}

bool Merger::isObject(const Group& group) const {
  if (!isOneObject(group)) return false;
  if (options_.method != "hull" && (isPiece(group, options_, map_.store()) || isRough(group, options_)))
    return false;
  if (!finished_ && static_cast<int>(group.views.size()) < options_.min_views) return false;
  if (group.kind == ObjectKind::kUnknown &&
      (!finished_ || isSilentFleetRobot(group, options_, map_.store(), bodies_))) {
    return false;
  }
  return !isFlat(group, options_) && !isPattern(group, options_, map_.store()) &&
         floorEvidence(group, options_, map_.store()) != FloorEvidence::kAbsent;
}

/// Reason why a candidate is not an object, if it is to be reported. Not reported are robots, candidates with
/// few views, and candidates contradicted by the floor that are flat, or have no single shape and were rarely
/// seen, or have no single shape and no height and were seen less often than the floor.
std::optional<RejectedCandidate::Reason> Merger::rejectionReason(const Group& group) const {
  if (isObject(group) || static_cast<int>(group.views.size()) < options_.min_views) return std::nullopt;
  if (isSilentFleetRobot(group, options_, map_.store(), bodies_)) return std::nullopt;
  const bool is_flat = isFlat(group, options_);
  if (floorEvidence(group, options_, map_.store()) == FloorEvidence::kAbsent) {
    if (is_flat || (!isOneObject(group) && !isOftenSeen(group))) return std::nullopt;
    if (isOneObject(group) || !isMostlyFloor(group, map_.store()))
      return RejectedCandidate::Reason::kFloorSeen;
    return isTall(group) ? std::optional(RejectedCandidate::Reason::kTopFaceOnly) : std::nullopt;
  }
  const bool is_floor_marking = is_flat || isPattern(group, options_, map_.store());
  return is_floor_marking ? RejectedCandidate::Reason::kFlat : RejectedCandidate::Reason::kNoShape;
}

/// Whether a robot drove within this distance.
bool Merger::wasDrivenAt(const Eigen::Vector2d& at_m, double within_m) const {
  return std::any_of(trajectories_.begin(), trajectories_.end(), [&](const auto& trajectory) {
    return std::any_of(trajectory.second.begin(), trajectory.second.end(), [&](const auto& pose) {
      return (pose.map_from_base.translation() - at_m).squaredNorm() < within_m * within_m;
    });
  });
}

/// Pieces of mapped objects are not reported, nor are places where a robot drove, because no obstacle is
/// there. Top faces come last, because their places are the least accurate.
void Merger::findRejected(const std::vector<Group>& groups) {
  constexpr double kPiece_m = 0.2, kSame_m = 0.3;
  const auto isNear = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, double within_m) {
    return (a - b).squaredNorm() < within_m * within_m;
  };
  std::vector<RejectedCandidate> found;
  for (const Group& group : groups)
    if (const auto reason = rejectionReason(group)) found.push_back({group.centre_m, *reason});
  std::stable_partition(found.begin(), found.end(), [](const RejectedCandidate& place) {
    return place.reason != RejectedCandidate::Reason::kTopFaceOnly;
  });
  for (const RejectedCandidate& place : found) {
    const Eigen::Vector2d& at_m = place.at_m;
    const bool is_listed =
        std::any_of(rejected_.begin(), rejected_.end(),
                    [&](const RejectedCandidate& other) { return isNear(other.at_m, at_m, kSame_m); });
    const bool is_mapped = std::any_of(
        outlines_.begin(), outlines_.end(),
        [&](const dataset::MapObject& object) { return distanceTo(object.outline_m, at_m) < kPiece_m; });
    if (!is_listed && !is_mapped && !wasDrivenAt(at_m, kPiece_m)) rejected_.push_back(place);
  }
}

/// Rays that end in a floor marking hit no obstacle, whatever the kind of their track: the floor continues
/// there.
void Merger::findFloorMarkings(const std::vector<Group>& groups) {
  std::vector<Polygon> markings_m;
  std::set<std::pair<std::string, std::uint16_t>> upright;
  for (const Group& group : groups) {
    if (isFloorMarking(group, options_)) markings_m.push_back(group.fit.footprint_m);
    if (isFlat(group, options_)) continue;
    for (const ObjectView* view : group.views)
      upright.emplace(view->robot, static_cast<std::uint16_t>(view->track_id));
  }
  for (const auto& track : tracksOfFloorMarkings(markings_m, map_.store()))
    if (upright.count(track) == 0) kinds_[track] = ObjectKind::kUnknown;
}

/// Adds objects of which only the top face is segmented, and removes the groups whose views they explain.
/// None is added where a robot drove.
void Merger::addTopFaces(const std::vector<Candidate>& candidates, const Meanwhile& meanwhile,
                         std::vector<Group>& groups) const {
  std::vector<Group> whole;
  std::copy_if(groups.begin(), groups.end(), std::back_inserter(whole),
               [&](const Group& group) { return isObject(group); });
  constexpr double kWay_m = 0.1;
  std::vector<Group> tops = groupTopFaces(candidates, whole, options_, meanwhile);
  tops.erase(
      std::remove_if(tops.begin(), tops.end(),
                     [&](const Group& top) { return !isObject(top) || wasDrivenAt(top.centre_m, kWay_m); }),
      tops.end());
  std::set<const ObjectView*> explained;
  for (const Group& top : tops) explained.insert(top.views.begin(), top.views.end());
  const auto isExplained = [&](const Group& group) {
    return std::all_of(group.views.begin(), group.views.end(),
                       [&](const ObjectView* view) { return explained.count(view) > 0; });
  };
  groups.erase(std::remove_if(groups.begin(), groups.end(), isExplained), groups.end());
  std::move(tops.begin(), tops.end(), std::back_inserter(groups));
}

const std::vector<dataset::MapObject>& Merger::outlines(const Meanwhile& meanwhile) {
  if (!is_stale_) return outlines_;
  is_stale_ = false;
  auto candidates = candidatesOf(map_.store(), options_, bodies_, meanwhile);
  outlines_.clear();
  low_contrast_m_.clear();
  disagreeing_m_.clear();
  kinds_.clear();
  findUnlistedRobots(candidates);
  const auto obstacles = std::stable_partition(
      candidates.begin(), candidates.end(), [](const Candidate& c) { return c.kind == ObjectKind::kRobot; });
  for (auto robot = candidates.begin(); robot != obstacles; ++robot)
    kinds_[{robot->robot, robot->track_id}] = ObjectKind::kRobot;
  candidates.erase(candidates.begin(), obstacles);
  std::set<std::uint64_t> taken;
  auto groups = options_.method == "hull" ? overlayHulls(candidates, options_)
                                          : groupViews(candidates, options_, meanwhile);
  if (finished_ && options_.method != "hull") addTopFaces(candidates, meanwhile, groups);
  for (const auto& group : groups) {
    if (!isObject(group)) continue;
    outlines_.push_back(objectOf(group));
    outlines_.back().id = idOf(group, bodies_, taken);
    if (finished_ && floorEvidence(group, options_, map_.store()) == FloorEvidence::kConflicting)
      low_contrast_m_.push_back(outlines_.back().centroid_m);
    else if (finished_ && options_.method != "hull" && isDisagreeing(group))
      disagreeing_m_.push_back(outlines_.back().centroid_m);
    for (const auto* view : group.views) kinds_[{view->robot, view->track_id}] = ObjectKind::kObstacle;
  }
  if (finished_) findFloorMarkings(groups);
  rejected_.clear();
  if (finished_ && options_.method != "hull") findRejected(groups);
  for (dataset::MapObject& landmark : namedLandmarks(map_.store(), options_.min_views)) {
    while (!taken.insert(landmark.id).second) ++landmark.id;
    outlines_.push_back(std::move(landmark));
  }
  std::sort(outlines_.begin(), outlines_.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return outlines_;
}

void Merger::finish() {
  finished_ = is_stale_ = true;
  map_.overrideKinds({});  // decisions of an earlier finish() must not influence this one
  outlines();
  map_.overrideKinds(kinds_);
}

std::vector<std::string> Merger::save(const std::string& folder) {
  outlines();
  return saveMap(*this, folder);
}

std::vector<std::string> Merger::saveAsFitted(const std::string& folder) const {
  return saveMap(*this, folder);
}

}  // namespace omnifleet::global_merger
