#include "estimation/starts.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "estimation/agreement.h"
#include "estimation/factors.h"
#include "estimation/messages.h"
#include "estimation/published_poses.h"

namespace omnifleet::estimation {
namespace {

constexpr std::size_t kMostElsewhere = 30;
constexpr int kConfirmed = 5;                    // frames that agree: asked no more
constexpr int kFrames = 3;                       // of doubt, before a robot is moved …
constexpr int kLong = 8;                         // … and after which it is not believed any more, …
constexpr int kUnconfirmed = 40;                 // frames without one that agrees: it is said
constexpr int kSeldom = 20, kEvery = 5;          // … and after which only every fifth is looked at
constexpr double kMemory = 0.8;                  // of the score, from frame to frame
constexpr double kRefuted = 2.0, kUnseen = 3.0;  // score per frame of the other place, by kind of doubt …
constexpr double kLead = 3.0, kRivalLead = 1.0;  // … and before that of the start, of any other
constexpr double kAlike = 2.0;                   // things that the same error of another robot is worth
constexpr double kPerMetre = 0.5, kPerRadian = 0.5;   // things by which wrong starts are rarer
constexpr double kOwn_m = 0.25;                       // what stands so near a robot is that robot
constexpr double kSigma_m = 0.05, kSigma_rad = 0.05;  // of the placed pose; views sharpen it at once

/// Two robots do not err alike by chance: where one is found to stand elsewhere than it was said to, the same
/// error of another speaks for itself.
bool errsLikeAnother(const FleetState& fleet, const RobotNode& robot, const Pose2& moved,
                     const Pose2& claim) {
  const Pose2 here = moved * robot.start.moved * claim;
  return std::any_of(fleet.robots.begin(), fleet.robots.end(), [&](const RobotNode& other) {
    const Pose2 there = other.start.moved * claim;
    return &other != &robot && other.start.given && !areSame(claim, there) && areSame(here, there);
  });
}

/// Sums up what one frame says for other places.
void weighElsewhere(const FleetState& fleet, RobotNode& robot, const std::vector<Hypothesis>& hypotheses) {
  Start& start = robot.start;
  const Pose2 claim = fleet.pose(robot.window.back().pose);
  std::vector<bool> taken(start.elsewhere.size(), false);
  for (const Hypothesis& h : hypotheses) {
    const Pose2 moved = h.map_from_base * claim.inverse(), way = claim.inverse() * h.map_from_base;
    const double score = h.agreement.score() + (errsLikeAnother(fleet, robot, moved, claim) ? kAlike : 0.0) -
                         kPerMetre * way.translation().norm() - kPerRadian * std::abs(way.theta_rad);
    std::size_t i = 0;
    while (i < taken.size() && (taken[i] || !areSame(start.elsewhere[i].moved * claim, h.map_from_base))) ++i;
    if (i < taken.size()) {
      start.elsewhere[i].score += score;
      start.elsewhere[i].moved = moved;
      taken[i] = true;
    } else if (start.elsewhere.size() < kMostElsewhere) {
      start.elsewhere.push_back({moved, score});
    }
  }
}

void forgetDoubts(Start& start) {
  start.doubts = 0;
  start.doubted = start.refuted = start.claim_score = 0.0;
  start.elsewhere.clear();
  start.contradicted = false;
}

/// What was seen long ago counts less: estimates have become better since.
void age(Start& start) {
  start.doubted *= kMemory;
  start.refuted *= kMemory;
  start.claim_score *= kMemory;
  for (OtherStart& other : start.elsewhere) other.score *= kMemory;
}

void weigh(FleetState& fleet, RobotNode& robot) {
  Start& start = robot.start;
  const Surroundings around = Surroundings::of(fleet, robot);
  const Agreement here = agreementAt(fleet, around, fleet.pose(robot.window.back().pose));
  if (here.matches >= 2 && here.matches >= 2 * here.misses) {
    ++start.agreed;
    if (start.contradicted)
      fleet.revised.insert(fleet.revised.end(), start.history.begin(), start.history.end());
    forgetDoubts(start);
    start.unconfirmed = 0;
    return;
  }
  ++start.unconfirmed;
  const bool refuted = here.misses > here.matches;
  if (!refuted && here.matches > 0) {
    if (here.misses == 0) start.doubts = std::max(-kLong, start.doubts - 1);
    return;
  }
  if (++start.doubts > kSeldom && start.doubts % kEvery != 0) return;
  age(start);
  start.doubted += 1.0;
  start.refuted += refuted ? 1.0 : 0.0;
  start.claim_score += here.score();
  weighElsewhere(fleet, robot, otherPlaces(fleet, around));
}

/// Where a robot is much rather than where it is said to be; nullptr: that cannot be said.
const OtherStart* decided(const Start& start) {
  if (start.doubts < kFrames || start.elsewhere.empty()) return nullptr;
  const auto best = std::max_element(start.elsewhere.begin(), start.elsewhere.end(),
                                     [](const auto& a, const auto& b) { return a.score < b.score; });
  double rival = start.claim_score + kLead * start.doubted;
  for (const OtherStart& other : start.elsewhere) {
    if (&other != &*best) rival = std::max(rival, other.score + kRivalLead * start.doubted);
  }
  const double enough = (isRefuted(start) ? kRefuted : kUnseen) * start.doubted;
  return best->score >= std::max(enough, rival) ? &*best : nullptr;
}

/// What only a robot that stood elsewhere has seen, and what others took for an obstacle in its place.
void removeLandmarks(FleetState& fleet, const RobotNode& robot) {
  const Eigen::Vector2d place_m = fleet.pose(robot.window.back().pose).translation();
  std::vector<std::uint32_t> gone;
  for (const auto& [id, landmark] : fleet.landmarks) {
    const bool own = landmark.observers.size() == 1 && landmark.observers.count(robot.setup.name) > 0;
    if (own || (fleet.centre(landmark) - place_m).norm() < kOwn_m) gone.push_back(id);
  }
  for (const std::uint32_t id : gone) fleet.removeLandmark(id);
}

/// What others took for the robot.
void removeSightings(FleetState& fleet, const RobotNode& robot) {
  for (RobotNode& other : fleet.robots) {
    for (Step& step : other.window) {
      const auto of_it = [&](const ViewLink& link) {
        return std::any_of(robot.window.begin(), robot.window.end(),
                           [&](const Step& own) { return own.pose == link.object; });
      };
      for (const ViewLink& link : step.views) {
        if (of_it(link)) fleet.graph.removeFactor(link.factor);
      }
      step.views.erase(std::remove_if(step.views.begin(), step.views.end(), of_it), step.views.end());
    }
  }
}

/// Corrects the published poses, with the present poses of the frames in the window: while observations
/// contradicted the initial pose the robot's pose shifted, so no single motion corrects all published poses.
void moveHistory(const FleetState& fleet, RobotNode& robot, const Pose2& moved) {
  for (PoseEstimate& past : robot.start.history) {
    const auto step = std::find_if(robot.window.begin(), robot.window.end(),
                                   [&](const Step& s) { return s.time_ns == past.acquired_ns; });
    past.map_from_base = moved * (step == robot.window.end() ? past.map_from_base : fleet.pose(step->pose));
  }
}

void placeAnew(FleetState& fleet, RobotNode& robot, const Pose2& moved, const Eigen::Matrix3d& covariance) {
  const Step& newest = robot.window.back();
  const Pose2 place = moved * fleet.pose(newest.pose);
  Objects frame;
  frame.acquired_ns = frame.motion.since_ns = newest.time_ns;
  frame.sequence = newest.sequence;
  moveHistory(fleet, robot, moved);
  removeSightings(fleet, robot);
  fleet.release(robot);
  fleet.place(robot, frame, place);
  robot.covariance = covariance;
  fleet.graph.addFactor(absolutePoseFactor(place, covariance), {robot.window.back().pose});
  Start& start = robot.start;
  start.moved = moved * start.moved;
  start.pose = 0;
  start.agreed = 0;
  start.anchor = robot.window.back().pose;
  start.anchored = place;
  fleet.revised.insert(fleet.revised.end(), start.history.begin(), start.history.end());
}

bool errsBy(const RobotNode& robot, const Pose2& moved) {
  const Start& start = robot.start;
  return start.given && robot.located() && areSame(moved * *start.given, start.moved * *start.given);
}

/// Where more robots are beside their starts by one and the same motion than are where they should be.
void moveMap(FleetState& fleet) {
  const auto alike = [&](const Pose2& moved) {
    return std::count_if(fleet.robots.begin(), fleet.robots.end(),
                         [&](const RobotNode& robot) { return errsBy(robot, moved); });
  };
  const auto wrong = std::find_if(fleet.robots.begin(), fleet.robots.end(), [&](const RobotNode& robot) {
    return alike(robot.start.moved) > alike(Pose2{});
  });
  if (wrong == fleet.robots.end()) return;
  const Pose2 moved = wrong->start.moved;
  while (!fleet.landmarks.empty()) fleet.removeLandmark(fleet.landmarks.begin()->first);
  for (RobotNode& robot : fleet.robots) {
    if (!robot.located()) continue;
    const Pose2 back = (errsBy(robot, moved) ? robot.start.moved : moved).inverse();
    placeAnew(fleet, robot, back, robot.covariance);
  }
}

}  // namespace

void noteSight(RobotNode& robot, const Objects& frame, const std::vector<Seen>& seen) {
  robot.sight_aid.time_ns = frame.acquired_ns;
  robot.sight_aid.scan = frame.scan;
  robot.sight_aid.glimpses.clear();
  for (const Seen& s : seen)
    robot.sight_aid.glimpses.push_back({s.track->position_m, s.view, Footprint(*s.view), s.mature});
  for (const Glimpse& s : robot.sight_aid.glimpses)
    robot.sight_aid.farthest_m = std::max(robot.sight_aid.farthest_m, s.position_m.norm());
}

void checkStarts(FleetState& fleet, const std::vector<RobotNode*>& fresh) {
  if (fleet.tied) return;
  RobotNode* wrong = nullptr;
  double most = 0.0;
  for (RobotNode* robot : fresh) {
    Start& start = robot->start;
    if (!start.given || isConfirmed(start) || robot->sight_aid.glimpses.empty()) continue;
    weigh(fleet, *robot);
    // Of all robots that contradict each other the first is believed.
    if (!start.contradicted && start.doubts >= kLong && isContradicted(fleet, *robot) &&
        robot != &fleet.robots.front())
      withdraw(fleet, *robot);
    const OtherStart* other = decided(start);
    if (other == nullptr || other->score / start.doubted < most) continue;
    most = other->score / start.doubted;
    wrong = robot;
  }
  if (wrong == nullptr) return;
  placeAnew(fleet, *wrong, decided(wrong->start)->moved,
            Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad).asDiagonal());
  removeLandmarks(fleet, *wrong);
  moveMap(fleet);
  for (RobotNode& robot : fleet.robots) forgetDoubts(robot.start);
}

