#include "estimation/locating.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "estimation/association.h"
#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kAgree_m = 0.05;                     // between the two distances of a mutual sighting
constexpr double kMatch_m = 0.10;                     // between a silhouette and what it should be
constexpr double kRival_m = 0.15, kRival_rad = 0.2;   // hypotheses nearer than this are the same
constexpr double kSigma_m = 0.05, kSigma_rad = 0.05;  // of the placed pose; views sharpen it at once

struct Hypothesis {
  Pose2 map_from_base;
  std::size_t witness = 0;
  int matches = 0;
  double error_m = 0.0;
};

/// Positions in the frame's base_link where a round-ish body of this size may stand.
std::vector<Eigen::Vector2d> bodies(const FleetState& fleet, const Objects& frame, const Body& body) {
  std::vector<Eigen::Vector2d> found;
  for (const Seen& seen : silhouettes(fleet, frame)) {
    const BodyFit fit = fitBody(*seen.view, body, 0.0, seen.track->position_m);
    if (fit.rms_m < fleet.options.sighting_rms_m) found.push_back(fit.position_m);
  }
  return found;
}

bool taken(const FleetState& fleet, const RobotNode& lost, TimeNs time, const Eigen::Vector2d& place) {
  for (const RobotNode& robot : fleet.robots) {
    const auto at = fleet.poseAt(robot, time);
    if (&robot != &lost && at && (at->map_from_base.translation() - place).norm() < robot.body->reach())
      return true;
  }
  return std::any_of(fleet.landmarks.begin(), fleet.landmarks.end(), [&](const auto& landmark) {
    return landmark.second.views > 1 && (fleet.centre(landmark.second) - place).norm() < kMatch_m;
  });
}

void score(const FleetState& fleet, const RobotNode& lost, const Objects& frame, Hypothesis& hypothesis) {
  for (const Track& track : frame.tracks) {
    if (!track.visible || track.supports.empty()) continue;  // without an outline its place is only predicted
    const Eigen::Vector2d place = hypothesis.map_from_base * track.position_m;
    double nearest = kMatch_m;
    for (const RobotNode& robot : fleet.robots) {
      const auto at = fleet.poseAt(robot, frame.acquired_ns);
      if (&robot != &lost && at)
        nearest = std::min(nearest, (at->map_from_base.translation() - place).norm());
    }
    for (const auto& [id, landmark] : fleet.landmarks) {
      nearest = std::min(nearest, (fleet.centre(landmark) - place).norm());
    }
    hypothesis.matches += nearest < kMatch_m ? 1 : 0;
    hypothesis.error_m += nearest;
  }
}

std::vector<Hypothesis> mutualSightings(const FleetState& fleet, const RobotNode& lost, const Objects& frame,
                                        const std::vector<const Objects*>& frames) {
  std::vector<Hypothesis> hypotheses;
  for (const Objects* other : frames) {
    const RobotNode* witness = fleet.find(other->robot);
    if (witness == &lost || witness == nullptr || !witness->located()) continue;
    const Pose2 map_from_witness = fleet.pose(witness->window.back().pose);
    for (const Eigen::Vector2d& p_in_witness : bodies(fleet, *other, *lost.body)) {
      const Eigen::Vector2d p = map_from_witness * p_in_witness;
      if (taken(fleet, lost, frame.acquired_ns, p)) continue;
      for (const Eigen::Vector2d& q : bodies(fleet, frame, *witness->body)) {
        if (std::abs(q.norm() - p_in_witness.norm()) > kAgree_m) continue;
        const Eigen::Vector2d back = map_from_witness.translation() - p;
        const double theta = std::atan2(back.y(), back.x()) - std::atan2(q.y(), q.x());
        const auto which = static_cast<std::size_t>(witness - fleet.robots.data());
        hypotheses.push_back({{p.x(), p.y(), wrapAngle(theta)}, which, 0, 0.0});
      }
    }
  }
  return hypotheses;
}

bool same(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kRival_m &&
         std::abs(wrapAngle(a.theta_rad - b.theta_rad)) < kRival_rad;
}

/// That a robot sees a body and the other one as far away, and nothing else, says little: two things may be
/// so by chance. It must be said again, while one of them drives.
bool isSaidAgain(const FleetState& fleet, RobotNode& lost, const Hypothesis& best) {
  constexpr int kFrames = 5, kStandingFrames = 15;
  constexpr double kDriven_m = 0.2;
  constexpr TimeNs kForget_ns = 2000000000;
  if (!lost.scout) return false;
  const Scout& scout = *lost.scout;
  const Eigen::Vector2d own_m = scout.local_from_base.translation();
  const Eigen::Vector2d witness_m = fleet.pose(fleet.robots[best.witness].window.back().pose).translation();
  std::optional<ScoutGuess>& guess = lost.scout->guess;
  if (!guess || guess->witness != best.witness || scout.time_ns - guess->last_ns > kForget_ns ||
      !same(guess->map_from_local * scout.local_from_base, best.map_from_base))
    guess = ScoutGuess{
        best.map_from_base * scout.local_from_base.inverse(), best.witness, 0, 0, own_m, witness_m};
  guess->last_ns = scout.time_ns;
  const double driven_m = (own_m - guess->own_m).norm() + (witness_m - guess->witness_m).norm();
  return ++guess->frames >= (driven_m >= kDriven_m ? kFrames : kStandingFrames);
}

/// Takes the best hypothesis when no other place is as good.
bool placeBest(FleetState& fleet, RobotNode& lost, const Objects& frame,
               std::vector<Hypothesis>& hypotheses) {
  std::stable_sort(hypotheses.begin(), hypotheses.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.matches != b.matches ? a.matches > b.matches : a.error_m < b.error_m;
  });
  if (hypotheses.empty() || hypotheses.front().matches == 0) return false;
  const Hypothesis& best = hypotheses.front();
  for (const Hypothesis& h : hypotheses) {
    if (h.matches == best.matches && !same(h.map_from_base, best.map_from_base)) return false;
  }
  if (best.matches == 1 && !isSaidAgain(fleet, lost, best)) return false;
  fleet.release(lost);
  fleet.place(lost, frame, best.map_from_base);
  const Eigen::Matrix3d covariance =
      Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad).asDiagonal();
  lost.covariance = covariance;
  fleet.graph.addFactor(absolutePoseFactor(best.map_from_base, covariance), {lost.window.back().pose});
  return true;
}

}  // namespace

bool locateBySightings(FleetState& fleet, RobotNode& lost, const Objects& frame,
                       const std::vector<const Objects*>& frames) {
  if (!fleet.options.use_sightings) return false;
  std::vector<Hypothesis> hypotheses = mutualSightings(fleet, lost, frame, frames);
  if (hypotheses.empty()) return false;
  for (Hypothesis& h : hypotheses) score(fleet, lost, frame, h);
  return placeBest(fleet, lost, frame, hypotheses);
}

}  // namespace omnifleet::estimation
