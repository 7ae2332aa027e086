#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>

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
  std::printf("%s: %d frames, %s, %zu contacts\n", out.c_str(), report.frames,
              report.arrived ? "arrived" : "not arrived", report.collisions.size());
  return 0;
}

}  // namespace

/// Makes a dataset from an arena, without any of the pipeline's services.
int main(int argc, char** argv) {
  CLI::App app("Drive a simulated arena and write it as a dataset");
  omnifleet::world::RecordingOptions options;
  std::string arena, out;
  bool random = false, no_ceiling = false, quiet = false, force = false;
  app.add_option("ARENA", arena, "arena file (config/arenas)")->required();
  app.add_option("--out", out, "folder of the dataset, created")->required();
  app.add_option("--seed", options.seed, "of wheels, textures and noise; with --random of the whole scene")
      ->default_val(1);
  app.add_flag("--random", random, "obstacles, colours, light and starts of the seed's own");
  app.add_option("--format", options.extension, "png or jpg")
      ->check(CLI::IsMember({"png", "jpg"}))
      ->default_val("png");
  app.add_flag("--no-ceiling", no_ceiling, "leave the ceiling cameras out");
  app.add_flag("--quiet", quiet, "no progress line");
  app.add_flag("--force", force, "write over a recording that is there already");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  options.ceiling = !no_ceiling;
  try {
    if (!force && std::filesystem::exists(std::filesystem::path(out) / "dataset.yaml")) {
      throw omnifleet::options::Error("--out " + out + " holds a recording already; --force writes over it");
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
