// Two robots with rendered forward cameras explore arenas of blocks (Ahmed et al. 2013 §3 and its future
// work). Prints one row per seed and a summary. scripts/experiments/exploration.sh builds and runs it.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <vector>

#include "options/options.h"
#include "options/range_check.h"
#include "tests/experiments/exploration/arena.h"
#include "tests/experiments/exploration/run.h"

namespace {

using namespace omnifleet::exploration;

/// Seeds that fulfil the requirement of Ahmed et al. 2013's future work as a number.
bool isComplete(const Outcome& o) {
  return o.ended && o.collisions == 0 && o.gap_m > 0.0 && o.coverage.covered_share >= 0.98;
}

void summarise(std::vector<Outcome> outcomes) {
  if (outcomes.empty()) return;
  const auto complete = std::count_if(outcomes.begin(), outcomes.end(), isComplete);
  std::sort(outcomes.begin(), outcomes.end(),
            [](const auto& a, const auto& b) { return a.coverage.covered_share < b.coverage.covered_share; });
  const std::size_t half = outcomes.size() / 2;
  const double median = 0.5 * (outcomes[half].coverage.covered_share +
                               outcomes[outcomes.size() % 2 == 0 ? half - 1 : half].coverage.covered_share);
  std::printf("%ld of %zu seeds: ended, no collision, >= 98 %% mapped; least %.2f %%, median %.2f %%\n",
              complete, outcomes.size(), 100.0 * outcomes.front().coverage.covered_share, 100.0 * median);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Exploration with forward cameras in simulated arenas");
  std::uint32_t first = 1000, last = 1019;
  double longest_s = 261.0;  // the paper's robots took 4 min 21 s
  std::string out, arenas;
  app.add_option("--first", first, "first seed");
  app.add_option("--last", last, "last seed");
  app.add_option("--longest-s", longest_s, "longest run, s");
  app.add_option("--arenas", arenas, "folder with ahmed.yaml and ahmed2.yaml")->required();
  app.add_option("--out", out, "folder of the runs")->required()->check(omnifleet::options::notEmpty());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::fputs(heading().c_str(), stdout);
  std::vector<Outcome> outcomes;
  try {
    for (std::uint32_t seed = first; seed <= last; ++seed) {
      const std::string folder = out + "/seed_" + std::to_string(seed);
      outcomes.push_back(explore(seed, writeFleet(seed, arenas, longest_s, folder), folder + "/run"));
      std::fputs(row(outcomes.back()).c_str(), stdout);
      std::fflush(stdout);
    }
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "exploration_experiment: %s\n", error.what());
    return 1;
  }
  summarise(outcomes);
  return std::all_of(outcomes.begin(), outcomes.end(), isComplete) ? 0 : 1;
}
