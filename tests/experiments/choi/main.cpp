// Experiments of Choi et al. 2014, §V. `seed` runs the arenas of one seed. `report` prints the tables of all
// seeds and draws their figures.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

#include "dataset/atomic_file.h"
#include "figures.h"
#include "options/options.h"
#include "options/range_check.h"
#include "seed_run.h"
#include "table.h"

namespace {

using namespace omnifleet::choi;
using omnifleet::options::within;
namespace fs = std::filesystem;

std::string resultFile(const std::string& out, std::uint32_t seed) {
  return out + "/seeds/" + std::to_string(seed) + "/result.json";
}

/// True if a result with the same settings exists.
bool isDone(const SeedOptions& options, const std::string& file) {
  if (!fs::exists(file)) return false;
  try {
    return SeedResult::load(file).settings == settingsOf(options) &&
           (options.figures.empty() || fs::exists(options.figures + "/fig22_path_errors.png"));
  } catch (const std::exception&) {
    return false;
  }
}

int runOne(SeedOptions options, const std::string& out, bool verbose) {
  const std::string file = resultFile(out, options.seed);
  options.folder = fs::path(file).parent_path().string();
  if (!options.figures.empty()) omnifleet::dataset::makeDirectories(options.figures);
  if (!isDone(options, file)) {
    const SeedResult result = runSeed(options, [&](const std::string& what) {
      if (verbose) std::fprintf(stderr, "seed %u: %s\n", options.seed, what.c_str());
    });
    result.save(file);
  }
  std::printf("seed %u: %s\n", options.seed, summary(SeedResult::load(file)).c_str());
  return 0;
}

int reportAll(const std::string& out, std::uint32_t first, std::uint32_t last) {
  std::vector<SeedResult> results;
  for (std::uint32_t seed = first; seed <= last; ++seed) {
    if (fs::exists(resultFile(out, seed))) results.push_back(SeedResult::load(resultFile(out, seed)));
  }
  if (results.empty())
    throw std::runtime_error(out + ": no results of seeds " + std::to_string(first) + " to " +
                             std::to_string(last) + "; run `seed` first");
  const std::string text = report(results);
  std::fputs(text.c_str(), stdout);
  omnifleet::dataset::writeAtomic(out + "/table1.txt", text);
  drawTeams(results, out + "/robots.png");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The experiments of Choi et al. 2014 in simulated rooms");
  app.require_subcommand(1);
  std::string out;
  SeedOptions options;
  bool verbose = false, with_figures = false;
  auto* seed =
      app.add_subcommand("seed", "run one seed: render its rooms, replay them, compare with the truth");
  seed->add_option("SEED", options.seed, "seed of the rooms and of the noise")->required();
  seed->add_option("--config", options.config, "path of the folder config/")->required();
  seed->add_option("--image-scale", options.image_scale, "factor on the image size of all cameras")
      ->check(within({0.1, 2.0}));
  seed->add_option("--duration", options.duration_s, "longest drive, s")->check(within({0.1, 3600.0}));
  seed->add_flag("--figures", with_figures, "draw the figures");
  seed->add_flag("--keep", options.keep, "keep recordings and runs");
  seed->add_flag("--verbose", verbose, "print each step");
  std::uint32_t first = 1000, last = 1019;
  auto* all = app.add_subcommand("report", "print the tables of all finished seeds");
  all->add_option("--first", first, "first seed");
  all->add_option("--last", last, "last seed");
  for (auto* command : {seed, all})
    command->add_option("--out", out, "folder of the results")
        ->required()
        ->check(omnifleet::options::notEmpty());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    if (with_figures) options.figures = out + "/figures";
    return seed->parsed() ? runOne(options, out, verbose) : reportAll(out, first, last);
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "choi_experiment: %s\n", error.what());
    return 1;
  }
}
