// Classification of robots and obstacles in rendered arenas: frames → local mapper → classifier. The poses
// are the truth with the localizer's noise, one frame late. OMNIFLEET_SEEDS=FIRST:LAST selects the seeds; the
// default is one seed, ten in the slow set. OMNIFLEET_TRACE=1 prints every wrong label.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "tests/unit/services/classifier/rendered_scenario.h"

namespace omnifleet::rendered {
namespace {

std::pair<unsigned, unsigned> seeds() {
  unsigned first = 1000, last = 1000;
  if (const char* wanted = std::getenv("OMNIFLEET_SEEDS")) std::sscanf(wanted, "%u:%u", &first, &last);
  return {first, last};
}

Score runAll(const Scenario& scenario) {
  Score total;
  const auto [first, last] = seeds();
  for (unsigned seed = first; seed <= last; ++seed) {
    const Score score = run(scenario, seed);
    if (last > first)
      std::printf("  %s %u: F1 %.4f / %.4f, switches %d\n", scenario.name.c_str(), seed, score.robots.f1(),
                  score.obstacles.f1(), score.switches);
    total += score;
  }
  std::printf(
      "%s: F1 robots %.4f (%d right, %d missed, %d wrong), obstacles %.4f (%d, %d, %d), no object there %d, "
      "switches %d\n",
      scenario.name.c_str(), total.robots.f1(), total.robots.right, total.robots.missed, total.robots.wrong,
      total.obstacles.f1(), total.obstacles.right, total.obstacles.missed, total.obstacles.wrong,
      total.nothing, total.switches);
  return total;
}

/// All scenarios if seeds are selected; otherwise those that are most significant with a single seed.
std::vector<Scenario> wanted() {
  std::vector<Scenario> all = scenarios();
  if (!std::getenv("OMNIFLEET_SEEDS")) return all;
  for (const Scenario& scenario : moreScenarios()) all.push_back(scenario);
  return all;
}

class RenderedScenes : public testing::TestWithParam<Scenario> {};

/// Limits of docs/methods/evaluation.md. Ids may change where two objects that were always one blob separate:
/// at most once in three robots' runs.
TEST_P(RenderedScenes, ClassifiesRobotsAndObstacles) {
  const Score score = runAll(GetParam());
  const auto [first, last] = seeds();
  EXPECT_GE(score.robots.f1(), 0.98);
  EXPECT_GE(score.obstacles.f1(), 0.98);
  EXPECT_GT(score.robots.right, 50);
  EXPECT_GT(score.obstacles.right, 50);
  EXPECT_LE(score.switches, static_cast<int>(last - first + 1));
}

Score runOne(const std::string& name, unsigned seed) {
  std::vector<Scenario> all = scenarios();
  for (const Scenario& more : moreScenarios()) all.push_back(more);
  const auto scenario = std::find_if(all.begin(), all.end(), [&](const auto& s) { return s.name == name; });
  if (scenario == all.end()) throw std::invalid_argument("no scenario " + name);
  return run(*scenario, seed);
}

/// An unlisted robot passes behind a high box. While hidden it is not reported, also not at the box's edge,
/// and it reappears with its id. Seed 0: beside other robots, which keep their ids. Seed 6: hidden for long.
/// Seed 1001: another object stands behind the box. Seed 25: hidden for longer than its track is kept.
TEST(HiddenUnlistedRobot, KeepsIdWhenItReappears) {
  Score total;
  for (const unsigned seed : {0U, 6U, 25U, 1001U}) {
    const Score score = runOne("hidden_unlisted", seed);
    EXPECT_EQ(score.switches, 0) << "seed " << seed;
    total += score;
  }
  EXPECT_GE(total.robots.f1(), 0.98);
}

/// A blob that touches the floor far in front of an object is not that object, however well the rest fits.
TEST(HiddenUnlistedRobot, KeepsItsBlobFromObjectBehind) {
  EXPECT_LE(runOne("hidden_unlisted", 29).nothing, 2);
}

/// Two objects stand behind a robot, in one blob with it, for seconds: their far edges determine no place.
TEST(FarEdge, GivesNoPlaceHoweverLongVisible) {
  EXPECT_LE(runOne("stopping", 23).nothing, 2);
}

/// The box and its pusher are one blob most of the time. Seed 7: a flat box, which is nearer than its mean
/// radius suggests. Seed 8: it is released before its pusher reaches its estimated place.
TEST(PushedBox, IsAnObstacleWithItsOwnTrack) {
  for (const unsigned seed : {7U, 8U}) {
    const Score score = runOne("pushed", seed);
    EXPECT_EQ(score.robots.wrong, 0) << "seed " << seed;
    EXPECT_LE(score.robots.missed, seed == 8 ? 2 : 5) << "seed " << seed;
    EXPECT_LE(score.switches, 3) << "seed " << seed;
  }
}

/// Its pusher sees only two ends of the box, as one blob or as two.
TEST(PushedBox, IsOneTrackForItsPusher) {
  EXPECT_EQ(runOne("pushed", 21).switches, 0);
}

/// The box and a robot in front of it are one blob until the robot's pose arrives.
TEST(PushedBox, KeepsItsIdWhenTheRobotsPoseArrives) {
  EXPECT_EQ(runOne("pushed", 23).switches, 0);
}

/// For some frames the estimated place of the box overlaps its pusher, and its track is deleted. When it
/// reappears it continues that track.
TEST(PushedBox, ContinuesItsDeletedTrack) {
  EXPECT_EQ(runOne("pushed", 27).switches, 0);
}

/// A robot separates from a blob that it shared with another object. The rest of the blob takes the width
/// that is now visible.
TEST(PushedBox, UpdatesItsWidthWhenItsBlobSplits) {
  const Score score = runOne("pushed", 22);
  EXPECT_LE(score.nothing, 1);  // a far edge, in one frame
  EXPECT_LE(score.switches, 1);
}

/// The box is pushed before any robot has seen it apart from its pusher: one blob, whose centre is near the
/// pusher's published place. From the pusher's first pose on they are two tracks. Seed 3: one object explains
/// a blob only if nothing exceeds its outline. Seed 18: an object with no remaining outline reappears later.
/// Seed 48: the blob is not beside the pusher's place, but wider.
TEST(PushedBox, SeparatesFromItsPusherAtTheFirstPose) {
  for (const unsigned seed : {3U, 17U, 18U, 48U}) {
    const Score score = runOne("pushed", seed);
    EXPECT_LE(score.robots.wrong, seed == 48 ? 6 : 0) << "seed " << seed;
    EXPECT_EQ(score.switches, 0) << "seed " << seed;
  }
}

/// An unlisted robot behind a listed robot and in front of other objects: the rest of the blob's outline
/// belongs to those objects. Seed 5: it was hidden before and its place is uncertain. Seed 21: the listed
/// robot keeps its id too. Seed 23: only a narrow part of it is visible at a time. Seed 29: one far corner
/// supports half of the directions.
class SilentUnlistedRobot : public testing::TestWithParam<unsigned> {};

TEST_P(SilentUnlistedRobot, KeepsItsPlaceInFrontOfOtherObjects) {
  const Score score = runOne("silent_unlisted", GetParam());
  const int most = GetParam() == 23 ? 2 : 0;
  EXPECT_LE(score.robots.wrong, most);
  EXPECT_LE(score.switches, most);
}

INSTANTIATE_TEST_SUITE_P(Behind, SilentUnlistedRobot, testing::Values(5U, 21U, 22U, 23U, 29U));

INSTANTIATE_TEST_SUITE_P(All, RenderedScenes, testing::ValuesIn(wanted()),
                         [](const auto& scenario) { return scenario.param.name; });

}  // namespace
}  // namespace omnifleet::rendered
