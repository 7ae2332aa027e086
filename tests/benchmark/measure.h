#pragma once

#include <benchmark/benchmark.h>

#include <cstdint>
#include <exception>
#include <vector>

namespace omnifleet::bench {

/// Extent of a run. smoke: four iterations per benchmark, to check that it works.
struct Plan {
  bool smoke = false;
  int iterations(int full) const { return smoke ? 4 : full; }
};

/// CPU time of this thread, milliseconds, from an arbitrary zero. Time of other programs does not count.
double threadCpuMs();
/// Monotonic clock of the host, nanoseconds, common to all processes.
std::int64_t hostNs();

/// Sets the counters p50_ms and p99_ms (nearest rank).
void reportPercentiles(std::vector<double> ms, benchmark::State& state);

/// Times of the iterations of one benchmark.
class Samples {
 public:
  explicit Samples(benchmark::State& state) : state_(state) {}
  /// Reserves memory for all iterations, so that MemoryWatch does not count it.
  void reserve() { ms_.reserve(static_cast<std::size_t>(state_.max_iterations)); }
  /// Adds one iteration and sets it as Google Benchmark's manual time.
  void add(double ms);
  void report() { reportPercentiles(ms_, state_); }
  /// For samples that repeat the same `round` frames: also sets frame_p99_ms, the p99 over the frames of each
  /// frame's median over the rounds. Other load on the machine increases p99_ms, but hardly frame_p99_ms.
  void report(std::size_t round);

 private:
  benchmark::State& state_;
  std::vector<double> ms_;
};

/// Runs the body of a benchmark. An exception becomes an error of this benchmark; the others still run.
template <class Body>
void guarded(benchmark::State& state, const Body& body) {
  try {
    body();
  } catch (const std::exception& problem) {
    state.SkipWithError(problem.what());
  }
}

/// Value at a share (0–1) of sorted samples, nearest rank; 0 without samples.
double percentile(const std::vector<double>& sorted, double share);

/// Counts minor page faults of this thread and the change of the heap (bytes) since construction.
class MemoryWatch {
 public:
  MemoryWatch();
  /// Sets the counters minor_faults and heap_bytes: totals since construction.
  void report(benchmark::State& state) const;

 private:
  long faults_;
  std::size_t heap_;
};

}  // namespace omnifleet::bench
