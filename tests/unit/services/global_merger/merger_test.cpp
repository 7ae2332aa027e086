#include "global_merger/merger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <random>

#include "global_merger/map_doubts.h"
#include "merger_scenes.h"
#include "outline/half_planes.h"
#include "outline/polygon_set.h"

namespace omnifleet::global_merger {
namespace {

using dataset::MapObject;
using omnifleet::testing::boxPolygon;
using omnifleet::testing::SimRobot;
using namespace testing;  // NOLINT

TEST(Merger, FindsAllObstaclesAndNothingElse) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    auto sim = arena(noisy(), seed);
    Merger merger = merged(record(sim, 0.0, 8.0), sim.bodies());
    merger.finish();
    EXPECT_TRUE(merger.unmapped().empty());
    const Score s = score(merger.outlines(), sim.things());
    std::cout << "centroid " << 100 * s.error_m << " cm, IoU " << s.iou << ", height " << 1000 * s.height_m
              << " mm\n";
    EXPECT_EQ(s.missed, 0);
    EXPECT_EQ(s.extra, 0);
    EXPECT_LT(s.error_m,
              0.002);        // asked: ≤ 0.3 cm per axis with exact calibration, vision's errors included
    EXPECT_GT(s.iou, 0.95);  // asked: ≥ 0.90
    EXPECT_LT(s.height_m, 0.005);
  }
}

TEST(MapDoubts, ASliverMayBeTheSideOfSomething) {
  const auto turned = [](Polygon polygon) {
    for (Eigen::Vector2d& p : polygon) p = Pose2{1.0, -2.0, 0.7} * p;
    return polygon;
  };
  EXPECT_TRUE(isSliver(turned({{0, 0}, {0.3, 0}, {0.3, 0.07}, {0, 0.07}})));
  EXPECT_FALSE(isSliver(turned({{0, 0}, {0.3, 0}, {0.3, 0.12}, {0, 0.12}}))) << "thick";
  EXPECT_FALSE(isSliver(circlePolygon({1, 2}, 0.04, 48))) << "a pole";
  EXPECT_FALSE(isSliver({}));
}

TEST(MapDoubts, WhatIsOccupiedWithoutAnOutlineIsNamed) {
  dataset::OccupancyGrid grid;
  grid.width = 60;
  grid.height = 40;
  grid.origin_m = {-1.0, -0.5};
  grid.cells.assign(static_cast<std::size_t>(grid.width * grid.height), 0);
  const auto occupy = [&](int x, int y, int width, int height) {
    for (int v = y; v < y + height; ++v)
      std::fill_n(grid.cells.begin() + v * grid.width + x, width, std::int8_t{100});
  };
  occupy(10, 10, 5, 4);  // a box, …
  occupy(15, 10, 6, 4);  // … and another that has run together with it
  occupy(40, 2, 2, 36);  // a wall
  occupy(50, 20, 2, 2);  // noise
  dataset::MapObject box;
  box.outline_m = boxPolygon({-0.375, 0.1}, 0.25, 0.2, 0.0);
  const auto bare = bareCells(grid, {box});
  ASSERT_EQ(bare.size(), 1U);
  EXPECT_NEAR(bare.front().x(), -1.0 + 0.05 * 19.0, 0.06);
  EXPECT_NEAR(bare.front().y(), 0.1, 0.03);
  EXPECT_TRUE(bareCells({}, {}).empty());
}

TEST(Merger, OutlinesAreAFunctionOfTheSets) {
  auto sim = arena(noisy(), 5);
  const Sets sets = record(sim, 0.0, 6.0);
  Merger reference = merged(sets, sim.bodies());
  reference.finish();
  std::mt19937 random(5);
  for (int run = 0; run < 3; ++run) {
    Sets other = sets;
    other.contributions.insert(other.contributions.end(), sets.contributions.begin(),
                               sets.contributions.end());
    std::shuffle(other.contributions.begin(), other.contributions.end(), random);
    std::shuffle(other.poses.begin(), other.poses.end(), random);
    Merger merger = merged(other, sim.bodies());
    merger.outlines();  // asked in between, as live
    merger.finish();
    merger.finish();
    EXPECT_EQ(text(merger), text(reference));
    EXPECT_EQ(merger.map().hash(), reference.map().hash());
    EXPECT_EQ(merger.map().octreeBytes(), reference.map().octreeBytes());
  }
}

