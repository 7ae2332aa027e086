#pragma once

#include <benchmark/benchmark.h>

#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace omnifleet::bench {

/// Console reporter of Google Benchmark that also stores the counters for a final table.
class Summary : public benchmark::ConsoleReporter {
 public:
  Summary() : ConsoleReporter(OO_Tabular) {}
  void ReportRuns(const std::vector<Run>& runs) override;

  /// Prints for each row the value of omnifleet and of the peer, their ratio, the budget
  /// (docs/methods/evaluation.md, "Acceptance targets"), and whether it is met. Rows whose benchmark did not
  /// run are left out.
  void printTable(std::FILE* out) const;
  bool failed() const { return !errors_.empty(); }

 private:
  /// Median over the repetitions. Empty if the benchmark did not run or failed.
  std::optional<double> counter(const std::string& benchmark, const std::string& name) const;

  std::map<std::string, std::map<std::string, std::vector<double>>>
      counters_;  ///< by benchmark and counter, one value per repetition
  std::vector<std::string> errors_;
};

}  // namespace omnifleet::bench
