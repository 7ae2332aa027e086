// Records the experiments of Ahmed et al. 2013 with the second renderer, for figures that no tuning has seen.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "options/range_check.h"
#include "tests/raycast/arena_recording.h"

int main(int argc, char** argv) try {
  omnifleet::raycast::ArenaOptions options;
  CLI::App app{"Records two robots with forward cameras in a divided arena (independent renderer)"};
  std::string out;
  bool hard = false;
  app.add_option("OUT", out, "folder of the recording")->required()->check(omnifleet::options::notEmpty());
  app.add_option("--seed", options.seed, "seed of arena, paths and noise, default 0");
  app.add_option("--layout", options.layout, "walls of blocks: 1 (default) or 2")->check(CLI::Range(1, 2));
  app.add_option("--frames", options.frames, "images per front camera, at 5 Hz, default 250")
      ->check(CLI::Range(1, 100000));
  app.add_flag("--hard", hard,
               "dim light, shadows, glare, noise, strong distortion, calibration slightly wrong");
  app.add_option("--cards", options.cards, "cards in colours of the markers on the floor, default 3")
      ->check(CLI::Range(0, 14));
  app.add_option("--ceiling-rate", options.ceiling_rate_hz, "Hz, images of the ceiling cameras, default 5")
      ->check(CLI::Range(0.1, 100.0));
  app.add_option("--ceiling-offset", options.ceiling_offset_s, "s, ceiling images follow the front images")
      ->check(CLI::Range(0.0, 10.0));
  app.add_option("--stale", options.stale_s,
                 "s, ceiling images show the robots earlier than their time stamps state")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option(
         "--stop-and-wait", options.wait_s,
         "s, robots stand this long before each front image (Ahmed et al. 2013, section 3); the places "
         "and the front images are those of the continuous drive")
      ->check(CLI::Range(0.0, 60.0));
  app.add_option("--exposure", options.exposure_s, "s, motion blur of all cameras")
      ->check(CLI::Range(0.0, 0.2));
  app.add_flag("--patches", options.patches, "markers of kind patches, not cover_tail_head");
  app.add_option("--ceiling-tilt", options.ceiling_tilt_deg,
                 "degrees, tilt of a ceiling camera about each horizontal axis, at most, default 1.5")
      ->check(CLI::Range(0.0, 30.0));
  CLI11_PARSE(app, argc, argv);
  if (hard) {
    const int cards = options.cards;
    options.makeHard();
    if (app.count("--cards") > 0) options.cards = cards;
  }
  omnifleet::raycast::recordArena(out, options);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "raycast_arena: %s\n", error.what());
  return 1;
}
