#include "occupancy/occupancy_map.h"

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <random>
#include <sstream>

#include "fleet_sim.h"

namespace omnifleet::occupancy {
namespace {

using omnifleet::testing::boxPolygon;
using omnifleet::testing::FleetSim;
using omnifleet::testing::SimOptions;
using omnifleet::testing::SimRobot;

struct Sets {
  std::vector<Contribution> contributions;
  std::vector<KeyframePose> poses;
};

FleetSim threeRobots(SimOptions options = {}) {
  std::vector<SimRobot> robots;
  robots.push_back({"r1", [](double t) { return Pose2{-0.9 + 0.2 * t, 0.0, 0.1 * t}; }});
  robots.push_back({"r2", [](double t) { return Pose2{1.0, -0.9 + 0.15 * t, 1.5}; }});
  robots.push_back({"r3", [](double) { return Pose2{0.2, 1.2, -2.0}; }});  // stationary
  return FleetSim(
      {{boxPolygon({0.0, -0.9}, 0.4, 0.3, 0.3), 0.2}, {boxPolygon({1.6, 0.9}, 0.3, 0.3, 0.0), 0.2}}, robots,
      options);
}

Sets record(FleetSim& sim, double from_s, double to_s) {
  Sets sets;
  for (double t = from_s; t < to_s; t += 0.25) {
    for (auto& frame : sim.at(t)) {
      sets.contributions.push_back(makeContribution(frame.objects));
      sets.poses.push_back(makeKeyframePose(frame.pose));
    }
  }
  return sets;
}

OccupancyMap build(const Sets& sets, const std::map<std::string, RobotBody>& bodies,
                   OccupancyOptions options = {}) {
  OccupancyMap map(options, bodies);
  for (const auto& c : sets.contributions) map.add(c);
  for (const auto& p : sets.poses) map.add(p);
  return map;
}

void expectEqual(const OccupancyMap& a, const OccupancyMap& b) {
  EXPECT_EQ(hexText(a.hash()), hexText(b.hash()));
  EXPECT_EQ(a.grid().cells, b.grid().cells);
  EXPECT_EQ(a.grid().origin_m, b.grid().origin_m);
  EXPECT_EQ(a.octreeBytes(), b.octreeBytes());
}

/// Adds everything twice, in a random order.
OccupancyMap shuffled(const Sets& sets, const std::map<std::string, RobotBody>& bodies, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::pair<int, std::size_t>> order;
  for (int copy = 0; copy < 2; ++copy) {
    for (std::size_t i = 0; i < sets.contributions.size(); ++i) order.emplace_back(0, i);
    for (std::size_t i = 0; i < sets.poses.size(); ++i) order.emplace_back(1, i);
  }
  std::shuffle(order.begin(), order.end(), random);
  OccupancyMap map({}, bodies);
  for (const auto& [what, i] : order) what == 0 ? map.add(sets.contributions[i]) : map.add(sets.poses[i]);
  return map;
}

TEST(OccupancyMap, IsIndependentOfOrderAndDuplicates) {
  auto sim = threeRobots();
  const Sets sets = record(sim, 0.0, 8.0);
  const OccupancyMap reference = build(sets, sim.bodies());
  EXPECT_GT(reference.grid().width, 40);
  for (unsigned seed = 1; seed <= 8; ++seed) expectEqual(shuffled(sets, sim.bodies(), seed), reference);
}

TEST(OccupancyMap, MatchesRebuiltMapAfterPoseCorrections) {
  auto sim = threeRobots();
  const Sets sets = record(sim, 0.0, 6.0);
  Sets corrected = sets;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 300.0);
  Sets history = sets;
  for (std::uint32_t revision = 1; revision <= 3; ++revision) {
    for (std::size_t i = 0; i < sets.poses.size(); ++i) {
      if (random() % 3 == 0) continue;
      KeyframePose pose = sets.poses[i];
      pose.revision = revision;
      pose.position.x_dmm += static_cast<std::int32_t>(normal(random));
      pose.theta_dmrad += static_cast<std::int32_t>(normal(random));
      pose.valid = random() % 10 != 0;
      if (random() % 4 == 0)
        pose.camera_error = {static_cast<std::int32_t>(normal(random)) * 10, 0, 2000, -900};
      if (pose.valid && random() % 4 == 0)
        pose.sightings.push_back({1U + static_cast<std::uint32_t>(random() % 3), "x"});
      corrected.poses[i] = pose;
      history.poses.push_back(pose);
    }
  }
  const OccupancyMap reference = build(corrected, sim.bodies());
  expectEqual(build(history, sim.bodies()), reference);
  for (unsigned seed = 11; seed <= 14; ++seed) expectEqual(shuffled(history, sim.bodies(), seed), reference);
}

TEST(OccupancyMap, PrefersHigherTermOverHigherRevision) {
  auto sim = threeRobots();
  Sets sets = record(sim, 0.0, 0.5);
  KeyframePose late = sets.poses[0];
  late.term = 2;
  late.position.x_dmm += 1000;
  KeyframePose early = sets.poses[0];
  early.term = 1;
  early.revision = 9;
  early.position.x_dmm -= 1000;
  OccupancyMap a = build(sets, sim.bodies()), b = build(sets, sim.bodies());
  EXPECT_TRUE(a.add(late));
  EXPECT_FALSE(a.add(early));
  EXPECT_TRUE(b.add(early));
  EXPECT_TRUE(b.add(late));
  expectEqual(a, b);
  EXPECT_EQ(a.store().find("r1", 0)->pose->position.x_dmm, late.position.x_dmm);
}

TEST(OccupancyMap, IsEmptyAfterAllPosesBecomeInvalid) {
  auto sim = threeRobots();
  const Sets sets = record(sim, 0.0, 3.0);
  OccupancyMap map = build(sets, sim.bodies());
  for (auto pose : sets.poses) {
    pose.revision = 1;
    pose.valid = false;
    map.add(pose);
  }
  expectEqual(map, OccupancyMap({}, sim.bodies()));
  EXPECT_EQ(map.grid().width, 0);
}

TEST(OccupancyMap, MarksObstaclesAndFreeFloor) {
  auto sim = threeRobots();
  const OccupancyMap map = build(record(sim, 0.0, 8.0), sim.bodies());
  for (const auto& obstacle : sim.obstacles()) {
    int marked = 0;
    for (const auto& corner : obstacle.footprint_m) {
      const Eigen::Vector2d inside = 0.9 * corner + 0.1 * centroid(obstacle.footprint_m);
      marked += map.at(inside) == CellClass::kOccupied;
    }
    EXPECT_GE(marked, 2);  // the corners that face robots
  }
  EXPECT_EQ(map.at({-0.3, 0.6}), CellClass::kFree);
  EXPECT_EQ(map.at({5.0, 5.0}), CellClass::kUnknown);
}

/// Number of occupied cells that do not belong to an obstacle (within its half diagonal and a cell).
int marksAwayFrom(const std::vector<omnifleet::testing::SimObstacle>& obstacles, const OccupancyMap& map) {
  const auto grid = map.grid();
  int away = 0;
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      if (grid.cells[static_cast<std::size_t>(y * grid.width + x)] != 100) continue;
      const Eigen::Vector2d centre = grid.origin_m + grid.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      const bool near = std::any_of(obstacles.begin(), obstacles.end(), [&](const auto& obstacle) {
        if (contains(obstacle.footprint_m, centre)) return true;
        return std::any_of(obstacle.footprint_m.begin(), obstacle.footprint_m.end(), [&](const auto& corner) {
          return (corner - centre).norm() < 0.36;  // the half diagonal of the box and a cell
        });
      });
      away += near ? 0 : 1;
    }
  }
  return away;
}