TEST(Merger, WhatComesBetweenTheFitsIsForTheNextTime) {
  FleetSim sim = arena(noisy(), 9);
  const Sets first = record(sim, 0.0, 3.0), later = record(sim, 3.0, 4.0);
  Merger paused = merged(first, sim.bodies()), straight = merged(first, sim.bodies());
  std::size_t pauses = 0;
  const auto add_one = [&] {
    if (pauses < later.poses.size()) {
      paused.add(later.contributions[pauses]);
      paused.add(later.poses[pauses]);
    }
    ++pauses;
  };
  const auto equal = [](const std::vector<MapObject>& a, const std::vector<MapObject>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const MapObject& x, const MapObject& y) {
      return x.id == y.id && x.outline_m == y.outline_m && x.observations == y.observations;
    });
  };
  const std::vector<MapObject> before = paused.outlines(add_one);
  EXPECT_FALSE(before.empty());
  EXPECT_TRUE(equal(before, straight.outlines()));
  EXPECT_TRUE(equal(before, paused.lastOutlines()));
  ASSERT_GE(pauses, later.poses.size());  // a pause between any two fits
  for (std::size_t i = 0; i < later.poses.size(); ++i) {
    straight.add(later.contributions[i]);
    straight.add(later.poses[i]);
  }
  const std::vector<MapObject> after = paused.outlines();
  EXPECT_TRUE(equal(after, straight.outlines()));
  EXPECT_FALSE(equal(after, before));
}

TEST(Merger, RobotsAreNoObstaclesWhateverTheClassifierSays) {
  for (const ObjectKind kind : {ObjectKind::kObstacle, ObjectKind::kUnknown}) {
    SimOptions options = noisy();
    options.robots_are = kind;
    auto sim = arena(options, 6);
    Merger merger = merged(record(sim, 0.0, 8.0), sim.bodies());
    merger.finish();
    const Score s = score(merger.outlines(), sim.things());
    EXPECT_EQ(s.extra, 0) << toString(kind);
    EXPECT_EQ(s.missed, 0) << toString(kind);
  }
}

TEST(Merger, ASilentRobotThatNobodyNamedIsNotTakenForAnObstacle) {
  SimOptions options = noisy();
  options.robots_are = ObjectKind::kUnknown;
  auto sim = arena(options, 7);
  Sets sets = record(sim, 0.0, 6.0);
  const auto is_r3 = [](const auto& item) { return item.robot == "r3"; };  // stands, publishes nothing
  sets.contributions.erase(std::remove_if(sets.contributions.begin(), sets.contributions.end(), is_r3),
                           sets.contributions.end());
  sets.poses.erase(std::remove_if(sets.poses.begin(), sets.poses.end(), is_r3), sets.poses.end());
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  EXPECT_TRUE(merger.unmapped().empty());
  const Score s = score(merger.outlines(), sim.things());
  EXPECT_EQ(s.extra, 0);
  EXPECT_EQ(s.missed, 0);
}

TEST(Merger, UndecidedThingsAreDecidedAtTheEnd) {
  auto things = fiveObstacles();
  for (auto& thing : things) thing.kind = ObjectKind::kUnknown;
  auto sim = arena(noisy(), 8, things);
  Merger merger = merged(record(sim, 0.0, 6.0), sim.bodies());
  EXPECT_TRUE(merger.outlines().empty());
  const auto grid = merger.map().grid();
  EXPECT_EQ(std::count(grid.cells.begin(), grid.cells.end(), 100), 0);
  merger.finish();
  EXPECT_EQ(score(merger.outlines(), sim.things()).matched, 5);
  const auto decided = merger.map().grid();
  EXPECT_GT(std::count(decided.cells.begin(), decided.cells.end(), 100), 20);
}

void expectOne(const std::vector<Unmapped>& told, const Eigen::Vector2d& at_m, Unmapped::Why why) {
  ASSERT_EQ(told.size(), 1U);
  EXPECT_LT((told[0].at_m - at_m).norm(), 0.05);
  EXPECT_EQ(told[0].why, why);
}

