#pragma once

#include <cstdint>

#include "fleet_simulator.h"

namespace omnifleet::estimation::testing {

/// How r1's wheels are written down, all the time.
enum class Wired { kRight, kReversed, kSwapped, kBoth, kLeftReversed, kRightReversed };

/// What befalls r1 (or all robots) at one time of a simulated run.
struct Trouble {
  SimulationOptions simulation;
  int at_frame = 25;
  int dark_frames = 0;                     ///< that r1 sees nothing from then on
  double moved_m = 0.0, turned_rad = 0.0;  ///< by hand; in the middle of the dark where there is one
  int spin_frames = 0;                     ///< that its left wheel rolls …
  double spin_m = 0.06;                    ///< … so much more than it goes, each
  double slip_m = 0.0;                     ///< both wheels, in one frame, with 0.1 rad
  bool all = false;                        ///< slip alike, are carried alike, see nothing alike
  int gap_frames = 0;                      ///< that nobody sends from then on, …
  bool new_tracks = false;                 ///< its tracker has lost all after the dark or the gap
  bool gap_wheels = true;                  ///< … but wheels are counted
  Wired wired = Wired::kRight;

  Trouble() {
    simulation.frames = 70;
    simulation.start_sigma_m = 0.005;
    simulation.start_sigma_rad = 0.00524;
  }
};

struct TroubleResult {
  int troubled = 0, told = 0;  ///< robots that something befell; that were told within 2 s of seeing
  int by_hand = 0;             ///< frames told as moved by hand
  int told_wrongly = 0;        ///< frames told of robots that nothing befalls, or before or 2 s after it
  int by_wheels = 0;           ///< robots of whom it was said that their wheels are written down wrongly
  double late_s = 0.0;         ///< mean of those told, from when they see
  double mean_m = 0.0, worst_m = 0.0;  ///< of poses that are called valid from then on, in the dark left out
  double end_m = 0.0;                  ///< of the last poses, mean
  double nees = 0.0;                   ///< of these poses
  double valid = 0.0;                  ///< share of frames from then on
  int false_landmarks = 0;             ///< farther than 5 cm from every obstacle
};
TroubleResult run(const Trouble& trouble, const EstimatorOptions& options, std::uint32_t seed);

}  // namespace omnifleet::estimation::testing
