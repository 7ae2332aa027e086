#include "tests/benchmark/measure.h"

#include <malloc.h>
#include <sys/resource.h>
#include <time.h>

#include <algorithm>
#include <cmath>

namespace omnifleet::bench {
namespace {

std::int64_t readNs(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
}

long minorFaults() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt;
}

std::size_t heapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

}  // namespace

double threadCpuMs() {
  return 1e-6 * static_cast<double>(readNs(CLOCK_THREAD_CPUTIME_ID));
}

std::int64_t hostNs() {
  return readNs(CLOCK_MONOTONIC);
}

void Samples::add(double ms) {
  ms_.push_back(ms);
  state_.SetIterationTime(1e-3 * ms);
}

void reportPercentiles(std::vector<double> ms, benchmark::State& state) {
  std::sort(ms.begin(), ms.end());
  state.counters["p50_ms"] = percentile(ms, 0.50);
  state.counters["p99_ms"] = percentile(ms, 0.99);
}

void Samples::report(std::size_t round) {
  report();
  std::vector<double> medians;
  for (std::size_t frame = 0; frame < std::min(round, ms_.size()); ++frame) {
    std::vector<double> of_frame;
    for (std::size_t i = frame; i < ms_.size(); i += round) of_frame.push_back(ms_[i]);
    std::sort(of_frame.begin(), of_frame.end());
    medians.push_back(percentile(of_frame, 0.50));
  }
  std::sort(medians.begin(), medians.end());
  state_.counters["frame_p99_ms"] = percentile(medians, 0.99);
}

double percentile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::min(std::max<std::size_t>(rank, 1), sorted.size()) - 1];
}

MemoryWatch::MemoryWatch() : faults_(minorFaults()), heap_(heapBytes()) {}

void MemoryWatch::report(benchmark::State& state) const {
  state.counters["minor_faults"] = static_cast<double>(minorFaults() - faults_);
  state.counters["heap_bytes"] = static_cast<double>(heapBytes()) - static_cast<double>(heap_);
}

}  // namespace omnifleet::bench
