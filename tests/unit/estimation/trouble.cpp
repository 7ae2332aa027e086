#include "trouble.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "estimation/factors.h"
#include "evaluation/consistency.h"

namespace omnifleet::estimation::testing {
namespace {

constexpr double kSeparation_m = 0.26, kSlip_rad = 0.1;

class Deceiver {
 public:
  explicit Deceiver(const Trouble& trouble) : trouble_(trouble) {}

  bool isDark(int f) const { return f >= trouble_.at_frame && f < trouble_.at_frame + trouble_.dark_frames; }
  int lastFrame() const {
    return trouble_.at_frame + std::max({trouble_.dark_frames, trouble_.spin_frames - 1, 0});
  }
  bool deceives() const { return trouble_.moved_m > 0 || trouble_.spin_frames > 0 || trouble_.slip_m > 0; }

  void deceive(std::vector<Objects>& frames, int f) const {
    Objects& first = frames.front();
    if (isDark(f)) {
      first.state = FrameState::kDark;
      first.tracks.clear();
    }
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

 private:
  Trouble trouble_;
};

}  // namespace

TroubleResult run(const Trouble& trouble, const EstimatorOptions& options, std::uint32_t seed) {
  SimulationOptions simulation = trouble.simulation;
  simulation.moved_at = trouble.at_frame + trouble.dark_frames / 2;
  if (trouble.moved_m == 0) simulation.moved_at = 0;
  simulation.moved_m = trouble.moved_m;
  simulation.moved_rad = trouble.turned_rad;
  FleetSimulator simulator(simulation, seed);
  const Deceiver deceiver(trouble);
  FleetEstimator estimator(simulator.setups(), options);
  TroubleResult result;
  const auto robots = static_cast<std::size_t>(trouble.simulation.robots);
  const std::size_t troubled = deceiver.deceives() ? (trouble.all ? robots : 1) : 0;
  std::vector<int> told(robots, -1);
  int valid = 0, frames_after = 0;
  for (int f = 0; f < trouble.simulation.frames; ++f) {
    auto frames = simulator.frames(f);
    deceiver.deceive(frames, f);
    const auto poses = estimator.process(simulator.time(f), testing::pointers(frames), {});
    const int until = deceiver.lastFrame() + static_cast<int>(2.0 / trouble.simulation.period_s);
    for (std::size_t r = 0; r < robots; ++r) {
      const RobotStatus& status = estimator.status(FleetSimulator::name(static_cast<int>(r)));
      const bool says = status.state != RobotState::kOk || status.text.find("hand") != std::string::npos;
      result.by_hand += status.text.find("hand") != std::string::npos ? 1 : 0;
      const bool due = r < troubled && f >= trouble.at_frame && f <= until;
      if (says && due && told[r] < 0) told[r] = f;
      const bool dark = r == 0 && deceiver.isDark(f);
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
  result.troubled = static_cast<int>(troubled);
  for (std::size_t r = 0; r < troubled; ++r) {
    if (told[r] < 0) continue;
    ++result.told;
    const int sees = trouble.at_frame + trouble.dark_frames;
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
