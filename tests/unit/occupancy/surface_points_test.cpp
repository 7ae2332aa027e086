// Surface points in the map: their places, their removal and their independence of order.

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <random>
#include <sstream>

#include "fleet_sim.h"
#include "occupancy/occupancy_map.h"
#include "occupancy/voxel_counts.h"

namespace omnifleet::occupancy {
namespace {

using omnifleet::testing::boxPolygon;
using omnifleet::testing::FleetSim;
using omnifleet::testing::SimOptions;
using omnifleet::testing::SimRobot;

constexpr double kBoxHeightM = 0.3;

struct Frames {
  std::vector<Contribution> contributions;
  std::vector<KeyframePose> poses;
};

FleetSim fleet(SimOptions options = {}) {
  std::vector<SimRobot> robots;
  robots.push_back({"r1", [](double t) { return Pose2{-0.9 + 0.1 * t, 0.0, 0.1 * t}; }});
  robots.push_back({"r2", [](double t) { return Pose2{1.0, -0.9 + 0.05 * t, 1.5}; }});
  return FleetSim({{boxPolygon({0.0, -0.9}, 0.4, 0.3, 0.3), kBoxHeightM}}, robots, options);
}

/// Points over the whole sides of visible objects and robots, with an error of up to 1 cm.
void addPoints(const Polygon& footprint, double height_m, const Pose2& map_from_base, std::mt19937& random,
               std::vector<ScenePoint>& points) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 8; ++i) {
    const std::size_t edge = random() % footprint.size();
    const Eigen::Vector2d a = footprint[edge], b = footprint[(edge + 1) % footprint.size()];
    const Eigen::Vector2d p = map_from_base.inverse() * (a + unit(random) * (b - a)) +
                              0.02 * Eigen::Vector2d(unit(random) - 0.5, unit(random) - 0.5);
    points.push_back(
        {{static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(height_m * unit(random))},
         0.01f});
  }
}

Frames recordPoints(FleetSim& sim, double from_s, double to_s) {
  Frames sets;
  std::mt19937 random(7);
  for (double t = from_s; t < to_s; t += 0.25) {
    for (auto& frame : sim.at(t)) {
      for (Track& track : frame.objects.tracks) {
        const bool is_robot = track.id > 100;
        const Polygon body =
            circlePolygon(frame.pose.map_from_base * track.position_m, sim.body().radius_m, 48);
        addPoints(is_robot ? body : sim.obstacles().front().footprint_m, kBoxHeightM,
                  frame.pose.map_from_base, random, track.points);
      }
      sets.contributions.push_back(makeContribution(frame.objects));
      sets.poses.push_back(makeKeyframePose(frame.pose));
    }
  }
  return sets;
}

void addAll(const Frames& sets, OccupancyMap& map) {
  for (const auto& c : sets.contributions) map.add(c);
  for (const auto& p : sets.poses) map.add(p);
}

/// Centres of the occupied voxels above the floor layer.
std::vector<Eigen::Vector3d> voxelsOf(const OccupancyMap& map) {
  std::istringstream in(map.octreeBytes(), std::ios::binary);
  octomap::OcTree tree(0.1);
  EXPECT_TRUE(tree.readBinary(in));
  tree.expand();
  std::vector<Eigen::Vector3d> middles;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf)
    if (leaf.getZ() > 0.05 && tree.isNodeOccupied(*leaf))
      middles.emplace_back(leaf.getX(), leaf.getY(), leaf.getZ());
  return middles;
}

double distanceToEdge(const Polygon& polygon, const Eigen::Vector2d& p) {
  double least = 1e9;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i], edge = polygon[(i + 1) % polygon.size()] - a;
    const double share = std::clamp((p - a).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (p - a - share * edge).norm());
  }
  return least;
}

TEST(SurfacePoints, LieOnTheSurfacesInTheOctree) {
  auto sim = fleet();
  OccupancyMap map({}, sim.bodies());
  addAll(recordPoints(sim, 0.0, 6.0), map);
  const auto voxels = voxelsOf(map);
  EXPECT_GT(voxels.size(), 60U);  // about 28 × 5 are on the sides
  for (const auto& v : voxels) {
    // Half a voxel diagonal in the plane, plus the error of the points.
    EXPECT_LT(distanceToEdge(sim.obstacles().front().footprint_m, v.head<2>()), 0.036 + 0.015)
        << v.transpose();
    EXPECT_LT(v.z(), kBoxHeightM + 0.026);
  }
}

