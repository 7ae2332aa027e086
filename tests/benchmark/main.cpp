// Runs every hot path and its naive peer, then prints a table of ratios and budgets.
// Returns 1 if a benchmark reports an error, e.g. if the two of a pair do different work.

#include <malloc.h>

#include <cstring>
#include <opencv2/core/utility.hpp>

#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/summary.h"

constexpr int kLargest_bytes = 32 << 20;  // largest M_MMAP_THRESHOLD that malloc accepts
constexpr int kKept_bytes = 1 << 30;

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
  cv::setNumThreads(1);  // one core, so that the thread's CPU time contains all work
  // Freed memory stays with the process. Otherwise the heap layout decides whether temporary images of a peer
  // cost page faults (a third of the naive mapper's time).
  mallopt(M_MMAP_THRESHOLD, kLargest_bytes);
  mallopt(M_TRIM_THRESHOLD, kKept_bytes);
  Scenes scenes(plan.smoke);
  registerLocalMapper(scenes, plan);
  registerMap(plan);
  registerStages(scenes, plan);
  registerImages(scenes, plan);
  registerDistanceVector(plan);
  registerFloorMotion(plan);
  registerAppearance(plan);
  registerTransport(plan);
  registerFleet(scenes, plan);
  Summary summary;
  benchmark::RunSpecifiedBenchmarks(&summary);
  benchmark::Shutdown();
  summary.printTable(stdout);
  return summary.failed() ? 1 : 0;
}
