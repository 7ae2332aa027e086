#include "fault.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "estimation/factors.h"
#include "evaluation/consistency.h"

namespace omnifleet::estimation::testing {
namespace {

bool isKidnapping(ErrorCode code) {
  return code == ErrorCode::kKidnapped || code == ErrorCode::kLocalizationLost;
}

constexpr double kSeparation_m = 0.26, kSlip_rad = 0.1;

class FaultInjector {
 public:
  explicit FaultInjector(const Fault& fault) : fault_(fault) {}

  bool isDark(int f) const { return f >= fault_.at_frame && f < fault_.at_frame + fault_.dark_frames; }
  int lastFrame() const {
    return fault_.at_frame + std::max({fault_.dark_frames, fault_.gap_frames, fault_.spin_frames - 1, 0});
  }
  bool isActive() const {
    return fault_.kidnapped_m > 0 || fault_.spin_frames > 0 || fault_.slip_m > 0 ||
           fault_.wheels != WheelAssignment::kCorrect;
  }
  bool isGap(int f) const { return f >= fault_.at_frame && f < fault_.at_frame + fault_.gap_frames; }

  void inject(std::vector<Objects>& frames, int f) const {
    Objects& first = frames.front();
    for (Objects& frame : frames) {
      if (!isDark(f) || (&frame != &first && !fault_.all_robots)) continue;
      frame.state = FrameState::kDark;
      frame.tracks.clear();
    }
    for (Objects& frame : frames) {
      if (!fault_.new_tracks || f < lastFrame()) break;
      for (Track& track : frame.tracks) track.id += 500;
    }
    misassignWheels(first.motion);
    if (f >= fault_.at_frame && f < fault_.at_frame + fault_.spin_frames) {
      Motion& m = first.motion;
      m.left_m += fault_.spin_m;
      m.previous_from_current = arc(m.left_m, m.right_m, kSeparation_m);
    }
    if (f != fault_.at_frame || fault_.slip_m <= 0) return;
    for (Objects& frame : frames) {
      if (&frame != &first && !fault_.all_robots) continue;
      frame.motion.left_m += fault_.slip_m - 0.5 * kSlip_rad * kSeparation_m;
      frame.motion.right_m += fault_.slip_m + 0.5 * kSlip_rad * kSeparation_m;
      frame.motion.previous_from_current = arc(frame.motion.left_m, frame.motion.right_m, kSeparation_m);
    }
  }

  /// The first frame after a gap carries the motion that the wheels counted during the gap.
  void mergeGapMotion(std::vector<Objects>& frames, int f) {
    unsent_.resize(frames.size());
    for (std::size_t r = 0; r < frames.size(); ++r) {
      Motion& motion = frames[r].motion;
      if (unsent_[r].valid) prepend(unsent_[r], motion);
      if (isGap(f)) unsent_[r] = motion;
      if (!isGap(f)) unsent_[r] = {};
      if (f == lastFrame() && !fault_.wheels_in_gap) motion = {};
    }
  }

 private:
  static void prepend(const Motion& before, Motion& motion) {
    motion.since_ns = before.since_ns;
    motion.covariance = composeCovariance(before.covariance, motion.previous_from_current, motion.covariance);
    motion.previous_from_current = before.previous_from_current * motion.previous_from_current;
    motion.left_m += before.left_m;
    motion.right_m += before.right_m;
  }

  void misassignWheels(Motion& m) const {
    if (fault_.wheels == WheelAssignment::kCorrect) return;
    if (fault_.wheels == WheelAssignment::kSwapped || fault_.wheels == WheelAssignment::kReversedAndSwapped)
      std::swap(m.left_m, m.right_m);
    const bool reversed =
        fault_.wheels == WheelAssignment::kReversed || fault_.wheels == WheelAssignment::kReversedAndSwapped;
    if (reversed || fault_.wheels == WheelAssignment::kLeftReversed) m.left_m = -m.left_m;
    if (reversed || fault_.wheels == WheelAssignment::kRightReversed) m.right_m = -m.right_m;
    m.previous_from_current = arc(m.left_m, m.right_m, kSeparation_m);
  }

