#include "estimation/troubles.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/factors.h"
#include "estimation/jumps.h"
#include "estimation/messages.h"
#include "estimation/starts.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSlip_m = 0.05, kSlip_rad = 0.15;  // beyond what the wheels rolled: carried away
constexpr double kAdrift_rad = 0.5;  // σ of the heading beyond which nothing seen says where a robot is
constexpr double kKnownHeading_rad = 0.1;  // σ below which the heading is known
constexpr int kUnsureFrames = 10;  // without observations until a robot can detect that it was kidnapped

constexpr int kDoubts = 3;  // refused ranges and bearings in a row: no pose to be trusted

void jump(FleetState& fleet, RobotFrame& frame, const Pose2& map_from_base) {
  RobotNode& robot = *frame.robot;
  const Step& step = robot.window.back();
  const Pose2 by = fleet.pose(step.pose).inverse() * map_from_base;
  const bool slipped = !robot.doubt.unseen && !robot.doubt.displaced && step.wheels &&
                       by.translation().norm() < robot.doubt.unsettled_m + kSlip_m &&
                       std::abs(wrapAngle(by.theta_rad)) < robot.doubt.unsettled_rad + kSlip_rad;
  const bool measured = (step.wheels && !robot.doubt.unseen) || robot.doubt.displaced;
  jumpTo(fleet, robot, map_from_base);
  frame.settled = true;
  if (measured && slipped) reportSlip(frame);
  if (measured && !slipped && !robot.doubt.displaced) ++robot.status.losses;
  frame.placed_anew = measured && !slipped;
  robot.doubt.displaced = false;
  robot.doubt.claims.clear();
}

/// A robot that is not where its motion has put it is placed anew by what it sees.
void noticeJump(FleetState& fleet, RobotFrame& frame, bool peers) {
  RobotNode& robot = *frame.robot;
  if (robot.window.back().motion == kNoFactor) return;
  const Whereabouts at = lookAround(fleet, robot, frame.seen, peers);
  if (at.elsewhere) {
    jump(fleet, frame, *at.elsewhere);
    return;
  }
  frame.settled = at.fit();
  if (frame.settled || !robot.doubt.displaced) robot.doubt.claims.clear();
  if (!frame.settled && robot.doubt.displaced && peers) {
    const auto place = followClaims(fleet, robot, frame.seen);
    if (place) {
      jump(fleet, frame, *place);
      return;
    }
  }
  const bool blind = robot.doubt.unsure > 0;
  if (!blind && at.matches > 0) robot.doubt.familiar = true;
  const bool strange = 2 * at.matches < at.things && at.missing > 0;
  const bool all_strange = robot.doubt.familiar && at.matches == 0 && at.things > 0;
  frame.unfamiliar = blind && (strange || all_strange);
}

std::vector<Standing> standing(const FleetState& fleet, const std::vector<Seen>& seen) {
  std::vector<Standing> all;
  for (const Seen& s : seen) {
    if (!s.mature || s.track->kind == ObjectKind::kRobot) continue;
    const Footprint footprint(*s.view);
    const double height_m = s.track->height_m > 0 ? s.track->height_m : fleet.options.prior_height_m;
    all.push_back(
        {footprint.centre(height_m), footprint.half_width_m - height_m * footprint.half_width_by_height});
  }
  return all;
}

}  // namespace

void tryWheels(FleetState& fleet, RobotFrame& frame, TimeNs before_ns) {
  RobotNode& robot = *frame.robot;
  const Motion& motion = frame.objects->motion;
  const double separation_m = robot.setup.body.wheel_separation_m;
  const bool complete = motion.since_ns == before_ns && (motion.valid || motion.wheels_rejected);
  if (!frame.follows() || !complete) robot.wheel_aid.trial.interrupt();
  if (!frame.sees()) return;
  Motion claimed = complete ? motion : Motion{};
  if (complete && motion.wheels_rejected && separation_m > 0) {
    claimed.valid = true;
    claimed.previous_from_current = arc(motion.left_m, motion.right_m, separation_m);
  }
  robot.wheel_aid.trial.add(claimed, separation_m, standing(fleet, frame.seen));
  // Nobody changes wires in a run: little in sight takes nothing back.
  const Wiring verdict = robot.wheel_aid.trial.verdict();
  if (verdict == Wiring::kAsConfigured) return;
  if (std::exchange(robot.wheel_aid.wiring, verdict) == Wiring::kAsConfigured) fleet.disbelieveWheels(robot);
}

