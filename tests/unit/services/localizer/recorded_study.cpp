// Prints figures of the estimator on recordings with cameras, without ceiling cameras: recorded_study [-n N |
// -p] "OPTIONS;OPTIONS…" DATASET…, where OPTIONS is YAML of the estimator's options. The images are processed
// once, with the first options.
//   -n N   N runs of each recording, with random errors of the initial poses and calibrations, drawn as the
//          first options state. NEES shows whether covariances are consistent only if the given values have
//          the stated errors. With exact initial poses every consistent estimate appears too pessimistic.

//   -p     also prints each pose: robot, time, error, σ, NEES, state, event

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sstream>

#include "dataset/ground_truth.h"
#include "evaluation/consistency.h"
#include "recorded_line.h"

namespace {
using namespace omnifleet;
using localizer::testing::RecordedRun;

struct Variant {
  std::string name;
  estimation::EstimatorOptions options;
  RecordedRun sum;
  double squares = 0.0;  ///< sum of squares of the runs' NEES
  int runs = 0;
};

std::vector<Variant> variantsOf(const std::string& texts) {
  std::vector<Variant> variants;
  std::istringstream all(texts);
  for (std::string text; std::getline(all, text, ';');) {
    variants.push_back(
        {text, estimation::EstimatorOptions::read(options::Section::parse("{" + text + "}", "options")), {}});
  }
  return variants;
}

/// Adds errors to initial poses and calibrations, with the standard deviations that the options state.
void addErrors(dataset::Dataset& data, const estimation::EstimatorOptions& o, std::mt19937& random) {
  std::normal_distribution<double> unit(0.0, 1.0);
  for (auto& robot : data.robots) {
    auto& camera = robot.fisheye->camera;
    camera.focal_px *= 1.0 + o.camera.focal_sigma * unit(random);
    camera.position_m.z() *= 1.0 + o.camera.height_sigma * unit(random);
    camera.rotation_rpy_deg.x() += o.camera.tilt_sigma_rad * unit(random) * 180.0 / M_PI;
    camera.rotation_rpy_deg.y() += o.camera.tilt_sigma_rad * unit(random) * 180.0 / M_PI;
    const double x = o.initial_sigma_m * unit(random), y = o.initial_sigma_m * unit(random);
    if (robot.initial_pose)
      robot.initial_pose = *robot.initial_pose * Pose2{x, y, o.initial_sigma_rad * unit(random)};
  }
}

void add(Variant& variant, const RecordedRun& run) {
  variant.sum.mean_m += run.mean_m;
  variant.sum.worst_m = std::max(variant.sum.worst_m, run.worst_m);
  variant.sum.nees += run.nees;
  variant.sum.heading_nees += run.heading_nees;
  variant.squares += run.nees * run.nees;
  ++variant.runs;
}

void print(const std::string& name, const Variant& variant, const RecordedRun& run) {
  std::printf("%-40s %-30s path %.2f worst %.2f cm  %.2f deg  NEES %.2f heading %.2f |", name.c_str(),
              variant.name.c_str(), 100 * run.mean_m, 100 * run.worst_m, 57.2958 * run.worst_rad, run.nees,
              run.heading_nees);
  for (const auto& [robot, e] : run.cameras)
    std::printf(" %s %.1f %.1f %.1f %.1f", robot.c_str(), 1e3 * e(0), 1e3 * e(1), 1e3 * e(2), 1e3 * e(3));
  std::printf("\n");
  std::fflush(stdout);
}

void printPoses(const RecordedRun& run) {
  for (const auto& [pose, error, nees] : run.compared) {
    std::printf("  %s %.2f s  %.2f cm %.3f deg  sigma %.2f cm %.3f deg  NEES %.1f  %s %s %.1f\n",
                pose.robot.c_str(), 1e-9 * static_cast<double>(pose.acquired_ns),
                100 * error.translation().norm(), 57.2958 * std::abs(error.theta_rad),
                100 * std::sqrt(pose.covariance.topLeftCorner<2, 2>().trace()),
                57.2958 * std::sqrt(pose.covariance(2, 2)), nees, toString(pose.state), toString(pose.event),
                pose.correction_sigmas);
  }
}

/// By robot: poses, invalid ones, mean and largest error, NEES.
void printRobots(const RecordedRun& run) {
  std::map<std::string, RecordedRun> by_robot;
  for (const auto& [pose, error, nees] : run.compared) {
    RecordedRun& r = by_robot[pose.robot];
    ++r.poses;
    r.mean_m += error.translation().norm();
    r.worst_m = std::max(r.worst_m, error.translation().norm());
    r.worst_rad = std::max(r.worst_rad, std::abs(error.theta_rad));
    r.nees += nees;
    r.invalid += pose.state == LocalizationState::kLocalized ? 0 : 1;
  }
  for (const auto& [robot, r] : by_robot)
    std::printf("    %s: %d poses, %d not localized, %.2f / %.2f cm, %.3f deg, NEES %.2f\n", robot.c_str(),
                r.poses, r.invalid, 100 * r.mean_m / r.poses, 100 * r.worst_m, 57.2958 * r.worst_rad,
                r.nees / r.poses);
}

}  // namespace

int main(int argc, char** argv) {
  int first = 1, draws = 0;
  const bool poses = argc > 2 && std::string(argv[1]) == "-p";
  if (poses) first = 2;
  if (argc > 3 && std::string(argv[1]) == "-n") draws = std::atoi(argv[2]), first = 3;
  if (argc < first + 2) return 2;
  std::vector<Variant> variants = variantsOf(argv[first]);
  for (int i = first + 1; i < argc; ++i) {
    const auto truth = dataset::GroundTruth::load(argv[i]).trajectories;
    for (int draw = 0; draw < std::max(1, draws); ++draw) {
      auto data = dataset::Dataset::open(argv[i]);
      std::mt19937 random(static_cast<std::uint32_t>(1000 * i + draw));
      if (draws > 0) addErrors(data, variants.front().options, random);
      std::vector<localizer::testing::RecordedTime> times;
      for (std::size_t v = 0; v < variants.size(); ++v) {
        const RecordedRun run =
            v == 0 ? localizer::testing::runRecorded(data, variants[v].options, false, truth, &times)
                   : localizer::testing::runFrames(data, times, variants[v].options, truth);
        print(argv[i], variants[v], run);
        printRobots(run);
        if (poses) printPoses(run);
        add(variants[v], run);
      }
    }
  }
  for (const Variant& v : variants) {
    const double n = v.runs, nees = v.sum.nees / n;
    std::printf("%-30s mean %.3f cm  worst %.2f cm  NEES %.2f ± %.2f  heading %.2f\n", v.name.c_str(),
                100 * v.sum.mean_m / n, 100 * v.sum.worst_m, nees,
                std::sqrt(std::max(0.0, v.squares / n - nees * nees) / std::max(1.0, n - 1.0)),
                v.sum.heading_nees / n);
  }
}
