#include "global_merger/merger.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <set>

#include "global_merger/candidates.h"
#include "global_merger/evidence.h"
#include "global_merger/floor_markings.h"
#include "global_merger/grouping.h"
#include "global_merger/hull_overlay.h"
#include "global_merger/named_landmarks.h"
#include "global_merger/outline_cells.h"
#include "global_merger/save.h"
#include "global_merger/structure_objects.h"
#include "global_merger/unlisted_robots.h"
#include "global_merger/verdict.h"

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
  section.read("hidden_cells", o.hidden_cells);
  section.read("gone_after", o.gone_after, {1, 100000});
  section.read("least_alone", o.least_alone, {0.0, 1.0});
  section.read("least_seen", o.least_seen, {0.0, 1.0});
  o.structure = structure::PolylineOptions::read(section.child("structure"));
  section.finish();
  return o;
}

namespace {

bool hasPose(const std::string& robot, const occupancy::ContributionStore& store) {
  const auto* path = store.find(robot);
  return path != nullptr && std::any_of(path->begin(), path->end(), [&](const auto& entry) {
           return store.poseOf(entry.second) != nullptr;
         });
}

/// The views fit the body of a fleet robot that has no pose in this map: it publishes nothing, or its poses
/// are in another frame. It may stand anywhere.
bool isSilentFleetRobot(const Group& group, const MergerOptions& options,
                        const occupancy::ContributionStore& store,
                        const std::map<std::string, RobotBody>& bodies) {
  std::vector<outline::PrismView> views;
  for (const auto* view : group.views) views.push_back(view->prism);
  return std::any_of(bodies.begin(), bodies.end(), [&](const auto& entry) {
    if (hasPose(entry.first, store)) return false;
    const auto fit = outline::fitBody(views, knownBody(entry.second), options.prism, std::nan(""));
    // Twice as strict as robot_rms_m: an obstacle may have about a robot's size.
    return fit.valid && fit.rms_m < 0.5 * options.robot_rms_m;
  });
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

dataset::MapObject objectOf(const Group& group, const Verdict& verdict) {
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
  object.covariance_m2 = group.fit.covariance;
  object.quality = qualityOf(verdict);
  return object;
}

bool standsThere(const Verdict& verdict) {
  return verdict.decision == Decision::kObstacle || verdict.decision == Decision::kStructure;
}

/// Reasons that claim floor. Where the map is occupied at the place, there is nothing to warn of.
bool isFloorReason(Reason reason) {
  return reason == Reason::kFlat || reason == Reason::kPattern || reason == Reason::kFloorSeen;
}

bool isShapeReason(Reason reason) {
  return reason == Reason::kNoShape || reason == Reason::kUncertainPlace;
}

/// Structure that goes on farther than any candidate is large: the candidate is a piece of it.
bool reachesBeyond(const dataset::MapObject& structure, const Eigen::Vector2d& at_m) {
  constexpr double kBeyond_m = 0.6;
  return std::any_of(structure.outline_m.begin(), structure.outline_m.end(),
                     [&](const Eigen::Vector2d& p) { return (p - at_m).norm() > kBeyond_m; });
}

}  // namespace

Merger::Merger(const MergerOptions& options, const occupancy::OccupancyOptions& occupancy_options,
               const std::map<std::string, RobotBody>& bodies, std::string frame)
    : options_(options), bodies_(bodies), map_(occupancy_options, bodies, std::move(frame)) {}

dataset::OccupancyGrid Merger::grid(const std::vector<dataset::MapObject>& objects) const {
  dataset::OccupancyGrid grid = map_.grid(objects);
  if (!options_.hidden_cells) return grid;
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      auto& cell = grid.cells[static_cast<std::size_t>(y * grid.width + x)];
      const auto counted = map_.at(grid.origin_m + grid.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5));
      if (counted == occupancy::CellClass::kOccupied) cell = 100;
      if (counted == occupancy::CellClass::kFree && cell < 0) cell = 0;
    }
  }
  return grid;
}

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

std::optional<std::string> Merger::frameOf(const std::string& robot) const {
  auto latest = trajectories_.latest(robot);
  const auto* path = map_.store().find(robot);
  if (path != nullptr) {
    const auto keyframe = std::find_if(path->rbegin(), path->rend(), [](const auto& entry) {
      return entry.second.pose && entry.second.pose->valid;
    });
    if (keyframe != path->rend() && (!latest || keyframe->first >= latest->first))
      latest = {keyframe->first, keyframe->second.pose->frame};
  }
  if (!latest) return std::nullopt;
  return latest->second;
}