void noteRejectedWheels(const FleetState& fleet, RobotFrame& frame) {
  constexpr double kNews_m = 0.03, kNews_rad = 0.05;  // less is no news to people
  const auto& window = frame.robot->window;
  if (!frame.fresh || frame.slipped || window.size() < 2) return;
  const Step& step = window.back();
  if (!step.wheels_rejected || !(frame.robot->setup.body.wheel_separation_m > 0)) return;
  const Pose2 way = fleet.pose(window[window.size() - 2].pose).inverse() * fleet.pose(step.pose);
  const Motion& motion = frame.objects->motion;
  const Pose2 off =
      arc(motion.left_m, motion.right_m, frame.robot->setup.body.wheel_separation_m).inverse() * way;
  if (step.wheels && off.translation().norm() < kNews_m && std::abs(off.theta_rad) < kNews_rad) return;
  // Slip makes no robot go farther than its wheels. Wheels with another clock do, by their jitter.
  constexpr double kJitters = 3.0 * M_SQRT2;  // σ of a difference of two frames
  const OdometryQuality& odometry = frame.robot->scan_aid.odometry;
  // A scan that matches around the robot is evidence against a kidnapping.
  if (!step.wheels || frame.robot->scan_aid.suffices ||
      (way.translation().norm() < step.rolled_m + kSlip_m + kJitters * odometry.jitterM() &&
       std::abs(way.theta_rad) < step.rolled_rad + kSlip_rad + kJitters * odometry.jitterRad())) {
    reportSlip(frame);
    return;
  }
  ++frame.robot->status.losses;
  frame.placed_anew = true;
}

bool isAfterGap(const RobotNode& robot, TimeNs time_ns) {
  constexpr TimeNs kGap_ns = 1000000000;
  constexpr int kTimes = 5;
  const std::size_t n = robot.window.size();
  if (n < 2) return false;
  const TimeNs usual_ns = robot.window[n - 1].time_ns - robot.window[n - 2].time_ns;
  return time_ns - robot.window[n - 1].time_ns > std::max(kGap_ns, kTimes * usual_ns);
}

void noticeJumps(FleetState& fleet, std::vector<RobotFrame>& frames) {
  // Who was as blind as it is bears no robot out: they may all have been carried alike.
  for (RobotFrame& frame : frames) {
    frame.settled = frame.settled || frame.robot->scan_aid.suffices;
    if (frame.isPlaced() && frame.after_gap) frame.robot->doubt.unsure = kUnsureFrames + 1;
  }
  for (const bool peers : {false, true}) {
    for (RobotFrame& frame : frames) {
      if (frame.isPlaced() && frame.sees() && !frame.settled) noticeJump(fleet, frame, peers);
    }
  }
  for (RobotFrame& frame : frames) {
    if (!frame.isPlaced()) continue;
    RobotNode& robot = *frame.robot;
    if (!frame.sees()) {
      robot.doubt.unsure = kUnsureFrames;
      robot.doubt.claims.clear();
      continue;
    }
    if (frame.settled) robot.doubt.unsettled_m = robot.doubt.unsettled_rad = 0.0;
    robot.doubt.unsure = frame.settled ? 0 : std::max(0, robot.doubt.unsure - 1);
    robot.doubt.seeing_ns = frame.objects->acquired_ns;
  }
}

void noticeLoss(FleetState& fleet, RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  // No line through a pose holds when its heading may be anything.
  const bool adrift = !robot.window.back().isMeasured() && robot.covariance(2, 2) > kAdrift_rad * kAdrift_rad;
  const bool strange = frame.unfamiliar || isDisplaced(fleet, robot, frame.seen);
  robot.doubt.adrift = !strange && (robot.doubt.displaced ? robot.doubt.adrift : adrift);
  // What fits by chance, one thing here and another there, does not bring back who is lost. But ranges and
  // bearings may have determined the heading since.
  const bool found = robot.doubt.adrift && !adrift && robot.absolute_aid.refusals == 0 &&
                     robot.covariance(2, 2) < kKnownHeading_rad * kKnownHeading_rad;
  const bool displaced = !frame.settled && !found && (robot.doubt.displaced || adrift || strange);
  if (displaced && !robot.doubt.displaced) ++robot.status.losses;
  robot.doubt.displaced = displaced;
  if (!displaced) return;
  robot.track_aid.known.clear();
  robot.track_aid.suspects.clear();
  for (Seen& seen : frame.seen) seen.peer = nullptr, seen.landmark = 0;
}

