// Records a furnished room with the second renderer, for figures that no tuning has seen.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "options/range_check.h"
#include "tests/raycast/room_pair.h"

namespace {

using omnifleet::raycast::Interval;

Interval intervalOf(const std::string& option, const std::string& text) {
  Interval interval;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf-%lf%n", &interval.begin_s, &interval.end_s, &used) != 2 ||
      used != static_cast<int>(text.size()) || !(interval.begin_s < interval.end_s))
    throw CLI::ValidationError(
        option, "\"" + text + "\" is invalid; the option needs two times in seconds, A-B, with A before B");
  return interval;
}

using omnifleet::raycast::FurnishedOptions;

/// Sets the steps between images from "A-B" or "A" centimetres.
void readSteps(const std::string& text, FurnishedOptions& options) {
  double least = 0.0, most = 0.0;
  int used = 0;
  const auto isWhole = [&] { return used == static_cast<int>(text.size()); };
  if (std::sscanf(text.c_str(), "%lf-%lf%n", &least, &most, &used) != 2 || !isWhole()) {
    if (std::sscanf(text.c_str(), "%lf%n", &least, &used) != 1 || !isWhole()) least = 0.0;
    most = least;
  }
  if (!(least >= 1.0 && least <= most && most <= 200.0))
    throw CLI::ValidationError("--steps", "\"" + text +
                                              "\" is invalid; the option needs one or two lengths "
                                              "from 1 to 200 cm, A or A-B, with A not above B");
  options.step_min_m = 0.01 * least;
  options.step_max_m = 0.01 * most;
}

/// Two sets of images like those of Fernández et al. 2011 §V: 1: 200 images 10 cm apart with a loop, in a
/// large furnished room; 2: images about 3 cm apart, from which a front end takes one when it differs enough
/// from the last one taken. 18 m of path give 150 images at 12 cm.
void usePaperSet(int set, FurnishedOptions& options) {
  options.loop = options.decorated = true;
  if (set == 1) {
    options.step_min_m = options.step_max_m = 0.10;
    options.frames = 200;
    options.width_min_m = 7.4, options.width_max_m = 8.6;
    options.depth_min_m = 5.4, options.depth_max_m = 6.4;
    if (options.pieces == FurnishedOptions{}.pieces) options.pieces = 16;
  } else {
    options.step_min_m = options.step_max_m = 0.03;
    options.frames = 600;
  }
}

/// Images by distance, tours and the sets of the paper.
void addDrives(CLI::App& app, FurnishedOptions& options) {
  constexpr double kLoopMin_m = 0.06, kLoopMax_m = 0.16;
  auto* by_distance = app.add_flag_callback(
      "--by-distance", [&] { options.step_min_m = 0.10, options.step_max_m = 0.16; },
      "one image per 10 to 16 cm instead of 5 Hz");
  auto* steps = app.add_option_function<std::string>(
                       "--steps", [&](const std::string& text) { readSteps(text, options); },
                       "one image per A or A-B centimetres instead of 5 Hz")
                    ->excludes(by_distance);
  app.add_flag_callback(
         "--loop",
         [&, by_distance, steps] {
           options.loop = true;
           if (by_distance->count() + steps->count() > 0) return;
           options.step_min_m = kLoopMin_m;
           options.step_max_m = kLoopMax_m;
         },
         "a tour of one robot that returns to its first place; steps of 6 to 16 cm by default")
      ->excludes("--minutes");
  app.add_option_function<int>(
         "--set", [&](int set) { usePaperSet(set, options); },
         "1: 200 images 10 cm apart with a loop in a large room; 2: 600 images 3 cm apart with a loop")
      ->check(CLI::Range(1, 2))
      ->excludes(by_distance)
      ->excludes(steps)
      ->excludes("--loop")
      ->excludes("--minutes")
      ->excludes("--frames");
}