TEST(OccupancyMap, LeavesOutRobotsOfAnyClassifiedKind) {
  for (const ObjectKind kind : {ObjectKind::kRobot, ObjectKind::kObstacle, ObjectKind::kUnknown}) {
    SimOptions options;
    options.robots_are = kind;  // kObstacle: the classifier is always wrong, only poses identify robots
    auto sim = threeRobots(options);
    const OccupancyMap map = build(record(sim, 0.0, 8.0), sim.bodies());
    EXPECT_EQ(marksAwayFrom(sim.obstacles(), map), 0) << toString(kind);
  }
}

/// A wall 1 m ahead; rays of r1 that miss the parked r2 in front of it report the wall behind it, too.
TEST(OccupancyMap, CutsRaysThatCrossAnotherRobot) {
  Contribution seen;
  seen.robot = "r1";
  seen.acquired_ns = 1'000'000'000;
  for (int i = 0; i < 720; ++i) {
    const double along = std::cos(2.0 * M_PI * i / 720);
    const bool ahead = along > 0.5;
    seen.range_dmm.push_back(ahead ? static_cast<std::int32_t>(10100.0 / along) : 0);
    seen.label.push_back(ahead ? RayLabel::kObstacle : RayLabel::kInvalid);
  }
  seen.sigma_dmm.assign(720, 20);
  seen.object.assign(720, 0);
  const auto poseOf = [](const std::string& robot, std::int32_t x_dmm) {
    KeyframePose pose;
    pose.robot = robot;
    pose.acquired_ns = 1'000'000'000;
    pose.valid = true;
    pose.position = {x_dmm, 0};
    return pose;
  };
  RobotBody box;
  box.footprint_m = {{-0.08, -0.06}, {0.08, -0.06}, {0.08, 0.06}, {-0.08, 0.06}};
  OccupancyMap map({}, {{"r1", box}, {"r2", box}});
  map.add(seen);
  map.add(poseOf("r1", 0));
  EXPECT_EQ(map.at({1.01, 0.0}), CellClass::kOccupied);
  EXPECT_EQ(map.at({0.8, 0.0}), CellClass::kFree);
  const auto alone = map.hash();
  map.add(poseOf("r2", 5000));  // as of the same time
  EXPECT_EQ(map.at({1.01, 0.0}), CellClass::kUnknown) << "the wall behind the robot";
  EXPECT_EQ(map.at({0.8, 0.0}), CellClass::kUnknown) << "the floor behind the robot";
  EXPECT_EQ(map.at({0.3, 0.0}), CellClass::kFree) << "the floor before the robot";
  EXPECT_EQ(map.at({1.01, 0.4}), CellClass::kOccupied) << "the wall beside the robot";
  KeyframePose elsewhere = poseOf("r2", 50000);
  elsewhere.term = 1;
  map.add(elsewhere);
  EXPECT_EQ(hexText(map.hash()), hexText(alone)) << "the robot was not there";
}

