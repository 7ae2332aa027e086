#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

#include "options/range_check.h"
#include "synthetic/randomised.h"
#include "world/recording.h"

namespace {

int run(const std::string& arena_file, const std::string& out, bool random, bool quiet,
        omnifleet::world::RecordingOptions options) {
  using namespace omnifleet;
  synthetic::Arena arena = synthetic::Arena::load(arena_file);
  if (random) arena = synthetic::randomised(arena, options.seed);
  options.world = world::World::Options::read(arena.world);
  const auto report = world::record(arena, options, out, [&](int frame, int frames) {
    if (!quiet) std::fprintf(stderr, "\rframe %d of at most %d", frame, frames);
  });
  if (!quiet) std::fprintf(stderr, "\n");
  std::printf("%s: %d frames, %s, %zu collisions\n", out.c_str(), report.frames,
              report.arrived ? "all robots arrived" : "not all robots arrived", report.collisions.size());
  return 0;
}

}  // namespace

/// Creates a dataset from an arena, without the services of the pipeline.
int main(int argc, char** argv) {
  CLI::App app("Drive the robots of a simulated arena and write the run as a dataset");
  omnifleet::world::RecordingOptions options;
  std::string arena, out;
  bool random = false, no_ceiling = false, quiet = false, force = false;
  app.add_option("ARENA", arena, "arena file (config/arenas)")
      ->required()
      ->check(omnifleet::options::notEmpty());
  app.add_option("--out", out, "dataset folder to create")->required()->check(omnifleet::options::notEmpty());
  app.add_option("--seed", options.seed,
                 "seed of wheels, textures and noise; with --random of the whole scene")
      ->default_val(1);
  app.add_flag("--random", random, "random obstacles, colours, light and initial poses");
  app.add_option("--format", options.extension, "image format, png or jpg")
      ->check(CLI::IsMember({"png", "jpg"}))
      ->default_val("png");
  app.add_flag("--no-ceiling", no_ceiling, "omit the ceiling cameras");
  app.add_flag("--quiet", quiet, "no progress line");
  app.add_flag("--force", force, "overwrite an existing recording");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  options.ceiling = !no_ceiling;
  try {
    if (!force && std::filesystem::exists(std::filesystem::path(out) / "dataset.yaml")) {
      throw omnifleet::options::Error("--out " + out +
                                      " already contains a recording; use --force to overwrite it");
    }
    return run(arena, out, random, quiet, options);
  } catch (const omnifleet::options::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_recording: %s\n", error.what());
    return 1;
  }
}