void moveStart(FleetState& fleet, RobotNode& robot, const Pose2& moved, const Eigen::Matrix3d& covariance) {
  placeAnew(fleet, robot, moved, covariance);
  removeLandmarks(fleet, robot);
  forgetDoubts(robot.start);
}

bool isOpen(const Start& start) {
  return start.given && start.pose != 0 && !start.borne_out;
}

bool isConfirmed(const Start& start) {
  return start.agreed >= kConfirmed;
}

bool isRefuted(const Start& start) {
  return start.doubts >= kFrames && 2.0 * start.refuted >= start.doubted;
}

bool isContradicted(const FleetState& fleet, const RobotNode& robot) {
  if (!isRefuted(robot.start)) return false;
  const auto many = [&](bool refuted) {
    return std::count_if(fleet.robots.begin(), fleet.robots.end(), [&](const RobotNode& other) {
      return other.located() && isRefuted(other.start) == refuted;
    });
  };
  return many(true) < many(false);
}

Message describeDoubt(const FleetState& fleet, const RobotNode& robot) {
  const Start& start = robot.start;
  const bool alone = std::none_of(fleet.robots.begin(), fleet.robots.end(), [&](const RobotNode& other) {
    return &other != &robot && other.located();
  });
  if (alone || start.contradicted) return {};
  const bool has_claim = !robot.setup.founds_map;  // else map is where it starts
  if (start.doubts >= kLong && isRefuted(start)) return initialPoseDoubtful(has_claim);
  if (has_claim && start.unconfirmed >= kUnconfirmed) return initialPoseUnconfirmed();
  return {};
}

}  // namespace omnifleet::estimation
