#include "trouble.h"

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

class Deceiver {
 public:
  explicit Deceiver(const Trouble& trouble) : trouble_(trouble) {}

  bool isDark(int f) const { return f >= trouble_.at_frame && f < trouble_.at_frame + trouble_.dark_frames; }
  int lastFrame() const {
    return trouble_.at_frame +
           std::max({trouble_.dark_frames, trouble_.gap_frames, trouble_.spin_frames - 1, 0});
  }
  bool deceives() const {
    return trouble_.moved_m > 0 || trouble_.spin_frames > 0 || trouble_.slip_m > 0 ||
           trouble_.wired != Wired::kRight;
  }
  bool isGap(int f) const { return f >= trouble_.at_frame && f < trouble_.at_frame + trouble_.gap_frames; }

  void deceive(std::vector<Objects>& frames, int f) const {
    Objects& first = frames.front();
    for (Objects& frame : frames) {
      if (!isDark(f) || (&frame != &first && !trouble_.all)) continue;
      frame.state = FrameState::kDark;
      frame.tracks.clear();
    }
    for (Objects& frame : frames) {
      if (!trouble_.new_tracks || f < lastFrame()) break;
      for (Track& track : frame.tracks) track.id += 500;
    }
    write(first.motion);
    if (f >= trouble_.at_frame && f < trouble_.at_frame + trouble_.spin_frames) {
      Motion& m = first.motion;
      m.left_m += trouble_.spin_m;
      m.previous_from_current = arc(m.left_m, m.right_m, kSeparation_m);
    }
    if (f != trouble_.at_frame || trouble_.slip_m <= 0) return;
    for (Objects& frame : frames) {
      if (&frame != &first && !trouble_.all) continue;
      frame.motion.left_m += trouble_.slip_m - 0.5 * kSlip_rad * kSeparation_m;
      frame.motion.right_m += trouble_.slip_m + 0.5 * kSlip_rad * kSeparation_m;
      frame.motion.previous_from_current = arc(frame.motion.left_m, frame.motion.right_m, kSeparation_m);
    }
  }

  /// What the wheels counted while nobody sent goes with the first frame after it.
  void bridge(std::vector<Objects>& frames, int f) {
    held_.resize(frames.size());
    for (std::size_t r = 0; r < frames.size(); ++r) {
      Motion& motion = frames[r].motion;
      if (held_[r].valid) append(held_[r], motion);
      if (isGap(f)) held_[r] = motion;
      if (!isGap(f)) held_[r] = {};
      if (f == lastFrame() && !trouble_.gap_wheels) motion = {};
    }
  }

 private:
  static void append(const Motion& before, Motion& motion) {
    motion.since_ns = before.since_ns;
    motion.covariance = composeCovariance(before.covariance, motion.previous_from_current, motion.covariance);
    motion.previous_from_current = before.previous_from_current * motion.previous_from_current;
    motion.left_m += before.left_m;
    motion.right_m += before.right_m;
  }

  void write(Motion& m) const {
    if (trouble_.wired == Wired::kRight) return;
    if (trouble_.wired == Wired::kSwapped || trouble_.wired == Wired::kBoth) std::swap(m.left_m, m.right_m);
    const bool reversed = trouble_.wired == Wired::kReversed || trouble_.wired == Wired::kBoth;
    if (reversed || trouble_.wired == Wired::kLeftReversed) m.left_m = -m.left_m;
    if (reversed || trouble_.wired == Wired::kRightReversed) m.right_m = -m.right_m;
    m.previous_from_current = arc(m.left_m, m.right_m, kSeparation_m);
  }

  Trouble trouble_;
  std::vector<Motion> held_;
};

}  // namespace

TroubleResult run(const Trouble& trouble, const EstimatorOptions& options, std::uint32_t seed) {
  SimulationOptions simulation = trouble.simulation;
  simulation.moved_at = trouble.at_frame + (trouble.dark_frames + trouble.gap_frames) / 2;
  if (trouble.moved_m == 0) simulation.moved_at = 0;
  simulation.moved_m = trouble.moved_m;
  simulation.moved_rad = trouble.turned_rad;
  simulation.all_moved = trouble.all && trouble.moved_m > 0;
  FleetSimulator simulator(simulation, seed);
  Deceiver deceiver(trouble);
  FleetEstimator estimator(simulator.setups(), options);
  TroubleResult result;
  const auto robots = static_cast<std::size_t>(trouble.simulation.robots);
  const std::size_t troubled = deceiver.deceives() ? (trouble.all ? robots : 1) : 0;
  std::vector<int> told(robots, -1);
  std::set<std::size_t> of_wheels;
  int valid = 0, frames_after = 0;
  for (int f = 0; f < trouble.simulation.frames; ++f) {
    auto frames = simulator.frames(f);
    deceiver.deceive(frames, f);
    deceiver.bridge(frames, f);
    if (deceiver.isGap(f)) continue;
    const auto poses = estimator.process(simulator.time(f), testing::pointers(frames), {});
    const int until = deceiver.lastFrame() + static_cast<int>(2.0 / trouble.simulation.period_s);
    for (std::size_t r = 0; r < robots; ++r) {
      const RobotStatus& status = estimator.status(FleetSimulator::name(static_cast<int>(r)));
      const bool says = status.state != RobotState::kOk || isKidnapping(status.message.code);
      result.by_hand += isKidnapping(status.message.code) ? 1 : 0;
      const bool due = r < troubled && f >= trouble.at_frame && f <= until;
      if (says && due && told[r] < 0) told[r] = f;
      const bool dark = (r == 0 || trouble.all) && deceiver.isDark(f);
      if (status.message.code == ErrorCode::kWheelAssignment) of_wheels.insert(r);
      if (says && !due && !dark) ++result.told_wrongly;
      if (f < trouble.at_frame || dark) continue;
      ++frames_after;
      if (!poses[r].valid) continue;
      ++valid;
      const Pose2 e = poses[r].map_from_base.inverse() * simulator.truth(static_cast<int>(r), f);
      result.mean_m += e.translation().norm();
      result.worst_m = std::max(result.worst_m, e.translation().norm());
      result.nees += evaluation::normalisedSquare(poses[r].map_from_base, poses[r].covariance,
                                                  simulator.truth(static_cast<int>(r), f));
      if (f == trouble.simulation.frames - 1)
        result.end_m += e.translation().norm() / static_cast<double>(robots);
    }
  }
  result.by_wheels = static_cast<int>(of_wheels.size());
  result.troubled = static_cast<int>(troubled);
  for (std::size_t r = 0; r < troubled; ++r) {
    if (told[r] < 0) continue;
    ++result.told;
    const int sees = trouble.at_frame + trouble.dark_frames + trouble.gap_frames;
    result.late_s +=
        std::max(0, told[r] - sees) * trouble.simulation.period_s / static_cast<double>(troubled);
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