TEST(OccupancyMap, RemovesRobotWhosePosesArriveLate) {
  SimOptions options;
  options.robots_are = ObjectKind::kObstacle;
  auto sim = threeRobots(options);
  Sets sets = record(sim, 0.0, 4.0);
  Sets poses_of_r3;  // r3 is stationary and publishes nothing until the end
  OccupancyMap map({}, sim.bodies());
  for (const auto& c : sets.contributions) map.add(c);
  for (const auto& p : sets.poses) {
    if (p.robot == "r3") {
      poses_of_r3.poses.push_back(p);
    } else {
      map.add(p);
    }
  }
  EXPECT_GT(marksAwayFrom(sim.obstacles(), map), 0);
  OccupancyMap by_track = build({}, sim.bodies());
  for (const auto& p : poses_of_r3.poses) map.add(p);
  EXPECT_EQ(marksAwayFrom(sim.obstacles(), map), 0);
  expectEqual(map, build(sets, sim.bodies()));
}

TEST(OccupancyMap, RemovesTrackClassifiedAsRobotLate) {
  SimOptions options;
  options.robots_are = ObjectKind::kObstacle;
  auto sim = threeRobots(options);
  Sets sets = record(sim, 0.0, 4.0);
  Sets without = sets;  // r3's own data never arrive; the classifiers of the others decide in the last frame
  const auto is_r3 = [](const auto& item) { return item.robot == "r3"; };
  without.poses.erase(std::remove_if(without.poses.begin(), without.poses.end(), is_r3), without.poses.end());
  EXPECT_GT(marksAwayFrom(sim.obstacles(), build(without, sim.bodies())), 0);
  for (auto& c : without.contributions) {
    if (c.acquired_ns != 3750000000) continue;
    for (auto& view : c.views) {
      if (view.track_id > 100) view.kind = ObjectKind::kRobot;
    }
  }
  const OccupancyMap map = build(without, sim.bodies());
  EXPECT_EQ(marksAwayFrom(sim.obstacles(), map), 0);
  for (unsigned seed = 21; seed <= 23; ++seed) expectEqual(shuffled(without, sim.bodies(), seed), map);
}