/// Verdicts of all groups.
std::vector<Verdict> Merger::judge(const std::vector<Group>& groups) const {
  constexpr double kWay_m = 0.1;
  std::vector<Evidence> evidence;
  std::vector<Verdict> verdicts;
  for (const Group& group : groups) {
    Evidence& e = evidence.emplace_back(evidenceOf(group, map_.store()));
    if (finished_) e.fits_silent_robot = isSilentFleetRobot(group, options_, map_.store(), bodies_);
    e.was_driven_at = wasDrivenAt(group.centre_m, kWay_m);
    e.is_mirrored = options_.method != "hull" && map_.visible().isMirrored(group.centre_m);
    verdicts.push_back(verdictOf(e, options_, finished_));
  }
  if (options_.method == "hull") return verdicts;
  // What stands against an obstacle is explained by it, until that turns out to be no obstacle.
  const structure::SurfaceMap& cells = map_.visible();
  for (bool changed = true; changed;) {
    changed = false;
    std::vector<Polygon> outlines_m;
    for (std::size_t i = 0; i < groups.size(); ++i)
      outlines_m.push_back(verdicts[i].decision == Decision::kObstacle ? groups[i].fit.footprint_m
                                                                       : Polygon{});
    const std::vector<OutlineCells> around = cellsAt(outlines_m, cells);
    for (std::size_t i = 0; i < groups.size(); ++i) {
      if (verdicts[i].decision != Decision::kObstacle) continue;
      evidence[i].seen = around[i].seen;
      evidence[i].alone = around[i].alone;
      verdicts[i] = verdictOf(evidence[i], options_, finished_);
      changed = changed || verdicts[i].decision != Decision::kObstacle;
    }
  }
  return verdicts;
}

/// Whether a robot drove within this distance.
bool Merger::wasDrivenAt(const Eigen::Vector2d& at_m, double within_m) const {
  return std::any_of(driven_m_.begin(), driven_m_.end(), [&](const Eigen::Vector2d& p) {
    return (p - at_m).squaredNorm() < within_m * within_m;
  });
}

/// Pieces of mapped objects are not reported, nor pieces of structure, nor are places where a robot drove,
/// because no obstacle is there. Top faces come last, because their places are the least accurate.
void Merger::findRejected(const std::vector<Group>& groups, const std::vector<Verdict>& verdicts) {
  constexpr double kPiece_m = 0.2, kSame_m = 0.3;
  const auto isNear = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, double within_m) {
    return (a - b).squaredNorm() < within_m * within_m;
  };
  rejected_.clear();
  if (options_.method == "hull") return;
  for (const structure::PossibleMirror& mirror : map_.visible().mirrors)
    rejected_.push_back({mirror.middle(), Reason::kPossibleMirror, 0});
  std::vector<RejectedCandidate> found;
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (verdicts[i].to_report)
      found.push_back({groups[i].centre_m, verdicts[i].reason, static_cast<int>(groups[i].views.size())});
  std::stable_partition(found.begin(), found.end(),
                        [](const RejectedCandidate& place) { return place.reason != Reason::kTopFaceOnly; });
  for (const RejectedCandidate& place : found) {
    const Eigen::Vector2d& at_m = place.at_m;
    const bool is_listed =
        std::any_of(rejected_.begin(), rejected_.end(),
                    [&](const RejectedCandidate& other) { return isNear(other.at_m, at_m, kSame_m); });
    const bool is_mapped =
        std::any_of(outlines_.begin(), outlines_.end(), [&](const dataset::MapObject& object) {
          if (object.distanceTo(at_m) >= kPiece_m) return false;
          return !object.isOpen() || isShapeReason(place.reason) || reachesBeyond(object, at_m);
        });
    if (isFloorReason(place.reason) && map_.visible().cellAt(at_m) == structure::Cell::kOccupied) continue;
    if (!is_listed && !is_mapped && !wasDrivenAt(at_m, kPiece_m)) rejected_.push_back(place);
  }
}

/// Rays that end in a floor marking hit no obstacle, whatever the kind of their track: the floor continues
/// there.
void Merger::findFloorMarkings(const std::vector<Group>& groups, const std::vector<Verdict>& verdicts) {
  std::vector<Polygon> markings_m;
  std::set<std::pair<std::string, std::uint16_t>> upright;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (verdicts[i].decision == Decision::kFloorMarking) markings_m.push_back(groups[i].fit.footprint_m);
    if (verdicts[i].is_flat) continue;
    for (const ObjectView* view : groups[i].views)
      upright.emplace(view->robot, static_cast<std::uint16_t>(view->track_id));
  }
  for (const auto& track : tracksOfFloorMarkings(markings_m, map_.store()))
    if (upright.count(track) == 0) kinds_[track] = ObjectKind::kUnknown;
}