TEST(Merger, AMovedBoxIsWhereItIsNow) {
  auto sim = arena(noisy(), 9);
  Sets sets = record(sim, 0.0, 4.0);
  const Eigen::Vector2d old_m = centroid(sim.things()[0].footprint_m);
  for (auto& corner : sim.things()[0].footprint_m) corner += Eigen::Vector2d(-0.45, 0.1);
  const Sets later = record(sim, 4.0, 10.0);
  sets.contributions.insert(sets.contributions.end(), later.contributions.begin(), later.contributions.end());
  sets.poses.insert(sets.poses.end(), later.poses.begin(), later.poses.end());
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  expectOne(merger.unmapped(), old_m, Unmapped::Why::kFloorSeen);
  const Score s = score(merger.outlines(), sim.things());
  EXPECT_EQ(s.missed, 0);
  EXPECT_EQ(s.extra, 0);
  PoseEstimate driven;
  driven.robot = "r1";
  driven.valid = true;
  driven.map_from_base = {old_m.x(), old_m.y() + 0.1, 0.0};
  Merger by_robot = merged(sets, sim.bodies());
  by_robot.addTrajectory(driven);
  by_robot.finish();
  EXPECT_TRUE(by_robot.unmapped().empty()) << "a robot drove there";
}

/// Seen in three frames of seven and then no more: not for longer than that happens.
TEST(Merger, WhatComesAndGoesHasNotGone) {
  auto sim = arena(noisy(), 9);
  auto others = fiveObstacles();
  others.erase(others.begin());
  auto without = arena(noisy(), 9, others);
  Sets sets = record(sim, 0.0, 6.0);
  const Sets floor = record(without, 0.0, 6.0);
  const std::size_t count = sets.contributions.size();
  for (std::size_t i = 0; i < count; ++i)
    if (i % 7 >= 3 || i + 8 >= count) sets.contributions[i] = floor.contributions[i];
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).missed, 0);
}

/// By less than its length: as a whole its track is no outline.
TEST(Merger, ABoxPushedAsideIsWhereItIsNow) {
  for (const Eigen::Vector2d& by_m : {Eigen::Vector2d(-0.28, 0.06), Eigen::Vector2d(0.2, 0.1)}) {
    auto sim = arena(noisy(), 9);
    Sets sets = record(sim, 0.0, 4.0);
    for (auto& corner : sim.things()[0].footprint_m) corner += by_m;
    const Sets later = record(sim, 4.0, 6.0);
    sets.contributions.insert(sets.contributions.end(), later.contributions.begin(),
                              later.contributions.end());
    sets.poses.insert(sets.poses.end(), later.poses.begin(), later.poses.end());
    Merger merger = merged(sets, sim.bodies());
    merger.finish();
    const Score s = score(merger.outlines(), sim.things());
    EXPECT_EQ(s.missed, 0);
    EXPECT_EQ(s.extra, 0);
    EXPECT_LT(s.error_m, 0.005);
  }
}

TEST(Merger, MergedSilhouettesDoNotBendOutlines) {
  auto sim = arena(noisy(), 10);
  Sets sets = record(sim, 0.0, 6.0);
  for (auto& c : sets.contributions) {
    if (c.robot != "r1") continue;
    for (auto& view : c.views) {  // r1 always sees box 1 stuck to something
      if (view.track_id != 1) continue;
      view.solidity_permille = 800;
      for (std::size_t k = 20; k < 50; ++k) view.b_dmm[k] += 2500;
    }
  }
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  EXPECT_TRUE(merger.unmapped().empty());
  const Score s = score(merger.outlines(), sim.things());
  EXPECT_EQ(s.missed, 0);
  EXPECT_EQ(s.extra, 0);
  EXPECT_GT(s.iou, 0.88);
}