TEST(SurfacePoints, AreIndependentOfOrderAndCorrections) {
  auto sim = fleet();
  const Frames sets = recordPoints(sim, 0.0, 5.0);
  Frames all = sets, last = sets;
  std::mt19937 random(3);
  for (std::size_t i = 0; i < sets.poses.size(); i += 2) {
    last.poses[i].revision = 1;
    last.poses[i].position.x_dmm += static_cast<std::int32_t>(random() % 800) - 400;
    last.poses[i].theta_dmrad += static_cast<std::int32_t>(random() % 400) - 200;
    if (i % 12 == 0) last.poses[i].valid = false;
    if (i % 10 == 0) last.poses[i].sightings.push_back({1, "r9"});
    all.poses.push_back(last.poses[i]);
  }
  OccupancyMap reference({}, sim.bodies());
  addAll(last, reference);
  EXPECT_GT(voxelsOf(reference).size(), 40U);
  for (unsigned seed = 1; seed <= 6; ++seed) {
    std::vector<std::pair<bool, std::size_t>> order;
    for (int copy = 0; copy < 2; ++copy) {
      for (std::size_t i = 0; i < all.contributions.size(); ++i) order.emplace_back(true, i);
      for (std::size_t i = 0; i < all.poses.size(); ++i) order.emplace_back(false, i);
    }
    std::shuffle(order.begin(), order.end(), random);
    OccupancyMap map({}, sim.bodies());
    for (const auto& [is_contribution, i] : order)
      is_contribution ? map.add(all.contributions[i]) : map.add(all.poses[i]);
    EXPECT_EQ(hexText(map.hash()), hexText(reference.hash()));
    EXPECT_EQ(map.octreeBytes(), reference.octreeBytes());
  }
}

TEST(SurfacePoints, VanishWhenTheBoxIsMoved) {
  auto sim = fleet();
  const Polygon before = sim.obstacles().front().footprint_m, after = boxPolygon({0.0, 1.0}, 0.4, 0.3, 0.3);
  OccupancyMap map({}, sim.bodies());
  addAll(recordPoints(sim, 0.0, 3.0), map);
  const auto near = [&](const Polygon& place) {
    const auto voxels = voxelsOf(map);
    return std::count_if(voxels.begin(), voxels.end(),
                         [&](const auto& v) { return distanceToEdge(place, v.template head<2>()) < 0.06; });
  };
  EXPECT_GT(near(before), 30);
  const auto hash = map.hash();
  sim.obstacles().front().footprint_m = after;
  addAll(recordPoints(sim, 3.0, 16.0), map);
  EXPECT_EQ(near(before), 0);
  EXPECT_GT(near(after), 30);
  EXPECT_NE(map.hash(), hash);
}

TEST(SurfacePoints, AreNeverMappedFromRobots) {
  SimOptions taken_for_obstacles;
  taken_for_obstacles.robots_are = ObjectKind::kObstacle;
  for (const SimOptions& options : {SimOptions{}, taken_for_obstacles}) {
    auto sim = fleet(options);
    OccupancyMap map({}, sim.bodies());
    const Frames sets = recordPoints(sim, 0.0, 4.0);
    addAll(sets, map);
    for (const auto& v : voxelsOf(map))
      EXPECT_LT(distanceToEdge(sim.obstacles().front().footprint_m, v.head<2>()), 0.06);
    EXPECT_EQ(std::any_of(sets.contributions.begin(), sets.contributions.end(),
                          [](const Contribution& c) {
                            return std::any_of(c.points.begin(), c.points.end(),
                                               [](const SurfacePoint& p) { return p.track > 100; });
                          }),
              options.robots_are == ObjectKind::kObstacle);  // points of known robots are not published
  }
}