/// Adds objects of which only the top face is segmented, and removes the groups whose views they explain.
void Merger::addTopFaces(const std::vector<Candidate>& candidates, const Meanwhile& meanwhile,
                         std::vector<Group>& groups) const {
  std::vector<Group> whole;
  const std::vector<Verdict> verdicts = judge(groups);
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (standsThere(verdicts[i])) whole.push_back(groups[i]);
  std::vector<Group> tops = groupTopFaces(candidates, whole, options_, meanwhile);
  const std::vector<Verdict> of_tops = judge(tops);
  std::set<const ObjectView*> explained;
  std::vector<Group> kept;
  for (std::size_t i = 0; i < tops.size(); ++i) {
    if (!standsThere(of_tops[i])) continue;
    explained.insert(tops[i].views.begin(), tops[i].views.end());
    kept.push_back(std::move(tops[i]));
  }
  const auto isExplained = [&](const Group& group) {
    return std::all_of(group.views.begin(), group.views.end(),
                       [&](const ObjectView* view) { return explained.count(view) > 0; });
  };
  groups.erase(std::remove_if(groups.begin(), groups.end(), isExplained), groups.end());
  std::move(kept.begin(), kept.end(), std::back_inserter(groups));
}

const std::vector<dataset::MapObject>& Merger::outlines(const Meanwhile& meanwhile) {
  if (!is_stale_) return outlines_;
  is_stale_ = false;
  driven_m_.clear();
  for (const auto& [robot, trajectory] : trajectories())
    for (const auto& pose : trajectory.poses) driven_m_.push_back(pose.map_from_base.translation());
  auto candidates = candidatesOf(map_.store(), options_, bodies_, meanwhile);
  outlines_.clear();
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
  const std::vector<Verdict> verdicts = judge(groups);
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (!standsThere(verdicts[i])) continue;
    for (const auto* view : groups[i].views) kinds_[{view->robot, view->track_id}] = ObjectKind::kObstacle;
    if (verdicts[i].decision != Decision::kObstacle) continue;
    outlines_.push_back(objectOf(groups[i], verdicts[i]));
    outlines_.back().id = idOf(groups[i], bodies_, taken);
  }
  if (finished_) findFloorMarkings(groups, verdicts);
  for (dataset::MapObject& landmark : namedLandmarks(map_.store(), options_.min_views)) {
    while (!taken.insert(landmark.id).second) ++landmark.id;
    outlines_.push_back(std::move(landmark));
  }
  std::sort(outlines_.begin(), outlines_.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  standing_m_.clear();
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (verdicts[i].decision == Decision::kStructure) standing_m_.push_back(groups[i].centre_m);
  findStructure();
  findRejected(groups, verdicts);
  return outlines_;
}

/// Adds what the cells show beside the fitted obstacles (structure_objects.h). Replaces what an earlier call
/// added.
void Merger::findStructure() {
  if (options_.method == "hull") return;
  outlines_.erase(std::remove_if(outlines_.begin(), outlines_.end(),
                                 [](const dataset::MapObject& o) { return o.id >= kFirstStructureId; }),
                  outlines_.end());
  for (dataset::MapObject& object :
       structureObjects(structure::polylinesOf(map_.visible(), options_.structure), outlines_, standing_m_,
                        map_.visible().robots, {options_.prism.pose_sigma_m, options_.min_views}))
    outlines_.push_back(std::move(object));
}

std::vector<dataset::RejectedPlace> Merger::rejectedPlaces() const {
  std::vector<dataset::RejectedPlace> places;
  for (const RejectedCandidate& candidate : rejected_)
    places.push_back({candidate.at_m, toString(candidate.reason), candidate.observations});
  return places;
}

void Merger::finish() {
  finished_ = is_stale_ = true;
  map_.overrideKinds({});  // decisions of an earlier finish() must not influence this one
  outlines();
  map_.overrideKinds(kinds_);
  findStructure();
}

std::vector<std::string> Merger::save(const std::string& folder) {
  outlines();
  return saveMap(*this, folder);
}

std::vector<std::string> Merger::saveAsFitted(const std::string& folder) const {
  return saveMap(*this, folder);
}

}  // namespace omnifleet::global_merger