/// Of which another piece is seen now and then, else nothing but that something ends the floor there: no
/// views of one flat thing, together they look like a low one.
TEST(Merger, PiecesOfAPatternAreNoObstacle) {
  constexpr std::uint32_t kMark = 6;  // after the five
  const Eigen::Vector2d at_m(0.3, 0.35);
  std::vector<Sets> seen;
  for (int piece = 0; piece < 4; ++piece) {
    auto things = fiveObstacles();
    const Eigen::Vector2d off_m = 0.02 * Eigen::Vector2d(std::cos(2.0 * piece), std::sin(2.0 * piece));
    things.push_back({boxPolygon(at_m + off_m, 0.18 + 0.03 * piece, 0.2, 0.4 * piece), 0.03});
    auto sim = arena(noisy(), 21, things);
    seen.push_back(record(sim, 0.0, 6.0));
  }
  Sets sets = seen[0];
  for (std::size_t i = 0; i < sets.contributions.size(); ++i) {
    auto& c = sets.contributions[i];
    if (i % 5 == 0) {
      c = seen[i / 5 % seen.size()].contributions[i];
      continue;
    }
    const auto isMark = [&](const auto& view) { return view.track_id == kMark; };
    c.views.erase(std::remove_if(c.views.begin(), c.views.end(), isMark), c.views.end());
    std::replace(c.object.begin(), c.object.end(), std::uint16_t{kMark}, std::uint16_t{0});
  }
  Merger merger = merged(sets, arena(noisy(), 21).bodies());
  merger.finish();
  expectOne(merger.unmapped(), at_m, Unmapped::Why::kFlat);
  const Score s = score(merger.outlines(), fiveObstacles());
  EXPECT_EQ(s.missed, 0);
  EXPECT_EQ(s.extra, 0);
}

TEST(Merger, AHeightThatNothingToldIsUnknown) {
  FleetSim sim({{circlePolygon({0.8, 0.1}, 0.14, 48), 0.4}}, {SimRobot{"r1", [](double) { return Pose2{}; }}},
               {});
  Sets sets;
  ContributionMaker maker({});
  for (const double t : {0.0, 0.5, 1.0}) {
    auto frame = sim.at(t).front();
    Track& track = frame.objects.tracks.front();
    for (std::size_t k = 0; k < track.supports.size(); ++k)  // its top is beyond the edge of the view
      if (track.supports.b_m[k] >= 0.0F) track.supports.sigma_m[k] = -1.0F;
    track.truncated = true;
    track.height_m = 0.25;  // what is thought of things that were not seen whole yet
    track.height_sigma_m = 0.125;
    const auto made = maker.make(frame.objects, frame.pose);
    ASSERT_TRUE(made);
    sets.contributions.push_back(made->contribution);
    sets.poses.push_back(made->pose);
  }
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  ASSERT_EQ(merger.outlines().size(), 1U);
  EXPECT_LE(merger.outlines().front().height_m, 0.0);
  EXPECT_LT((merger.outlines().front().centroid_m - Eigen::Vector2d(0.8, 0.1)).norm(), 0.01);
}

TEST(Merger, WhatOneFrameShowsAndTheOthersSeeThroughWasNeverThere) {
  FleetSim sim = arena(noisy(), 22);
  auto things = fiveObstacles();
  things.push_back({boxPolygon({0.3, 0.35}, 0.25, 0.25, 0.2), 0.15});
  FleetSim haunted = arena(noisy(), 22, things);
  const Sets truth = record(sim, 0.0, 3.0), ghost = record(haunted, 1.0, 1.1);
  Sets sets = ghost;
  for (std::size_t i = 0; i < truth.contributions.size(); ++i) {
    const auto& c = truth.contributions[i];
    const bool replaced =
        std::any_of(ghost.contributions.begin(), ghost.contributions.end(),
                    [&](const auto& g) { return g.robot == c.robot && g.acquired_ns == c.acquired_ns; });
    if (replaced) continue;
    sets.contributions.push_back(c);
    sets.poses.push_back(truth.poses[i]);
  }
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  expectOne(merger.unmapped(), {0.3, 0.35}, Unmapped::Why::kFloorSeen);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).missed, 0);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
  Merger alone = merged(ghost, sim.bodies());
  alone.finish();
  EXPECT_EQ(score(alone.outlines(), things).matched, 6);  // nobody says otherwise
}

/// Of what everybody sees one face only nothing tells how deep it is: it is no object, and that is told.
TEST(Merger, WhatIsSeenButCannotBeMappedIsTold) {
  auto things = fiveObstacles();
  const Eigen::Vector2d place(0.3, 0.35);
  things.push_back({boxPolygon(place, 0.25, 0.25, 0.2), 0.15});
  FleetSim sim = arena(noisy(), 22, things);
  Sets sets = record(sim, 0.0, 3.0);
  for (auto& c : sets.contributions) {
    for (auto& view : c.views) {
      if (view.track_id != things.size()) continue;
      const auto n = view.b_dmm.size();
      const auto contact = static_cast<std::size_t>(std::min_element(view.b_dmm.begin(), view.b_dmm.end()) -
                                                    view.b_dmm.begin());
      for (std::size_t k = 3; k + 2 < n; ++k) view.sigma_dmm[(contact + k) % n] = 0;
    }
  }
  Merger merger = merged(sets, sim.bodies());
  merger.outlines();
  EXPECT_TRUE(merger.unmapped().empty()) << "the end has not come";
  merger.finish();
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).missed, 0);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
  ASSERT_FALSE(merger.unmapped().empty());
  for (const Unmapped& unmapped : merger.unmapped()) {
    EXPECT_LT((unmapped.at_m - place).norm(), 0.3);
    EXPECT_EQ(unmapped.why, Unmapped::Why::kNoShape);
  }
}

