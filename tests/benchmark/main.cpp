// Every hot path beside its naive peer in one run; ends with a table of ratios and budgets.
// Exits with 1 when a benchmark reports an error, e.g. that the two of a pair do not do the same work.

#include <malloc.h>

#include <cstring>
#include <opencv2/core/utility.hpp>

#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/summary.h"

constexpr int kLargest_bytes = 32 << 20;  // that malloc accepts
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
  cv::setNumThreads(1);  // one core, and thread CPU time sees all of it
  // What is freed stays with the process: whether a peer's temporary images cost page faults (a third of the
  // naive mapper's time) would else depend on what happens to lie behind them on the heap.
  mallopt(M_MMAP_THRESHOLD, kLargest_bytes);
  mallopt(M_TRIM_THRESHOLD, kKept_bytes);
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