TEST(OccupancyMap, AppliesAndRevertsKindOverrides) {
  SimOptions options;
  options.robots_are = ObjectKind::kUnknown;
  auto sim = threeRobots(options);
  Sets sets = record(sim, 0.0, 2.0);
  for (auto& c : sets.contributions) {  // the second box is undecided too
    for (auto& view : c.views) {
      if (view.track_id == 2) view.kind = ObjectKind::kUnknown;
    }
    for (std::size_t i = 0; i < c.label.size(); ++i) {
      if (c.object[i] == 2) c.label[i] = RayLabel::kUnknown;
    }
  }
  OccupancyMap map = build(sets, sim.bodies());
  const std::string before = hexText(map.hash());
  const Eigen::Vector2d face(1.46, 0.8);  // just inside the box, towards r2
  EXPECT_NE(map.at(face), CellClass::kOccupied);
  map.overrideKinds({{{"r1", 2}, ObjectKind::kObstacle},
                     {{"r2", 2}, ObjectKind::kObstacle},
                     {{"r3", 2}, ObjectKind::kObstacle}});
  EXPECT_EQ(map.at(face), CellClass::kOccupied);
  map.overrideKinds({});
  EXPECT_EQ(hexText(map.hash()), before);
}

TEST(OccupancyMap, ClearsOldPlaceOfAMovedBox) {
  auto sim = threeRobots();
  const Eigen::Vector2d old_place =
      0.5 * (sim.obstacles()[0].footprint_m[2] + sim.obstacles()[0].footprint_m[3]);
  Sets sets = record(sim, 0.0, 5.0);
  for (auto& corner : sim.obstacles()[0].footprint_m) corner += Eigen::Vector2d(-0.7, 0.2);
  const Sets later = record(sim, 5.0, 12.0);
  OccupancyMap map = build(sets, sim.bodies());
  const Eigen::Vector2d inwards = old_place + Eigen::Vector2d(0.0, -0.02);
  EXPECT_EQ(map.at(inwards), CellClass::kOccupied);
  for (const auto& c : later.contributions) map.add(c);
  for (const auto& p : later.poses) map.add(p);
  EXPECT_EQ(map.at(inwards), CellClass::kFree);
  EXPECT_EQ(marksAwayFrom(sim.obstacles(), map), 0);
}