void addFaults(CLI::App& app, FurnishedOptions& options) {
  const std::string group = "Faults, all off by default; the ground truth stays true";
  app.add_option_function<std::string>(
         "--black", [&](const std::string& text) { options.black = intervalOf("--black", text); },
         "A-B: frames of robot 1 between A and B seconds are black")
      ->group(group);
  app.add_option("--occluded,--blocked", options.occluded_share,
                 "persons walk around robot 1 and occlude this share of its bearings within 1.5 m (mean)")
      ->check(CLI::Range(0.0, 0.9))
      ->group(group);
  app.add_option("--kidnapped,--carried", options.kidnapped_s,
                 "at this time (s) robot 1 is lifted and set down elsewhere 2 s later; meanwhile it takes no "
                 "frames and its wheels stand still")
      ->check(CLI::NonNegativeNumber)
      ->group(group);
  app.add_option_function<std::string>(
         "--slip", [&](const std::string& text) { options.slip = intervalOf("--slip", text); },
         "A-B: between A and B seconds the wheels of robot 1 turn 40 % farther than it moves")
      ->group(group);
  app.add_flag("--symmetric", options.symmetric,
               "the room equals itself turned by 180 degrees; plain floor; one room only")
      ->group(group);
  app.add_flag_callback(
         "--wheels-clock", [&] { options.wheel_clock_offset_s = 1000.0; },
         "the wheels of all robots use another clock, 1000 s ahead")
      ->group(group);
  app.add_option("--wheels-scale", options.wheel_speed_factor,
                 "factor on the wheel speeds of all robots; 100: cm/s instead of m/s")
      ->check(CLI::PositiveNumber)
      ->group(group);
}

}  // namespace

int main(int argc, char** argv) try {
  FurnishedOptions options;
  CLI::App app{"Records robots that drive through a furnished room (independent renderer)"};
  std::string out, pair;
  double minutes = 0.0;
  bool vga = false, low = false, no_walls = false, no_wheels = false, flawed = false;
  app.add_option("OUT", out, "folder of the recording")->required()->check(omnifleet::options::notEmpty());
  app.add_option("SEED", options.seed, "seed of room, paths and noise")->required();
  app.add_option("--robots", options.robots, "number of robots, default 1")->check(CLI::Range(1, 8));
  auto* frames = app.add_option("--frames", options.frames, "frames per robot, default 200")
                     ->check(CLI::Range(1, 100000));
  app.add_option("--minutes", minutes, "length of the drive in place of --frames")
      ->check(CLI::Range(0.01, 600.0))
      ->excludes(frames);
  app.add_option("--rooms", options.rooms, "1, or 2 joined by a door")->check(CLI::Range(1, 2));
  app.add_option("--pieces", options.pieces, "pieces of furniture")->check(CLI::Range(0, 40));
  addDrives(app, options);
  app.add_option(
         "--pair", pair,
         "same, lookalike or disjoint: two robots in one room, in two rooms that differ in furniture, "
         "or in two unlike rooms; r2 has no initial pose; 120 frames of width 640 with --fast by default")
      ->check(CLI::IsMember({"same", "lookalike", "disjoint"}))
      ->excludes("--robots")
      ->excludes("--loop")
      ->excludes("--set");
  auto* vga_flag = app.add_flag("--vga", vga, "640x480 images instead of 1280x960");
  auto* width = app.add_option("--width", options.width_px,
                               "width of the images, default 1280; the height is 3/4 of it")
                    ->check(CLI::Range(64, 4096))
                    ->excludes(vga_flag);
  app.add_flag("--decorated", options.decorated,
               "doors, windows, radiators, curtains and skirting boards; shelves with books, drawers");
  app.add_flag("--fast", options.fast,
               "one ray per pixel and four at edges: less exact, about 3 times faster");
  app.add_flag("--low", low, "only free-standing obstacles lower than the camera");
  app.add_flag("--no-walls", no_walls, "no walls");
  app.add_flag("--no-wheels", no_wheels, "no wheel odometry");
  app.add_flag("--dim", options.dim, "low contrast, light that falls off");
  app.add_flag("--mirror", options.mirror, "a mirror that reaches to the floor stands at a wall");
  app.add_flag("--glass", options.glass, "a part of a wall is glass; behind it floor");
  app.add_flag("--flawed", flawed,
               "calibration and initial poses slightly wrong (0.3 %, 0.2 deg, 0.5 cm, 0.3 deg)");
  addFaults(app, options);
  CLI11_PARSE(app, argc, argv);
  options.duration_s = 60.0 * minutes;
  if (vga) options.width_px = 640;
  options.height_px = options.width_px * 3 / 4;
  if (low) options.furniture = omnifleet::raycast::Furniture::kLow;
  options.walls = !no_walls;
  options.wheels = !no_wheels;
  if (flawed) {
    options.focal_error = 0.003;
    options.tilt_error_deg = 0.14;  // of roll and pitch each: 0.2° together
    options.start_error_m = 0.005;
    options.start_error_rad = 0.0052;
  }
  if (pair.empty()) {
    omnifleet::raycast::recordFurnished(out, options);
    return 0;
  }
  options.fast = true;
  if (frames->count() == 0) options.frames = 120;
  if (width->count() == 0) options.width_px = 640, options.height_px = 480;
  omnifleet::raycast::recordPair(out, omnifleet::raycast::pairKindOf(pair), options);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "raycast_room: %s\n", error.what());
  return 1;
}
