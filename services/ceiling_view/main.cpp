// ceiling_view OUT DATASET: draws the robots' poses and the map of a run into the images of the ceiling
// cameras.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "ceiling_view/ceiling_view_run.h"
#include "options/options.h"
#include "options/range_check.h"

int main(int argc, char** argv) {
  constexpr int kOk = 0, kFailed = 1, kBadInput = 2;
  CLI::App app(
      "Draws the robots' poses and the map of a run into the last image of each ceiling camera:\n"
      "OUT/ceiling/<camera>_tracking.png and <camera>_map.png.\n"
      "Exit code: 0 done, 1 a picture cannot be written, 2 invalid input.");
  std::string out, dataset;
  app.add_option("OUT", out, "folder of a run")->required()->check(omnifleet::options::notEmpty());
  app.add_option("DATASET", dataset, "the recording of this run")
      ->required()
      ->check(omnifleet::options::notEmpty());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kBadInput;
  }
  try {
    for (const std::string& file : omnifleet::ceiling_view::run(out, dataset))
      std::printf("%s\n", file.c_str());
    return kOk;
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kFailed;
  }
}
