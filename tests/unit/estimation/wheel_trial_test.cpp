// How wheels are to be read, by things that stand, against ways that are driven exactly.

#include "estimation/wheel_trial.h"

#include <gtest/gtest.h>

#include <random>
#include <utility>
#include <vector>

#include "estimation/factors.h"
#include "estimation/messages.h"

namespace omnifleet::estimation {
namespace {

constexpr double kWheelsApart_m = 0.26;
constexpr Wiring kAll[] = {Wiring::kAsConfigured, Wiring::kReversed,     Wiring::kSwapped,
                           Wiring::kBoth,         Wiring::kLeftReversed, Wiring::kRightReversed};

/// What a robot's wheels tell that rolled so, where they have to be read as `wiring` says.
Motion told(double left_m, double right_m, Wiring wiring) {
  Motion motion;
  motion.valid = true;
  motion.left_m = left_m;
  motion.right_m = right_m;
  if (wiring == Wiring::kSwapped || wiring == Wiring::kBoth) std::swap(motion.left_m, motion.right_m);
  if (wiring == Wiring::kReversed || wiring == Wiring::kBoth || wiring == Wiring::kLeftReversed)
    motion.left_m = -motion.left_m;
  if (wiring == Wiring::kReversed || wiring == Wiring::kBoth || wiring == Wiring::kRightReversed)
    motion.right_m = -motion.right_m;
  motion.previous_from_current = arc(motion.left_m, motion.right_m, kWheelsApart_m);
  return motion;
}

struct Drive {
  double left_m = 0.03, right_m = 0.04;  ///< rolled from frame to frame
  double grip = 1.0;                     ///< share of it that the robot goes
  Eigen::Vector2d drifts_m{0.0, 0.0};    ///< all things, from frame to frame
  std::vector<Eigen::Vector2d> things{{1.2, 0.6}, {0.3, -0.9}, {-0.8, 0.7}};
};

Wiring verdictOf(const Drive& drive, Wiring wiring, int frames = 12) {
  WheelTrial trial;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.005);
  Pose2 at;
  Eigen::Vector2d drifted_m(0.0, 0.0);
  for (int f = 0; f < frames; ++f) {
    std::vector<Standing> seen;
    for (const Eigen::Vector2d& thing : drive.things)
      seen.push_back(
          {at.inverse() * Eigen::Vector2d(thing + drifted_m) + Eigen::Vector2d(noise(random), noise(random)),
           0.1});
    trial.add(f == 0 ? Motion{} : told(drive.left_m, drive.right_m, wiring), kWheelsApart_m, seen);
    at = at * arc(drive.grip * drive.left_m, drive.grip * drive.right_m, kWheelsApart_m);
    drifted_m += drive.drifts_m;
  }
  return trial.verdict();
}

TEST(WheelTrial, EveryWrongReadingIsNamed) {
  for (const Wiring wiring : kAll) {
    EXPECT_EQ(verdictOf({}, wiring), wiring) << static_cast<int>(wiring);
    EXPECT_EQ(wheelAssignmentWrong(wiring).code == ErrorCode::kNone, wiring == Wiring::kAsConfigured);
  }
}

TEST(WheelTrial, OneStretchIsNoVerdict) {
  EXPECT_EQ(verdictOf({}, Wiring::kReversed, 3), Wiring::kAsConfigured);
}

// Straight ahead, wheels that are swapped as well look like those that are not.
TEST(WheelTrial, OfReadingsThatNothingTellsApartTheSimplerOneIsTold) {
  Drive straight;
  straight.left_m = straight.right_m = 0.04;
  EXPECT_EQ(verdictOf(straight, Wiring::kSwapped), Wiring::kAsConfigured);
  EXPECT_EQ(verdictOf(straight, Wiring::kBoth), Wiring::kReversed);
}

TEST(WheelTrial, WheelsThatSlipAreReadRightly) {
  for (const double grip : {0.0, 0.3, 0.7}) {
    Drive slips;
    slips.grip = grip;
    EXPECT_EQ(verdictOf(slips, Wiring::kAsConfigured), Wiring::kAsConfigured) << grip;
  }
}

// What goes ahead of a robot twice as fast looks as if the robot went back.
TEST(WheelTrial, OneThingThatMovesContradictsNoWheels) {
  Drive drive;
  drive.left_m = drive.right_m = 0.04;
  drive.things = {{1.0, 0.0}};
  drive.drifts_m = {0.08, 0.0};
  EXPECT_EQ(verdictOf(drive, Wiring::kAsConfigured), Wiring::kAsConfigured);
}

}  // namespace
}  // namespace omnifleet::estimation