/// The same scans inserted with OctoMap's own functions, at half a cell's height so that everything is in one
/// layer.
octomap::OcTree throughOctomap(const Sets& sets, double max_range_m) {
  octomap::OcTree tree(0.05);
  for (std::size_t i = 0; i < sets.contributions.size(); ++i) {
    const auto& c = sets.contributions[i];
    const Pose2 pose = sets.poses[i].mapFromBase();
    const octomap::point3d origin(static_cast<float>(pose.x_m), static_cast<float>(pose.y_m), 0.025F);
    octomap::KeySet free, occupied;
    octomap::Pointcloud hits;
    for (std::size_t ray = 0; ray < c.range_dmm.size(); ++ray) {
      const double range = 1e-4 * c.range_dmm[ray];
      const double bearing =
          pose.theta_rad + 2.0 * M_PI * static_cast<double>(ray) / static_cast<double>(c.range_dmm.size());
      const octomap::point3d end(static_cast<float>(pose.x_m + range * std::cos(bearing)),
                                 static_cast<float>(pose.y_m + range * std::sin(bearing)), 0.025F);
      if (c.label[ray] == RayLabel::kObstacle && range <= max_range_m) hits.push_back(end);
      octomap::KeyRay keys;
      if (c.label[ray] == RayLabel::kFloorEnd && tree.computeRayKeys(origin, end, keys)) {
        free.insert(keys.begin(), keys.end());
        free.insert(tree.coordToKey(end));
      }
    }
    octomap::KeySet cloud_free;
    tree.computeUpdate(hits, origin, cloud_free, occupied, -1.0);  // the first step of insertPointCloud
    free.insert(cloud_free.begin(), cloud_free.end());
    for (const auto& key : free) {
      if (occupied.find(key) == occupied.end()) tree.updateNode(key, false);
    }
    for (const auto& key : occupied) tree.updateNode(key, true);
  }
  return tree;
}

TEST(OccupancyMap, MatchesClassesOfOctomapInsertion) {
  std::vector<SimRobot> robots{{"r1", [](double t) { return Pose2{-0.3 + 0.2 * t, 0.1, 0.1 * t}; }}};
  FleetSim sim({{boxPolygon({0.5, -0.9}, 0.4, 0.3, 0.3), 0.2}, {boxPolygon({0.3, 1.2}, 0.5, 0.2, 0.0), 0.2}},
               robots, {});
  const Sets sets = record(sim, 0.0, 4.0);
  OccupancyOptions options;
  options.robot_margin_m = 0.0;
  options.bucket_s = 0.25;  // one bucket per scan, as OctoMap clamps after each scan
  OccupancyMap map({options}, {{"r1", RobotBody{0.001, {}, 0.1, 0.2}}});
  for (const auto& c : sets.contributions) map.add(c);
  for (const auto& p : sets.poses) map.add(p);
  octomap::OcTree tree = throughOctomap(sets, options.max_range_m);
  const auto grid = map.grid();
  int same = 0, differ = 0;
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const Eigen::Vector2d centre = grid.origin_m + grid.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      const auto* node = tree.search(centre.x(), centre.y(), 0.025);
      const CellClass expected = node == nullptr             ? CellClass::kUnknown
                                 : tree.isNodeOccupied(node) ? CellClass::kOccupied
                                                             : CellClass::kFree;
      (map.at(centre) == expected ? same : differ) += 1;
    }
  }
  // Rays that graze a corner may fall on either side, because OctoMap computes in floats. Cells under the
  // robot (1 mm) stay.
  EXPECT_LT(differ, 0.015 * same) << same << " cells agree";
  EXPECT_GT(same, 5000);
}

TEST(OccupancyMap, WritesOctreeReadableByOctomap) {
  auto sim = threeRobots();
  const OccupancyMap map = build(record(sim, 0.0, 4.0), sim.bodies());
  const std::string bytes = map.octreeBytes();
  std::istringstream in(bytes, std::ios::binary);
  octomap::OcTree tree(0.1);
  ASSERT_TRUE(tree.readBinary(in));
  EXPECT_DOUBLE_EQ(tree.getResolution(), 0.05);
  const auto grid = map.grid();
  std::size_t known = 0;
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const Eigen::Vector2d centre = grid.origin_m + grid.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      const auto* node = tree.search(centre.x(), centre.y(), 0.025);
      const auto cell = grid.cells[static_cast<std::size_t>(y * grid.width + x)];
      EXPECT_EQ(node == nullptr ? -1 : (tree.isNodeOccupied(node) ? 100 : 0), static_cast<int>(cell));
      known += cell >= 0 ? 1U : 0U;
    }
  }
  EXPECT_EQ(tree.getNumLeafNodes(), known);
  std::ostringstream again(std::ios::binary);
  ASSERT_TRUE(tree.writeBinaryConst(again));
  EXPECT_EQ(again.str(), bytes);  // equal to OctoMap's own output byte for byte
}

