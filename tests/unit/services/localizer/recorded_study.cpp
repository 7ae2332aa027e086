// Prints what the estimator makes of recordings with cameras, ceiling cameras left out: recorded_study
// "OPTIONS;OPTIONS…" DATASET…, where OPTIONS is YAML of the estimator's options. The images are looked at
// once, with the first options.

#include <cstdio>
#include <sstream>

#include "dataset/ground_truth.h"
#include "recorded_line.h"

int main(int argc, char** argv) {
  using namespace omnifleet;
  using localizer::testing::RecordedRun;
  if (argc < 3) return 2;
  std::vector<std::pair<std::string, estimation::EstimatorOptions>> variants;
  std::istringstream all(argv[1]);
  for (std::string text; std::getline(all, text, ';');) {
    variants.emplace_back(
        text, estimation::EstimatorOptions::read(options::Section::parse("{" + text + "}", "options")));
  }
  std::vector<RecordedRun> sums(variants.size());
  for (int i = 2; i < argc; ++i) {
    const auto data = dataset::Dataset::open(argv[i]);
    const auto truth = dataset::GroundTruth::load(argv[i]).trajectories;
    std::vector<localizer::testing::RecordedTime> times;
    for (std::size_t v = 0; v < variants.size(); ++v) {
      const RecordedRun run =
          v == 0 ? localizer::testing::runRecorded(data, variants[v].second, false, truth, &times)
                 : localizer::testing::runFrames(data, times, variants[v].second, truth);
      std::printf("%-40s %-30s path %.2f worst %.2f cm  %.2f deg  NEES %.2f heading %.2f |", argv[i],
                  variants[v].first.c_str(), 100 * run.mean_m, 100 * run.worst_m, 57.2958 * run.worst_rad,
                  run.nees, run.heading_nees);
      for (const auto& [robot, e] : run.cameras)
        std::printf(" %s %.1f %.1f %.1f %.1f", robot.c_str(), 1e3 * e(0), 1e3 * e(1), 1e3 * e(2), 1e3 * e(3));
      std::printf("\n");
      std::fflush(stdout);
      sums[v].mean_m += run.mean_m / (argc - 2);
      sums[v].worst_m = std::max(sums[v].worst_m, run.worst_m);
      sums[v].nees += run.nees / (argc - 2);
      sums[v].heading_nees += run.heading_nees / (argc - 2);
    }
  }
  for (std::size_t v = 0; v < variants.size(); ++v) {
    std::printf("%-30s mean %.3f cm  worst %.2f cm  NEES %.2f  heading %.2f\n", variants[v].first.c_str(),
                100 * sums[v].mean_m, 100 * sums[v].worst_m, sums[v].nees, sums[v].heading_nees);
  }
}
