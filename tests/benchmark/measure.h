#pragma once

#include <benchmark/benchmark.h>

#include <cstdint>
#include <exception>
#include <vector>

namespace omnifleet::bench {

/// How much is measured: everything, or each benchmark a moment long to see that it works.
struct Plan {
  bool smoke = false;
  int iterations(int full) const { return smoke ? 4 : full; }
};

/// CPU time of this thread since some moment, milliseconds: other programs on the machine do not count.
double threadCpuMs();
/// The host's monotonic clock, nanoseconds: the same in every process.
std::int64_t hostNs();

/// Order statistics as counters p50_ms and p99_ms (nearest rank).
void reportPercentiles(std::vector<double> ms, benchmark::State& state);

/// What each iteration took.
class Samples {
 public:
  explicit Samples(benchmark::State& state) : state_(state) {}
  /// Room for all iterations, so that measuring the heap does not measure this.
  void reserve() { ms_.reserve(static_cast<std::size_t>(state_.max_iterations)); }
  /// One iteration's time; also Google Benchmark's (manual time).
  void add(double ms);
  void report() { reportPercentiles(ms_, state_); }
  /// Of samples that go round after round over the same frames, also frame_p99_ms: the p99 over the frames of
  /// each one's median over the rounds. It is the program's own; p99_ms is also that of a machine with other
  /// work.
  void report(std::size_t round);

 private:
  benchmark::State& state_;
  std::vector<double> ms_;
};

/// Runs a benchmark's body; an exception is that benchmark's error, not the end of all.
template <class Body>
void guarded(benchmark::State& state, const Body& body) {
  try {
    body();
  } catch (const std::exception& problem) {
    state.SkipWithError(problem.what());
  }
}

/// Value at a share 0–1 of sorted samples, nearest rank; 0 where there are none.
double percentile(const std::vector<double>& sorted, double share);

/// Page faults of this thread and bytes on the heap since construction.
class MemoryWatch {
 public:
  MemoryWatch();
  /// Counters minor_faults and heap_bytes: totals over the loop.
  void report(benchmark::State& state) const;

 private:
  long faults_;
  std::size_t heap_;
};

}  // namespace omnifleet::bench
