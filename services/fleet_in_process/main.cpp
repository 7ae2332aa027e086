// Runs all stages of a fleet in one process on the fake bus, for tests, seeds and experiments.

#include <CLI/CLI.hpp>
#include <cstdio>

#include "fleet_in_process/in_process.h"
#include "options/range_check.h"

int main(int argc, char** argv) {
  CLI::App app{"Runs a whole fleet in one process, with a recording or an arena"};
  omnifleet::services::InProcessRun run;
  auto* dataset =
      app.add_option("--dataset", run.dataset, "recording to replay")->check(omnifleet::options::notEmpty());
  app.add_option("--fleet", run.fleet_file, "fleet file")
      ->excludes(dataset)
      ->check(omnifleet::options::notEmpty());
  app.add_option("--config", run.overlays, "YAML on top of the fleet file; repeatable");
  app.add_option("--out", run.out, "run directory")->required()->check(omnifleet::options::notEmpty());
  app.add_option("--log-level", run.log_level, "trace, debug, info, warn, error");
  try {
    app.parse(argc, argv);
    if (run.dataset.empty() && run.fleet_file.empty()) throw CLI::RequiredError("--dataset or --fleet");
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(omnifleet::bus::ExitCode::kBadOptions);
  }
  try {
    if (!omnifleet::services::runInProcess(run)) return static_cast<int>(omnifleet::bus::ExitCode::kFailure);
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(omnifleet::bus::ExitCode::kBadOptions);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fleet_in_process: %s\n", error.what());
    return static_cast<int>(omnifleet::bus::ExitCode::kFailure);
  }
  return 0;
}