TEST(SurfacePoints, AreRemovedIfTheTrackIsARobot) {
  auto sim = fleet();
  Frames sets = recordPoints(sim, 0.0, 3.0);
  OccupancyMap map({}, {});
  addAll(sets, map);
  EXPECT_FALSE(voxelsOf(map).empty());
  map.overrideKinds({{{"r1", 1}, ObjectKind::kRobot}, {{"r2", 1}, ObjectKind::kRobot}});
  EXPECT_TRUE(voxelsOf(map).empty());
  map.overrideKinds({});
  EXPECT_FALSE(voxelsOf(map).empty());
}

/// One point, then views that see the floor up to one range all around. The voxel is removed if its centre
/// would hide floor that is seen.
TEST(SurfacePoints, AreRemovedIfTheFloorBehindIsSeen) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  OccupancyOptions options;
  options.least_point_hits = 1;
  int gone = 0, kept = 0;
  for (int i = 0; i < 200; ++i) {
    const double phi = 2.0 * M_PI * unit(random), away = 0.3 + 1.5 * unit(random);
    const double z = 0.05 + 0.5 * unit(random), range = 0.5 + 2.0 * unit(random);
    Objects objects;
    objects.robot = "r1";
    objects.acquired_ns = 0;
    objects.camera_height_m = 0.5;
    Track track;
    track.id = 1;
    track.kind = ObjectKind::kObstacle;
    track.visible = true;
    track.points = {{{static_cast<float>(away * std::cos(phi)), static_cast<float>(away * std::sin(phi)),
                      static_cast<float>(z)},
                     0.01f}};
    objects.tracks = {track};
    PoseEstimate pose;
    pose.robot = "r1";
    pose.valid = true;
    pose.covariance *= 1e-6;
    pose.map_from_base = {0.317, -0.211, 6.0 * unit(random)};
    OccupancyMap map(options, {});
    for (int k = 0; k < 4; ++k) {
      pose.acquired_ns = objects.acquired_ns = 10'000'000'000LL * k;
      map.add(makeContribution(objects));
      map.add(makeKeyframePose(pose));
      objects.tracks.clear();
      objects.scan.range_m.assign(360, static_cast<float>(range));
      objects.scan.sigma_m.assign(360, 0.01f);
      objects.scan.label.assign(360, RayLabel::kFloorEnd);
      objects.scan.object.assign(360, 0);
    }
    const Eigen::Vector2d p =
        pose.map_from_base * Eigen::Vector2d(track.points[0].point_m.head<2>().cast<double>());
    const Eigen::Vector3d middle = 0.05 * (Eigen::Vector3d(p.x(), p.y(), z) / 0.05).array().floor().matrix() +
                                   Eigen::Vector3d::Constant(0.025);
    const double hidden =
        (middle.head<2>() - pose.map_from_base.translation()).norm() * 0.5 / (0.5 - middle.z()) + 0.05;
    if (std::abs(hidden - range) < 0.002) continue;  // poses and ranges are rounded
    const bool seen_through = middle.z() < 0.5 && hidden < range;
    EXPECT_EQ(voxelsOf(map).empty(), seen_through) << middle.transpose() << " range " << range;
    (seen_through ? gone : kept) += 1;
  }
  EXPECT_GT(gone, 20);
  EXPECT_GT(kept, 20);
}

TEST(SurfacePoints, AreLimitedToThoseOfSmallestSigma) {
  Objects objects;
  Track track;
  track.id = 70001;  // 16 bits are transmitted
  track.visible = true;
  for (int i = 0; i < 100; ++i)
    track.points.push_back({{1.0f, 0.01f * i, 0.2f}, 0.001f * static_cast<float>(1 + (i * 37) % 100)});
  track.points.push_back({{4.0f, 0.0f, 0.2f}, 0.0005f});  // beyond the range of 16 bits
  track.points.push_back({{1.0f, 0.0f, 0.2f}, 0.0f});     // σ unknown
  objects.tracks = {track};
  const auto points = makeContribution(objects).points;
  ASSERT_EQ(points.size(), Contribution::kMaxPoints);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].sigma_dmm, 10 * (i + 1));
    EXPECT_EQ(points[i].x_dmm, 10000);
    EXPECT_EQ(points[i].track, 70001 & 0xFFFF);
  }
}

}  // namespace
}  // namespace omnifleet::occupancy
