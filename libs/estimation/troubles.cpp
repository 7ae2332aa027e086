#include "estimation/troubles.h"

#include <algorithm>
#include <cmath>

#include "estimation/jumps.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSlip_m = 0.05, kSlip_rad = 0.15;  // beyond what the wheels rolled: carried away
constexpr double kAdrift_rad = 0.5;  // σ of the heading beyond which nothing seen says where a robot is
constexpr int kUnsureFrames = 10;    // that a robot which saw nothing takes to find that it was carried away

void jump(FleetState& fleet, RobotFrame& frame, const Pose2& map_from_base) {
  RobotNode& robot = *frame.robot;
  const Step& step = robot.window.back();
  const Pose2 by = fleet.pose(step.pose).inverse() * map_from_base;
  const bool slipped = !robot.unseen && !robot.displaced && step.wheels &&
                       by.translation().norm() < robot.unsettled_m + kSlip_m &&
                       std::abs(wrapAngle(by.theta_rad)) < robot.unsettled_rad + kSlip_rad;
  const bool told = (step.wheels && !robot.unseen) || robot.displaced;
  jumpTo(fleet, robot, map_from_base);
  frame.settled = true;
  if (told && slipped) tellSlip(frame);
  if (told && !slipped && !robot.displaced) ++robot.status.losses;
  frame.placed_anew = told && !slipped;
  robot.displaced = false;
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
  frame.unfamiliar = (robot.unsure > 0 || frame.after_gap) && 2 * at.matches < at.things && at.missing > 0;
}

}  // namespace

bool isAfterGap(const RobotNode& robot, TimeNs time_ns) {
  constexpr TimeNs kGap_ns = 1000000000;
  constexpr int kTimes = 5;
  const std::size_t n = robot.window.size();
  if (n < 2) return false;
  const TimeNs usual_ns = robot.window[n - 1].time_ns - robot.window[n - 2].time_ns;
  return time_ns - robot.window[n - 1].time_ns > std::max(kGap_ns, kTimes * usual_ns);
}

void noticeJumps(FleetState& fleet, std::vector<RobotFrame>& frames) {
  for (const bool peers : {false, true}) {
    for (RobotFrame& frame : frames) {
      if (frame.isPlaced() && frame.sees() && !frame.settled) noticeJump(fleet, frame, peers);
    }
  }
  for (RobotFrame& frame : frames) {
    if (!frame.isPlaced()) continue;
    RobotNode& robot = *frame.robot;
    if (!frame.sees()) {
      robot.unsure = kUnsureFrames;
      continue;
    }
    if (frame.after_gap) robot.unsure = kUnsureFrames + 1;
    if (frame.settled) robot.unsettled_m = robot.unsettled_rad = 0.0;
    robot.unsure = frame.settled ? 0 : std::max(0, robot.unsure - 1);
    robot.seeing_ns = frame.objects->acquired_ns;
  }
}

void noticeLoss(FleetState& fleet, RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  // No line through a pose holds when its heading may be anything.
  const bool adrift = !robot.window.back().wheels && robot.covariance(2, 2) > kAdrift_rad * kAdrift_rad;
  // What fits by chance, one thing here and another there, does not bring back who is lost.
  const bool displaced = !frame.settled && (robot.displaced || adrift || frame.unfamiliar ||
                                            isDisplaced(fleet, robot, frame.seen));
  if (displaced && !robot.displaced) ++robot.status.losses;
  robot.displaced = displaced;
  if (!displaced) return;
  robot.object_of_track.clear();
  for (Seen& seen : frame.seen) seen.peer = nullptr, seen.landmark = 0;
}

void noticeCarried(FleetState& fleet, std::vector<RobotFrame>& frames) {
  for (RobotFrame& frame : frames) {
    RobotNode& robot = *frame.robot;
    if (!frame.isPlaced() || !robot.unseen) continue;
    if (wasCarried(fleet, robot)) {
      if (!frame.placed_anew) ++robot.status.losses;
      frame.placed_anew = true;
      robot.unseen.reset();
    } else if (frame.sees() && robot.unsure == 0) {
      robot.unseen.reset();
    }
  }
}

void noteObserved(std::vector<RobotFrame>& frames) {
  const auto known = [](const RobotNode& r) {
    return r.located() && !r.displaced && (r.unobserved == 0 || r.window.back().wheels);
  };
  const auto sees = [&](const RobotNode& from, const RobotNode& to) {
    return std::any_of(frames.begin(), frames.end(), [&](const RobotFrame& frame) {
      return frame.robot == &from && std::any_of(frame.seen.begin(), frame.seen.end(),
                                                 [&](const Seen& seen) { return seen.peer == &to; });
    });
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {  // one tells another
    for (RobotFrame& frame : frames) {
      int told = 0;
      for (const Seen& seen : frame.seen) {
        if (seen.landmark != 0) ++told;
        if (seen.peer != nullptr && known(*seen.peer)) told += sees(*seen.peer, *frame.robot) ? 2 : 1;
      }
      if (told >= 2) frame.robot->unobserved = 0;
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

void tellSlip(RobotFrame& frame) {
  frame.slipped = true;
  ++frame.robot->status.slips;
}

}  // namespace omnifleet::estimation
