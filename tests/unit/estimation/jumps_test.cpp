// Robots that wheels or people deceive, over seeded runs of the simulator with exact truth.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "trouble.h"

namespace omnifleet::estimation::testing {
namespace {

constexpr std::uint32_t kFirstSeed = 1000, kSeeds = 2;  // estimation_troubles runs all of 1000–1099

TroubleResult sumOf(const Trouble& trouble) {
  TroubleResult sum;
  for (std::uint32_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
    const TroubleResult r = run(trouble, {}, seed);
    sum.troubled += r.troubled;
    sum.told += r.told;
    sum.by_hand += r.by_hand;
    sum.told_wrongly += r.told_wrongly;
    sum.by_wheels += r.by_wheels;
    sum.end_m = std::max(sum.end_m, r.end_m);
    sum.worst_m = std::max(sum.worst_m, r.worst_m);
    sum.false_landmarks += r.false_landmarks;
  }
  return sum;
}

Trouble inTheDark() {
  Trouble trouble;
  trouble.dark_frames = 15;
  return trouble;
}

// 20 cm: nearer than what is another thing, farther than what is the same one.
TEST(Jumps, ARobotCarriedInTheDarkIsToldAndPlacedAnew) {
  Trouble carried = inTheDark();
  carried.moved_m = 0.2;
  carried.turned_rad = 0.17;
  const TroubleResult result = sumOf(carried);
  EXPECT_EQ(result.told, result.troubled);
  EXPECT_LT(result.worst_m, 0.03);  // starts are wrong by 5 mm and 0.3°
  EXPECT_EQ(result.false_landmarks, 0);
}

// Farther than any slip, with only two things in sight, which it has seen before: where they put it and where
// the wheels do lie half a metre apart, and between the two it fits nowhere.
TEST(Jumps, ARobotCarriedFarInTheDarkIsNotHeldBackByItsWheels) {
  for (const std::uint32_t seed : {6U, 11U, 38U}) {
    Trouble carried = inTheDark();
    carried.moved_m = 0.6;
    carried.turned_rad = 0.8;
    const TroubleResult result = run(carried, {}, seed);
    EXPECT_EQ(result.told, result.troubled) << "seed " << seed;
    EXPECT_LT(result.worst_m, 0.05) << "seed " << seed;  // 1.24, 1.07 and 1.24 where it is held back
    EXPECT_EQ(result.false_landmarks, 0) << "seed " << seed;
  }
}

TEST(Jumps, OneThatNobodyCarriedIsNotTold) {
  const TroubleResult result = sumOf(inTheDark());
  EXPECT_EQ(result.by_hand, 0);
  EXPECT_LT(result.worst_m, 0.03);
}

TEST(Jumps, ARobotCarriedBeforeEverybodysEyesIsPlacedAnew) {
  Trouble carried;
  carried.moved_m = 0.2;
  carried.turned_rad = 0.17;
  const TroubleResult result = sumOf(carried);
  EXPECT_EQ(result.told, result.troubled);
  EXPECT_LT(result.worst_m, 0.03);
  EXPECT_EQ(result.false_landmarks, 0);
}

TEST(Jumps, AWheelThatSpinsForASecondIsNoHand) {
  Trouble spins;
  spins.spin_frames = 5;
  const TroubleResult result = sumOf(spins);
  EXPECT_EQ(result.told, result.troubled);
  EXPECT_EQ(result.by_hand, 0);
  EXPECT_LT(result.worst_m, 0.04);
  EXPECT_EQ(result.false_landmarks, 0);
}

TEST(Jumps, SlipsLargerThanTheGateOfWhatIsSeenAreSlips) {
  for (const double slip_m : {0.12, 0.20}) {
    Trouble slips;
    slips.slip_m = slip_m;
    const TroubleResult result = sumOf(slips);
    EXPECT_EQ(result.told, result.troubled) << slip_m;
    EXPECT_EQ(result.by_hand, 0) << slip_m;
    EXPECT_LT(result.worst_m, 0.03) << slip_m;
  }
}

// One of three sees a single thing, which is an outlier by itself, while the things of the others tell them.
TEST(Jumps, ARobotThatSeesOneThingSlipsToo) {
  for (const std::uint32_t seed : {4U, 7U}) {
    Trouble slips;
    slips.slip_m = 0.12;
    slips.all = true;
    const TroubleResult result = run(slips, {}, seed);
    EXPECT_EQ(result.told, result.troubled) << "seed " << seed;
    EXPECT_EQ(result.told_wrongly, 0) << "seed " << seed;
    EXPECT_LT(result.nees, 6.0) << "seed " << seed;  // 36 and 85 where it is not told
  }
}

/// A lone robot is carried across the room in the dark, and its tracker knows nothing again.
Trouble carriedFar(double sight_m) {
  Trouble trouble = inTheDark();
  trouble.moved_m = 1.5;
  trouble.turned_rad = 2.0;
  trouble.new_tracks = true;
  trouble.simulation.frames = 120;
  trouble.simulation.robots = 1;
  trouble.simulation.sight_m = sight_m;
  return trouble;
}

// It sees things there, none of which it knows, and where it is held to be nothing is missing in plain sight.
TEST(Jumps, WhoKnowsNothingOfWhatItSeesAfterTheDarkIsLost) {
  for (const std::uint32_t seed : {1U, 5U}) {
    const TroubleResult result = run(carriedFar(2.0), {}, seed);
    EXPECT_EQ(result.told, result.troubled) << "seed " << seed;
    EXPECT_LT(result.worst_m, 0.05) << "seed " << seed;  // 4.2 and 3.8 where it is believed
    EXPECT_EQ(result.false_landmarks, 0) << "seed " << seed;
  }
}

TEST(Jumps, NobodyIsLostWhoStaysInTheDark) {
  Trouble stays = carriedFar(2.0);
  stays.moved_m = 0.0;
  for (std::uint32_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed)
    EXPECT_EQ(run(stays, {}, seed).valid, 1.0) << "seed " << seed;
}

// Nothing of what they see of one another has changed; nobody who was as blind as another bears it out.
TEST(Jumps, AFleetThatIsCarriedAlikeWhileNobodySendsIsTold) {
  for (const std::uint32_t seed : {0U, 4U}) {
    Trouble alike;
    alike.all = alike.new_tracks = true;
    alike.gap_frames = 15;
    alike.moved_m = 0.6;
    const TroubleResult result = run(alike, {}, seed);
    EXPECT_EQ(result.told, 3) << "seed " << seed;  // 1 and 1 where two bear out one another
    EXPECT_LT(result.worst_m, 0.03) << "seed " << seed;
    EXPECT_LT(result.nees, 6.0) << "seed " << seed;
  }
}

// There it sees two known things for ten seconds, which fit nowhere else.
TEST(Jumps, TwoThingsInTheWholeWayOfALostRobotPlaceIt) {
  for (const auto& [seed, sight_m] : {std::pair{0U, 1.2}, {8U, 1.2}, {14U, 2.0}}) {
    const TroubleResult result = run(carriedFar(sight_m), {}, seed);
    EXPECT_EQ(result.told, result.troubled) << "seed " << seed;
    EXPECT_GT(result.valid, 0.4) << "seed " << seed;  // 0, 0.55 and 0 by three things at once
    EXPECT_LT(result.worst_m, 0.03) << "seed " << seed;
    EXPECT_EQ(result.false_landmarks, 0) << "seed " << seed;
  }
}

// Two things alike look the same from the other side.
TEST(Jumps, TwoThingsAlikeTellTwoPlacesAndPlaceNobody) {
  Trouble carried = carriedFar(2.0);
  carried.simulation.obstacles = 2;
  carried.simulation.alike = true;
  for (const std::uint32_t seed : {16U, 23U, 26U}) {
    const TroubleResult result = run(carried, {}, seed);
    EXPECT_EQ(result.told, result.troubled) << "seed " << seed;
    EXPECT_EQ(result.valid, 0.0) << "seed " << seed;  // else 0.94, metres away
  }
}

// Two things that nobody has mapped lie as far from one another as two known ones, and are broader.
TEST(Jumps, TwoOthersDoNot) {
  const TroubleResult result = run(carriedFar(2.0), {}, 10);
  EXPECT_EQ(result.told, result.troubled);
  EXPECT_EQ(result.valid, 0.0);
}

// Once two things in sight have told; r1 of seed 1000 sees one at a time for the first five seconds.
TEST(Jumps, WheelsThatAreWrittenDownWronglyAreToldAndCountForNothing) {
  for (const Wired wired :
       {Wired::kReversed, Wired::kSwapped, Wired::kBoth, Wired::kLeftReversed, Wired::kRightReversed}) {
    for (const std::uint32_t seed : {1001U, 1002U}) {
      Trouble wrong;
      wrong.at_frame = 0;
      wrong.wired = wired;
      const TroubleResult result = run(wrong, {}, seed);
      EXPECT_EQ(result.by_wheels, 1) << static_cast<int>(wired);
      EXPECT_LT(result.end_m, 0.02) << static_cast<int>(wired);
      EXPECT_EQ(result.false_landmarks, 0) << static_cast<int>(wired);
    }
  }
}

TEST(Jumps, WheelsThatAreRightAreNotToldToBeWrong) {
  Trouble spins, slips, carried = inTheDark();
  spins.spin_frames = 15;
  slips.slip_m = 0.2;
  slips.all = true;
  carried.moved_m = 0.6;
  carried.turned_rad = 0.8;
  for (const Trouble& trouble : {Trouble(), spins, slips, carried}) EXPECT_EQ(sumOf(trouble).by_wheels, 0);
}

TEST(Jumps, WhoSeesNothingIsNotSure) {
  FleetSimulator simulator({}, kFirstSeed);
  FleetEstimator estimator(simulator.setups(), {});
  double before_m = 0.0, after_m = 0.0;
  for (int f = 0; f < 50; ++f) {
    std::vector<Objects> frames = simulator.frames(f);
    frames.resize(1);
    if (f >= 25) frames[0].state = FrameState::kDark, frames[0].tracks.clear();
    const auto poses = estimator.process(simulator.time(f), {&frames[0]}, {});
    (f < 25 ? before_m : after_m) = std::sqrt(poses[0].covariance.topLeftCorner<2, 2>().trace());
  }
  // 5 s of a thousandth a second that it is carried 0.42 m.
  EXPECT_GT(after_m, std::hypot(before_m, std::sqrt(0.005) * 0.42));
}

}  // namespace
}  // namespace omnifleet::estimation::testing
