// Records a furnished room with the second renderer, for figures that no tuning has seen.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "tests/raycast/furnished_room.h"

int main(int argc, char** argv) try {
  omnifleet::raycast::FurnishedOptions options;
  CLI::App app{"Records robots that drive through a furnished room (independent renderer)"};
  std::string out;
  bool by_distance = false, vga = false, low = false, no_walls = false, no_wheels = false, flawed = false;
  app.add_option("OUT", out, "folder of the recording")->required();
  app.add_option("SEED", options.seed, "seed of room, paths and noise")->required();
  app.add_option("--robots", options.robots, "number of robots")->check(CLI::Range(1, 8));
  app.add_option("--frames", options.frames, "frames per robot")->check(CLI::Range(1, 100000));
  app.add_option("--rooms", options.rooms, "1, or 2 joined by a door")->check(CLI::Range(1, 2));
  app.add_option("--pieces", options.pieces, "pieces of furniture")->check(CLI::Range(0, 40));
  app.add_flag("--by-distance", by_distance, "one image per 10 to 16 cm instead of 5 Hz");
  app.add_flag("--vga", vga, "640x480 images instead of 1280x960");
  app.add_flag("--low", low, "only free-standing obstacles lower than the camera");
  app.add_flag("--no-walls", no_walls, "no walls");
  app.add_flag("--no-wheels", no_wheels, "no wheel odometry");
  app.add_flag("--dim", options.dim, "low contrast, light that falls off");
  app.add_flag("--flawed", flawed,
               "calibration and initial poses slightly wrong (0.3 %, 0.2 deg, 0.5 cm, 0.3 deg)");
  CLI11_PARSE(app, argc, argv);
  if (by_distance) options.step_min_m = 0.10, options.step_max_m = 0.16;
  if (vga) options.width_px = 640, options.height_px = 480;
  if (low) options.furniture = omnifleet::raycast::Furniture::kLow;
  options.walls = !no_walls;
  options.wheels = !no_wheels;
  if (flawed) {
    options.focal_error = 0.003;
    options.tilt_error_deg = 0.14;  // of roll and pitch each: 0.2° together
    options.start_error_m = 0.005;
    options.start_error_rad = 0.0052;
  }
  omnifleet::raycast::recordFurnished(out, options);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "raycast_room: %s\n", error.what());
  return 1;
}