  Fault fault_;
  std::vector<Motion> unsent_;
};

}  // namespace

FaultResult run(const Fault& fault, const EstimatorOptions& options, std::uint32_t seed) {
  SimulationOptions simulation = fault.simulation;
  simulation.kidnapped_at = fault.at_frame + (fault.dark_frames + fault.gap_frames) / 2;
  if (fault.kidnapped_m == 0) simulation.kidnapped_at = 0;
  simulation.kidnapped_m = fault.kidnapped_m;
  simulation.kidnapped_rad = fault.kidnapped_rad;
  simulation.all_kidnapped = fault.all_robots && fault.kidnapped_m > 0;
  FleetSimulator simulator(simulation, seed);
  FaultInjector injector(fault);
  FleetEstimator estimator(simulator.setups(), options);
  FaultResult result;
  const auto robots = static_cast<std::size_t>(fault.simulation.robots);
  const std::size_t faulty = injector.isActive() ? (fault.all_robots ? robots : 1) : 0;
  std::vector<int> report_frame(robots, -1);
  std::set<std::size_t> wheel_reports;
  int valid = 0, frames_after = 0;
  for (int f = 0; f < fault.simulation.frames; ++f) {
    auto frames = simulator.frames(f);
    injector.inject(frames, f);
    injector.mergeGapMotion(frames, f);
    if (injector.isGap(f)) continue;
    const auto poses = estimator.process(simulator.time(f), testing::pointers(frames), {});
    const int until = injector.lastFrame() + static_cast<int>(2.0 / fault.simulation.period_s);
    for (std::size_t r = 0; r < robots; ++r) {
      const RobotStatus& status = estimator.status(FleetSimulator::name(static_cast<int>(r)));
      const bool is_reported = status.state != RobotState::kOk || isKidnapping(status.message.code);
      result.kidnapping_frames += isKidnapping(status.message.code) ? 1 : 0;
      const bool due = r < faulty && f >= fault.at_frame && f <= until;
      if (is_reported && due && report_frame[r] < 0) report_frame[r] = f;
      const bool dark = (r == 0 || fault.all_robots) && injector.isDark(f);
      if (status.message.code == ErrorCode::kWheelAssignment) wheel_reports.insert(r);
      if (is_reported && !due && !dark) ++result.false_reports;
      if (f < fault.at_frame || dark) continue;
      ++frames_after;
      if (!poses[r].valid) continue;
      ++valid;
      const Pose2 e = poses[r].map_from_base.inverse() * simulator.truth(static_cast<int>(r), f);
      result.mean_m += e.translation().norm();
      result.worst_m = std::max(result.worst_m, e.translation().norm());
      result.nees += evaluation::normalisedSquare(poses[r].map_from_base, poses[r].covariance,
                                                  simulator.truth(static_cast<int>(r), f));
      if (f == fault.simulation.frames - 1)
        result.end_m += e.translation().norm() / static_cast<double>(robots);
    }
  }
  result.wheel_reports = static_cast<int>(wheel_reports.size());
  result.faulty = static_cast<int>(faulty);
  for (std::size_t r = 0; r < faulty; ++r) {
    if (report_frame[r] < 0) continue;
    ++result.detected;
    const int first_observed = fault.at_frame + fault.dark_frames + fault.gap_frames;
    result.delay_s += std::max(0, report_frame[r] - first_observed) * fault.simulation.period_s /
                      static_cast<double>(faulty);
  }
  result.mean_m /= std::max(1, valid);
  result.nees /= std::max(1, valid);
  result.valid = static_cast<double>(valid) / frames_after;
  for (const LandmarkEstimate& landmark : estimator.landmarks()) {
    const auto& all = simulator.obstacles();
    const bool right = std::any_of(all.begin(), all.end(), [&](const Prism& prism) {
      return (prism.centre_m - landmark.centre_m).norm() < 0.05;
    });
    result.false_landmarks += right ? 0 : 1;
  }
  return result;
}

}  // namespace omnifleet::estimation::testing