TEST(OccupancyMap, WritesObjectsAsColumnsOfTheOctree) {
  auto sim = threeRobots();
  const OccupancyMap map = build(record(sim, 0.0, 1.0), sim.bodies());
  dataset::MapObject box, flat;
  box.outline_m = {{0.0, 0.0}, {0.30, 0.0}, {0.30, 0.20}, {0.0, 0.20}};
  box.height_m = 0.21;
  flat.outline_m = {{1.0, 0.0}, {1.30, 0.0}, {1.30, 0.20}, {1.0, 0.20}};  // unknown height
  std::istringstream in(map.octreeBytes({box, flat}), std::ios::binary);
  octomap::OcTree tree(0.1);
  ASSERT_TRUE(tree.readBinary(in));
  // 6 × 4 cells of 5 cm. Four levels reach up to 20 cm; a fifth would end 4 cm above the box.
  int above_ground = 0, of_flat = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (leaf.getZ() < 0.05) {
      of_flat += tree.isNodeOccupied(*leaf) && contains(flat.outline_m, {leaf.getX(), leaf.getY()}) ? 1 : 0;
      continue;
    }
    ++above_ground;
    EXPECT_TRUE(tree.isNodeOccupied(*leaf));
    EXPECT_TRUE(contains(box.outline_m, {leaf.getX(), leaf.getY()})) << leaf.getX() << " " << leaf.getY();
    EXPECT_LT(leaf.getZ(), box.height_m);
  }
  EXPECT_EQ(above_ground, 6 * 4 * 3);
  EXPECT_EQ(of_flat, 6 * 4) << "an object of unknown height occupies the layer";
  const std::string before = map.octreeBytes();
  EXPECT_NE(map.octreeBytes({box}), before);
  EXPECT_EQ(map.octreeBytes(), before);
}

// In frames that missed the object the rays see floor there.
TEST(OccupancyMap, MarksGridOccupiedUnderObjects) {
  auto sim = threeRobots();
  const OccupancyMap map = build(record(sim, 0.0, 1.0), sim.bodies());
  const auto rays = map.grid();
  dataset::MapObject box, beyond;
  const auto cellAt = [&](const dataset::OccupancyGrid& grid, const Eigen::Vector2d& at_m) {
    const Eigen::Vector2d cell = (at_m - grid.origin_m) / grid.resolution_m;
    return grid.cells[static_cast<std::size_t>(std::floor(cell.y())) * static_cast<std::size_t>(grid.width) +
                      static_cast<std::size_t>(std::floor(cell.x()))];
  };
  const auto free = std::find(rays.cells.begin(), rays.cells.end(), std::int8_t{0}) - rays.cells.begin();
  const Eigen::Vector2d corner =
      rays.origin_m + rays.resolution_m * Eigen::Vector2d(static_cast<double>(free % rays.width),
                                                          static_cast<double>(free / rays.width));
  box.outline_m = {corner, corner + Eigen::Vector2d(0.05, 0.0), corner + Eigen::Vector2d(0.05, 0.05),
                   corner + Eigen::Vector2d(0.0, 0.05)};
  beyond.outline_m = {{90.0, 0.0}, {90.3, 0.0}, {90.3, 0.2}};  // outside the known cells: ignored
  const auto grid = map.grid({box, beyond});
  EXPECT_EQ(grid.width, rays.width);
  EXPECT_EQ(cellAt(rays, corner.array() + 0.025), 0);
  EXPECT_EQ(cellAt(grid, corner.array() + 0.025), 100);
  const auto differ = [&] {
    int count = 0;
    for (std::size_t i = 0; i < grid.cells.size(); ++i) count += grid.cells[i] != rays.cells[i] ? 1 : 0;
    return count;
  };
  EXPECT_EQ(differ(), 1);
}

