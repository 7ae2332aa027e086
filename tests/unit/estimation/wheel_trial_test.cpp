// Wheel polarity and assignment by static obstacles, against exact paths.

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

/// Odometry of wheels with the given true travel. @param wiring assignment that corrects it
Motion odometry(double left_m, double right_m, Wiring wiring) {
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
  double left_m = 0.03, right_m = 0.04;  ///< travel of the wheels per frame
  double grip = 1.0;                     ///< share of the travel that moves the robot
  Eigen::Vector2d drifts_m{0.0, 0.0};    ///< motion of all objects per frame
  std::vector<Eigen::Vector2d> objects{{1.2, 0.6}, {0.3, -0.9}, {-0.8, 0.7}};
};

Wiring verdictOf(const Drive& drive, Wiring wiring, int frames = 12) {
  WheelTrial trial;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.005);
  Pose2 at;
  Eigen::Vector2d drifted_m(0.0, 0.0);
  for (int f = 0; f < frames; ++f) {
    std::vector<Standing> observed;
    for (const Eigen::Vector2d& object : drive.objects)
      observed.push_back(
          {at.inverse() * Eigen::Vector2d(object + drifted_m) + Eigen::Vector2d(noise(random), noise(random)),
           0.1});
    trial.add(f == 0 ? Motion{} : odometry(drive.left_m, drive.right_m, wiring), kWheelsApart_m, observed);
    at = at * arc(drive.grip * drive.left_m, drive.grip * drive.right_m, kWheelsApart_m);
    drifted_m += drive.drifts_m;
  }
  return trial.verdict();
}

TEST(WheelTrial, EachWrongAssignmentIsIdentified) {
  for (const Wiring wiring : kAll) {
    EXPECT_EQ(verdictOf({}, wiring), wiring) << static_cast<int>(wiring);
    EXPECT_EQ(wheelAssignmentWrong(wiring).code == ErrorCode::kNone, wiring == Wiring::kAsConfigured);
  }
}

TEST(WheelTrial, ThreeFramesGiveNoVerdict) {
  EXPECT_EQ(verdictOf({}, Wiring::kReversed, 3), Wiring::kAsConfigured);
}

// On a straight path swapped wheels are indistinguishable from correct ones.
TEST(WheelTrial, SimplerOfIndistinguishableAssignmentsIsChosen) {
  Drive straight;
  straight.left_m = straight.right_m = 0.04;
  EXPECT_EQ(verdictOf(straight, Wiring::kSwapped), Wiring::kAsConfigured);
  EXPECT_EQ(verdictOf(straight, Wiring::kBoth), Wiring::kReversed);
}

TEST(WheelTrial, SlipDoesNotChangeTheAssignment) {
  for (const double grip : {0.0, 0.3, 0.7}) {
    Drive slips;
    slips.grip = grip;
    EXPECT_EQ(verdictOf(slips, Wiring::kAsConfigured), Wiring::kAsConfigured) << grip;
  }
}

// An object that drives ahead at twice the speed looks as if the robot drove backwards.
TEST(WheelTrial, OneMovingObjectDoesNotChangeTheAssignment) {
  Drive drive;
  drive.left_m = drive.right_m = 0.04;
  drive.objects = {{1.0, 0.0}};
  drive.drifts_m = {0.08, 0.0};
  EXPECT_EQ(verdictOf(drive, Wiring::kAsConfigured), Wiring::kAsConfigured);
}

}  // namespace
}  // namespace omnifleet::estimation
