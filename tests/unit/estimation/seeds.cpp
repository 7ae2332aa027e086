// Prints the errors of many seeded runs: estimation_seeds FIRST LAST. For tuning (0–99) and for reports
// (1000–1099).

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "fleet_simulator.h"

using omnifleet::estimation::EstimatorOptions;
using namespace omnifleet::estimation::testing;

namespace {

const Eigen::Vector4d kCalibrationSigma(0.003, 0.004, 0.0035, 0.0035);

void uncertainInitialPose(SimulationOptions& s) {
  s.initial_sigma_m = 0.005;
  s.initial_sigma_rad = 0.00524;
}

}  // namespace

int main(int argc, char** argv) {
  const auto first = static_cast<std::uint32_t>(argc > 1 ? std::atoi(argv[1]) : 0);
  const auto last = static_cast<std::uint32_t>(argc > 2 ? std::atoi(argv[2]) : 9);
  struct Case {
    const char* name;
    std::function<void(SimulationOptions&, EstimatorOptions&)> change;
  };
  const std::vector<Case> cases{
      {"wheels", [](auto& s, auto&) { s.obstacles_seen = s.robots_seen = false; }},
      {"wheels+sightings", [](auto& s, auto&) { s.obstacles_seen = false; }},
      {"wheels+obstacles", [](auto& s, auto&) { s.robots_seen = false; }},
      {"all", [](auto&, auto&) {}},
      {"no wheels", [](auto& s, auto&) { s.wheels = false; }},
      {"sightings only", [](auto& s, auto&) { s.wheels = s.obstacles_seen = false; }},
      {"initial pose uncertain", [](auto& s, auto&) { uncertainInitialPose(s); }},
      {"calibration errors", [](auto& s, auto&) { s.camera_sigma = kCalibrationSigma; }},
      {"both", [](auto& s, auto&) {
         uncertainInitialPose(s);
         s.camera_sigma = kCalibrationSigma;
       }}};
  std::printf("%-24s %8s %8s %8s %8s %8s %9s %6s %6s  %s\n", "case", "mean cm", "worst", "deg", "NEES",
              "heading", "landm cm", "n/run", "valid", "camera rms (1e-3)");
  for (const Case& c : cases) {
    if (argc > 3 && std::string(c.name) != argv[3]) continue;
    SimulationOptions simulation;
    EstimatorOptions options;
    if (std::getenv("WINDOW") != nullptr) options.window_frames = std::atoi(std::getenv("WINDOW"));
    if (std::getenv("FACTOR") != nullptr) options.view_sigma_factor = std::atof(std::getenv("FACTOR"));
    if (std::getenv("CAMERAS") != nullptr) options.camera.estimate = std::atoi(std::getenv("CAMERAS")) != 0;
    c.change(simulation, options);
    RunResult sum;
    for (std::uint32_t seed = first; seed <= last; ++seed) {
      const RunResult r = run(simulation, options, seed);
      if (std::getenv("EACH") != nullptr)
        std::printf("  %u: %.3f %.3f nees %.2f lm %.3f (%d)\n", seed, 100 * r.mean_m, 100 * r.worst_m, r.nees,
                    100 * r.landmark_m, r.landmarks);
      sum.mean_m += r.mean_m;
      sum.worst_m = std::max(sum.worst_m, r.worst_m);
      sum.mean_rad += r.mean_rad;
      sum.nees += r.nees;
      sum.heading_nees += r.heading_nees;
      sum.camera += r.camera;
      sum.landmark_m += r.landmark_m;
      sum.landmarks += r.landmarks;
      sum.estimates += r.estimates;
      sum.frames += r.frames;
    }
    const double n = last - first + 1;
    const Eigen::Vector4d camera = 1e3 * sum.camera / n;
    std::printf("%-24s %8.3f %8.3f %8.3f %8.2f %8.2f %9.3f %6.2f %6.3f  %.1f %.1f %.1f %.1f\n", c.name,
                100 * sum.mean_m / n, 100 * sum.worst_m, sum.mean_rad / n * 57.2958, sum.nees / n,
                sum.heading_nees / n, 100 * sum.landmark_m / n, sum.landmarks / n,
                static_cast<double>(sum.estimates) / sum.frames, camera(0), camera(1), camera(2), camera(3));
    std::fflush(stdout);
  }
}
