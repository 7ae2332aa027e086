#include "global_merger/candidates.h"

#include <algorithm>
#include <cmath>

#include "occupancy/robot_paths.h"

namespace omnifleet::global_merger {
namespace {

using occupancy::Contribution;
using occupancy::ContributionStore;
using occupancy::KeyframePose;
using occupancy::SupportView;

constexpr TimeNs kHoldNs = 1'000'000'000, kMaxGapNs = 5'000'000'000;  // defaults of the occupancy map

struct PlacedRobot {
  Pose2 map_from_base;
  const RobotBody* body;
};

/// The fleet's robots other than the observer, with their poses at a time.
std::vector<PlacedRobot> othersAt(const ContributionStore& store, const occupancy::RobotPaths& paths,
                                  const std::map<std::string, RobotBody>& bodies, const std::string& observer,
                                  TimeNs time_ns) {
  static const RobotBody kUnknownBody{0.15, {}, 0.2, 0.0};
  std::vector<PlacedRobot> others;
  for (const auto& [robot, path] : store.robots()) {
    const auto robot_pose = robot == observer ? std::nullopt : paths.at(robot, time_ns);
    if (!robot_pose) continue;
    const Eigen::Vector2d p = metres(robot_pose->position);
    const auto body = bodies.find(robot);
    others.push_back({{p.x(), p.y(), robot_pose->theta_dmrad / occupancy::kDmmPerMetre},
                      body == bodies.end() ? &kUnknownBody : &body->second});
  }
  return others;
}

Eigen::Vector2d centreOf(const PlacedRobot& robot) {
  return robot.map_from_base * centroid(robot.body->outline());
}

/// Whether a robot of the fleet was there and its body explains the silhouette.
bool isRobot(const ObjectView& view, const std::vector<PlacedRobot>& robots, const MergerOptions& options) {
  return std::any_of(robots.begin(), robots.end(), [&](const PlacedRobot& robot) {
    const double apart = (centreOf(robot) - view.position_m).norm();
    if (apart > 3.0 * options.robot_gap_m) return false;
    if (apart < 0.5 * options.robot_gap_m) return true;
    const auto fit =
        outline::fitBody({view.prism}, knownBody(*robot.body), options.prism, robot.map_from_base.theta_rad);
    return fit.valid && fit.rms_m < options.robot_rms_m &&
           (fit.map_from_body.translation() - robot.map_from_base.translation()).norm() < options.robot_gap_m;
  });
}

ObjectView viewOf(const Contribution& contribution, const KeyframePose& pose, const SupportView& seen,
                  const MergerOptions& options) {
  ObjectView view;
  view.robot = contribution.robot;
  view.time_ns = contribution.acquired_ns;
  view.track_id = seen.track_id;
  view.prism.map_from_base = pose.mapFromBase();
  view.prism.foot_m = metres(contribution.scan_origin);
  view.prism.camera_height_m = contribution.camera_height_dmm / occupancy::kDmmPerMetre;
  view.prism.supports = supportsOf(seen);
  view.position_m = view.prism.map_from_base * metres(seen.position);
  view.is_flawed = seen.truncated || seen.solidity_permille < 1000.0 * options.min_solidity;
  view.is_cut = seen.truncated;
  if (seen.height_sigma_dmm > 0 && !view.is_cut) {  // for a cut view it is from earlier views or assumed
    // Estimated from the same silhouettes or from noisy motion vectors: σ is at least 3 cm.
    view.height = {seen.height_dmm / occupancy::kDmmPerMetre,
                   std::max(seen.height_sigma_dmm / occupancy::kDmmPerMetre, 0.03)};
  }
  return view;
}

bool isSighted(const KeyframePose& pose, std::uint32_t track_id) {
  return std::any_of(pose.sightings.begin(), pose.sightings.end(),
                     [&](const Sighting& sighting) { return sighting.track_id == track_id; });
}

void thin(std::vector<ObjectView>& views) {
  if (views.size() <= kMaxViews) return;
  std::vector<ObjectView> kept;
  for (std::size_t i = 0; i < kMaxViews; ++i) kept.push_back(std::move(views[i * views.size() / kMaxViews]));
  views = std::move(kept);
}

bool isObserver(const std::string& robot, const MergerOptions& options) {
  return options.observers.empty() ||
         std::find(options.observers.begin(), options.observers.end(), robot) != options.observers.end();
}

using Tracks = std::map<std::uint32_t, Candidate>;

/// A view that may show a robot.
struct PossibleRobotView {
  ObjectView view;
  std::size_t others;  ///< index in Gathered::others: the robots at its time
};

/// Data of one robot's part of the store. The store is not read after that, so it may grow meanwhile.
struct Gathered {
  Tracks tracks;  ///< without views yet
  std::vector<std::vector<PlacedRobot>> others;
  std::vector<PossibleRobotView> views;
};

void gatherFrom(const Contribution& contribution, const KeyframePose& pose, const MergerOptions& options,
                Gathered& all) {
  for (const auto& seen : contribution.views) {
    if (!seen.name.empty()) continue;  // see named_landmarks.h
    auto& candidate = all.tracks[seen.track_id];
    candidate.robot = contribution.robot;
    candidate.track_id = seen.track_id;
    if (seen.kind != ObjectKind::kUnknown) candidate.kind = seen.kind;
    if (isSighted(pose, seen.track_id)) continue;
    if ((metres(seen.contact) - metres(contribution.scan_origin)).norm() > options.max_contact_m) continue;
    ObjectView view = viewOf(contribution, pose, seen, options);
    if (view.prism.supports.size() < 3 || view.prism.camera_height_m < 0) continue;
    all.views.push_back({std::move(view), all.others.size() - 1});
  }
}

std::vector<Candidate> sorted(std::vector<Gathered>& gathered, const MergerOptions& options,
                              const Meanwhile& meanwhile) {
  constexpr std::size_t kAtOnce = 16;  // views: less time than one fit of an outline
  std::vector<Candidate> candidates;
  for (Gathered& all : gathered) {
    for (std::size_t i = 0; i < all.views.size(); ++i) {
      if (meanwhile && i % kAtOnce == 0) meanwhile();
      auto& [view, others] = all.views[i];
      if (!isRobot(view, all.others[others], options))
        all.tracks.at(view.track_id).views.push_back(std::move(view));
    }
    for (auto& [id, candidate] : all.tracks) {
      if (candidate.views.empty()) continue;
      thin(candidate.views);
      candidates.push_back(std::move(candidate));
    }
  }
  return candidates;
}

}  // namespace

outline::KnownBody knownBody(const RobotBody& body) {
  return {body.outline(), body.height_m, body.footprint_m.size() < 3};
}

std::vector<Candidate> candidatesOf(const ContributionStore& store, const MergerOptions& options,
                                    const std::map<std::string, RobotBody>& bodies,
                                    const Meanwhile& meanwhile) {
  const occupancy::RobotPaths paths(store, kHoldNs, kMaxGapNs);
  std::vector<Gathered> gathered;
  for (const auto& [robot, path] : store.robots()) {
    if (!isObserver(robot, options)) continue;
    Gathered& all = gathered.emplace_back();
    for (const auto& [time_ns, keyframe] : path) {
      const KeyframePose* pose = store.poseOf(keyframe);
      if (!keyframe.corrected || pose == nullptr) continue;
      if (std::all_of(keyframe.corrected->views.begin(), keyframe.corrected->views.end(),
                      [](const SupportView& view) { return !view.name.empty(); })) {
        continue;
      }
      all.others.push_back(othersAt(store, paths, bodies, robot, time_ns));
      gatherFrom(*keyframe.corrected, *pose, options, all);
    }
  }
  return sorted(gathered, options, meanwhile);
}

}  // namespace omnifleet::global_merger
