#pragma once

#include <benchmark/benchmark.h>

#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::bench {

/// Google Benchmark's console, which also remembers the counters for a table at the end.
class Summary : public benchmark::ConsoleReporter {
 public:
  Summary() : ConsoleReporter(OO_Tabular) {}
  void ReportRuns(const std::vector<Run>& runs) override;

  /// Benchmark, ours, peer, ratio, budget (docs/methods.md, "What it must reach"), whether it is reached.
  /// Rows whose benchmark did not run are left out.
  void printTable(std::FILE* out) const;
  bool failed() const { return !errors_.empty(); }

 private:
  /// Median over repetitions; nothing where it did not run or failed.
  std::optional<double> counter(const std::string& benchmark, const std::string& name) const;

  std::map<std::string, std::map<std::string, std::vector<double>>>
      counters_;  ///< benchmark, counter, repetition
  std::vector<std::string> errors_;
};

}  // namespace omnifleet::bench