void noticeCarried(FleetState& fleet, std::vector<RobotFrame>& frames) {
  for (RobotFrame& frame : frames) {
    RobotNode& robot = *frame.robot;
    if (!frame.isPlaced() || !robot.doubt.unseen) continue;
    if (wasCarried(fleet, robot)) {
      if (!frame.placed_anew) ++robot.status.losses;
      frame.placed_anew = true;
      robot.doubt.unseen.reset();
    } else if (frame.sees() && robot.doubt.unsure == 0) {
      robot.doubt.unseen.reset();
    }
  }
}

void noteObserved(std::vector<RobotFrame>& frames) {
  const auto known = [](const RobotNode& r) {
    return r.located() && !r.doubt.displaced && (r.track_aid.unobserved == 0 || r.window.back().isMeasured());
  };
  const auto sees = [&](const RobotNode& from, const RobotNode& to) {
    return std::any_of(frames.begin(), frames.end(), [&](const RobotFrame& frame) {
      return frame.robot == &from && std::any_of(frame.seen.begin(), frame.seen.end(),
                                                 [&](const Seen& seen) { return seen.peer == &to; });
    });
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {  // one tells another
    for (RobotFrame& frame : frames) {
      int known_views = 0;
      for (const Seen& seen : frame.seen) {
        if (seen.landmark != 0) ++known_views;
        if (seen.peer != nullptr && known(*seen.peer)) known_views += sees(*seen.peer, *frame.robot) ? 2 : 1;
      }
      if (known_views >= 2) frame.robot->track_aid.unobserved = 0;
    }
  }
}

double misfit(const FleetState& fleet, const std::vector<ViewLink>& views) {
  constexpr int kLeastViews = 3;
  std::vector<double> rms_m;
  for (const ViewLink& link : views) {
    if (link.landmark != 0 && fleet.landmarks.at(link.landmark).views >= kLeastViews)
      rms_m.push_back(link.rms_m);
  }
  if (rms_m.empty()) return 0.0;
  const auto middle = rms_m.begin() + static_cast<std::ptrdiff_t>((rms_m.size() - 1) / 2);
  std::nth_element(rms_m.begin(), middle, rms_m.end());
  return *middle;
}

Eigen::Matrix3d slipCovariance() {
  constexpr double kReach_m = 0.2, kReach_rad = 0.2;
  return Eigen::Vector3d(kReach_m * kReach_m, kReach_m * kReach_m, kReach_rad * kReach_rad).asDiagonal();
}

void noteState(const FleetState& fleet, const RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  if (!frame.fresh || !robot.located()) return;
  const bool lost =
      robot.doubt.displaced || robot.absolute_aid.refusals >= kDoubts || robot.start.contradicted;
  robot.status.state = lost ? RobotState::kLost : RobotState::kOk;
  robot.status.message =
      lost ? (robot.doubt.adrift ? headingLost() : localizationLost()) : describeDoubt(fleet, robot);
  if (robot.start.contradicted) robot.status.message = initialPoseNotMapped();
  if (frame.placed_anew) {
    constexpr int kOften = 3;  // nobody carries a robot so often
    robot.status.message = relocalized(robot.status.losses > kOften);
  }
  if (frame.slipped) robot.status.state = RobotState::kSlipping;
  if (frame.slipped) robot.status.message = wheelSlip();
  if (robot.wheel_aid.wiring == Wiring::kAsConfigured) return;
  // All else that is wrong comes of it.
  robot.status.message = wheelAssignmentWrong(robot.wheel_aid.wiring);
  if (!lost) robot.status.state = RobotState::kSlipping;
}

void reportSlip(RobotFrame& frame) {
  frame.slipped = true;
  ++frame.robot->status.slips;
}

void rejectStep(RobotFrame& frame) {
  frame.robot->window.back().rejected = true;
  if (!frame.robot->window.back().by_floor) {
    reportSlip(frame);
    return;
  }
  frame.robot->floor.reject();
  frame.floor_rejected = true;
}

}  // namespace omnifleet::estimation