TEST(Merger, TrackIdsThatChangeDoNotDoubleObjects) {
  auto sim = arena(noisy(), 11);
  Sets sets = record(sim, 0.0, 6.0);
  for (auto& c : sets.contributions) {
    if (c.acquired_ns < 3000000000) continue;
    for (auto& view : c.views) view.track_id += 200;  // every track was lost and found again
  }
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  const Score s = score(merger.outlines(), sim.things());
  EXPECT_EQ(s.missed, 0);
  EXPECT_EQ(s.extra, 0);
}

TEST(Merger, IdsComeFromTheEarliestContributionAndStay) {
  auto sim = arena(noisy(), 12);
  const Sets sets = record(sim, 0.0, 4.0), later = record(sim, 4.0, 8.0);
  Merger merger = merged(sets, sim.bodies());
  std::map<std::uint64_t, Eigen::Vector2d> before;
  for (const auto& object : merger.outlines()) before[object.id] = object.centroid_m;
  EXPECT_EQ(before.size(), 5U);
  for (const auto& c : later.contributions) merger.add(c);
  for (const auto& p : later.poses) merger.add(p);
  for (const auto& object : merger.outlines()) {
    ASSERT_TRUE(before.count(object.id));
    EXPECT_LT((before[object.id] - object.centroid_m).norm(), 0.02);
    EXPECT_GT(object.observations, 5);
    EXPECT_FALSE(object.observers.empty());
  }
}

TEST(Merger, FittingKeepsUpWithPublication) {
  auto sim = arena(noisy(), 13);
  const Sets sets = record(sim, 0.0, 12.0);
  Merger merger = merged(sets, sim.bodies());
  const std::clock_t start = std::clock();  // of this process alone: others may be busy
  merger.outlines();
  const double ms = 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  std::cout << ms << " ms for the outlines of " << sets.contributions.size() << " contributions\n";
  EXPECT_LT(ms, 2000);  // live it is asked for once a second; the margin is for sanitizers
}

TEST(Merger, OnlyNamedObserversShapeTheOutlinesAndRobotsStayOut) {
  auto sim = arena(noisy(), 13);
  MergerOptions options;
  options.observers = {"r2"};
  Merger merger = merged(record(sim, 0.0, 4.0), sim.bodies(), options);
  merger.finish();
  ASSERT_FALSE(merger.outlines().empty());
  for (const auto& object : merger.outlines()) EXPECT_THAT(object.observers, ::testing::ElementsAre("r2"));
  EXPECT_EQ(score(merger.outlines(), sim.things()).extra, 0);
}

TEST(MergerOptions, ReadAndBounded) {
  const auto o =
      MergerOptions::read(options::Section::parse("gate_m: 0.2\nprism: {directions: 48}\n", "o.yaml"));
  EXPECT_DOUBLE_EQ(o.gate_m, 0.2);
  EXPECT_EQ(o.prism.directions, 48);
  EXPECT_EQ(MergerOptions::read(options::Section::parse("method: hull\n", "o.yaml")).method, "hull");
  EXPECT_THROW(MergerOptions::read(options::Section::parse("method: circle\n", "o.yaml")), options::Error);
  EXPECT_THROW(MergerOptions::read(options::Section::parse("hull_share: 1.1\n", "o.yaml")), options::Error);
  EXPECT_THROW(MergerOptions::read(options::Section::parse("gate: 0.2\n", "o.yaml")), options::Error);
  EXPECT_THROW(MergerOptions::read(options::Section::parse("min_views: 0\n", "o.yaml")), options::Error);
  EXPECT_THROW(KeyframeOptions::read(options::Section::parse("distance_m: -1\n", "o.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::global_merger
