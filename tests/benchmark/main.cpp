// Every hot path beside its naive peer in one run; ends with a table of ratios and budgets.
// Exits with 1 when a benchmark reports an error, e.g. that the two of a pair do not do the same work.

#include <cstring>
#include <opencv2/core/utility.hpp>

#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/summary.h"

int main(int argc, char** argv) {
  using namespace omnifleet::bench;
  Plan plan;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--smoke") != 0) continue;
    plan.smoke = true;
    std::rotate(argv + i, argv + i + 1, argv + argc);
    --argc;
    break;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  cv::setNumThreads(1);  // one core, and thread CPU time sees all of it
  Scenes scenes(plan.smoke);
  registerLocalMapper(scenes, plan);
  registerMap(plan);
  registerStages(scenes, plan);
  registerImages(scenes, plan);
  registerTransport(plan);
  registerFleet(scenes, plan);
  Summary summary;
  benchmark::RunSpecifiedBenchmarks(&summary);
  benchmark::Shutdown();
  summary.printTable(stdout);
  return summary.failed() ? 1 : 0;
}
