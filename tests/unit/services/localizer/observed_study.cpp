// Prints figures of the estimator on a recording of wheels, ranges and bearings:
// observed_study DATASET [OPTIONS.yaml] [seconds]. Uses landmarks.yaml of the dataset if it exists. DATASET
// may be simulate:SEED (unknown landmarks) or surveyed:SEED.

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "dataset/ground_truth.h"
#include "evaluation/consistency.h"
#include "evaluation/trajectory_metrics.h"
#include "observed_fleet.h"
#include "observed_run.h"

int main(int argc, char** argv) {
  using namespace omnifleet;
  if (argc < 2) return 2;
  dataset::Dataset recording;
  dataset::GroundTruth truth;
  const std::string source = argv[1];
  if (const auto colon = source.find(':'); colon != std::string::npos) {
    const auto seed = static_cast<std::uint32_t>(std::atoi(source.c_str() + colon + 1));
    const localizer::testing::ObservedFleet fleet({}, seed);
    recording = fleet.recording;
    truth.trajectories = fleet.truth;
    truth.scene = fleet.scene;
    if (source.compare(0, colon, "simulate") == 0) recording.landmarks.clear();
  } else {
    recording = dataset::Dataset::open(source);
    truth = dataset::GroundTruth::load(source);
  }
  localizer::testing::ObservedRunOptions options;
  options.survey = !recording.landmarks.empty();
  if (argc > 2 && argv[2][0] != '\0')
    options.estimator = estimation::EstimatorOptions::read(options::Section::load(argv[2]));
  if (argc > 3) options.until_s = std::atof(argv[3]);
  const auto begun = std::chrono::steady_clock::now();
  const auto run = localizer::testing::runObserved(recording, options, truth.trajectories);
  const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  const Pose2 aligned = localizer::testing::alignToTruth(run, truth.trajectories);
  const auto estimatedPath = [&](const std::string& name) {
    return evaluation::EstimatedPath{truth.trajectories.at(name), run.trajectories.at(name),
                                     run.covariances.at(name)};
  };
  std::vector<evaluation::EstimatedPath> fleet;
  for (const auto& entry : run.trajectories) fleet.push_back(estimatedPath(entry.first));
  const auto places = options.survey ? evaluation::DatumPlaces{} : evaluation::placeData(fleet);
  double mean = 0.0, mean_aligned = 0.0;
  for (const auto& [name, path] : run.trajectories) {
    auto moved = path;
    for (auto& pose : moved) pose.map_from_base = aligned * pose.map_from_base;
    const auto plain = evaluation::comparePaths(truth.trajectories.at(name), path);
    const auto free = evaluation::comparePaths(truth.trajectories.at(name), moved);
    const auto& w = run.wheels.at(name);
    const auto& d = run.detectors.at(name);
    const auto& s = run.status.at(name);
    const Eigen::Vector3d parts = run.parts.count(name) > 0 ? run.parts.at(name) : Eigen::Vector3d::Zero();
    const auto nees = evaluation::checkConsistency(estimatedPath(name), places);
    std::printf("%s poses %5d  mean %.4f m  rmse %.4f  max %.3f  aligned %.4f  heading %.3f\n", name.c_str(),
                plain.poses, plain.distance_m, plain.rmse_m, plain.max_m, free.distance_m, plain.heading_rad);
    std::printf("   NEES %.2f, x y %.2f (%.1f %.1f %.1f), %.2f to %.2f of %.0f, %.1f %% inside\n", nees.mean,
                nees.position, parts(0), parts(1), parts(2), nees.bounds.lower, nees.bounds.upper,
                nees.independent, 100 * nees.inside);
    std::printf("   wheels %.3f %.3f %.3f %.3f %.4f | detector %.4f %.4f %.4f %.3f %.4f %.3f %.3f %.3f\n",
                w(0), w(1), w(2), w(3), w(4), d(0), d(1), d(2), d(3), d(4), d(5), d(6), d(7));
    std::printf("   slips %d losses %d rejected %d\n", s.slips, s.losses, s.rejected_measurements);
    mean += plain.distance_m / static_cast<double>(run.trajectories.size());
    mean_aligned += free.distance_m / static_cast<double>(run.trajectories.size());
  }
  double landmarks = 0.0;
  int found = 0;
  for (const auto& point : run.points) {
    for (const auto& object : truth.scene) {
      if (object.name != point.name) continue;
      landmarks += (aligned * point.position_m - object.centroid_m).norm();
      ++found;
    }
  }
  const evaluation::Consistency fleet_nees = evaluation::checkFleet(fleet, places);
  std::printf("NEES %.2f, x y %.2f, %.2f to %.2f of %.0f, %.1f %% inside\n", fleet_nees.mean,
              fleet_nees.position, fleet_nees.bounds.lower, fleet_nees.bounds.upper, fleet_nees.independent,
              100 * fleet_nees.inside);
  std::printf("mean %.4f m, aligned %.4f m; landmarks %d of %zu, mean %.4f m (aligned); %.1f s\n", mean,
              mean_aligned, found, truth.scene.size(), landmarks / std::max(1, found), took);
}