TEST(OccupancyMap, RotatesPolygonFootprintsWithTheRobot) {
  // A long robot stands across r1's view and is labelled as an obstacle. Only its rotated footprint removes
  // it.
  std::vector<SimRobot> robots{{"r1", [](double) { return Pose2{0, 0, 0}; }}};
  const Polygon body{{-0.1, -0.05}, {0.5, -0.05}, {0.5, 0.05}, {-0.1, 0.05}};
  const Pose2 long_robot{0.8, -0.3, 1.2};
  Polygon footprint;
  for (const auto& p : body) footprint.push_back(long_robot * p);
  FleetSim sim({{footprint, 0.2}}, robots, {});
  Sets sets = record(sim, 0.0, 1.0);
  KeyframePose pose;
  pose.robot = "long";
  pose.acquired_ns = 500000000;
  pose.valid = true;
  pose.position = {8000, -3000};
  pose.theta_dmrad = 12000;
  auto bodies = sim.bodies();
  bodies["long"] = {0.0, body, 0.2, 0.2};
  OccupancyMap map = build(sets, bodies);
  EXPECT_EQ(marksAwayFrom({}, map) > 0, true);
  map.add(pose);
  EXPECT_EQ(marksAwayFrom({}, map), 0);
  pose.revision = 1;
  pose.theta_dmrad = -3000;  // rotated away: the obstacle is visible again
  map.add(pose);
  EXPECT_GT(marksAwayFrom({}, map), 0);
}

TEST(OccupancyMap, IgnoresInvalidInput) {
  OccupancyMap map({}, {});
  Contribution broken;
  broken.robot = "r1";
  broken.range_dmm = {-5, 2000000000, 10000, 10000};
  broken.label = {RayLabel::kObstacle, RayLabel::kObstacle, static_cast<RayLabel>(99)};
  KeyframePose pose;
  pose.robot = "r1";
  pose.valid = true;
  pose.position = {2000000000, 0};
  map.add(broken);
  map.add(pose);
  EXPECT_EQ(map.grid().width, 0);
  pose.revision = 1;
  pose.position = {0, 0};
  map.add(pose);  // only the overlong ray counts, as free up to the maximum range
  EXPECT_GT(map.grid().width, 0);
  const auto grid = map.grid();
  EXPECT_EQ(std::count(grid.cells.begin(), grid.cells.end(), 100), 0);
  EXPECT_EQ(map.at({std::nan(""), 0}), CellClass::kUnknown);
}

TEST(OccupancyMap, WritesOctreeOnlyOnClassChanges) {
  // This makes merging fast (see the benchmark). 240 scans mark some thousands of cells each. A cell changes
  // class when first seen, and then rarely.
  auto sim = threeRobots();
  const Sets sets = record(sim, 0.0, 20.0);
  const OccupancyMap map = build(sets, sim.bodies());
  const auto grid = map.grid();
  const auto known =
      std::count_if(grid.cells.begin(), grid.cells.end(), [](std::int8_t cell) { return cell >= 0; });
  EXPECT_GT(map.classChanges(), static_cast<std::uint64_t>(known) / 2);
  EXPECT_LT(map.classChanges(), 3 * static_cast<std::uint64_t>(known));
}

TEST(OccupancyOptions, ReadsAndRejectsInvalidValues) {
  const auto o = OccupancyOptions::read(options::Section::parse("resolution_m: 0.1\nhold_s: 2\n", "o.yaml"));
  EXPECT_DOUBLE_EQ(o.resolution_m, 0.1);
  EXPECT_THROW(OccupancyOptions::read(options::Section::parse("resolution_m: 0.05005\n", "o.yaml")),
               options::Error);
  EXPECT_THROW(OccupancyOptions::read(options::Section::parse("probability_hit: 0.2\n", "o.yaml")),
               options::Error);
  EXPECT_THROW(OccupancyOptions::read(options::Section::parse("resolution: 0.1\n", "o.yaml")),
               options::Error);
}

}  // namespace
}  // namespace omnifleet::occupancy
