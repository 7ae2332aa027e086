// The rays of the map, from a labelled scan and the boundary of the floor. Walls in closed form.

#include "occupancy/map_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace omnifleet::occupancy {
namespace {

constexpr std::size_t kRayCount = 360, kBeamCount = 720;
constexpr double kInverseSigma = 0.003;  // 1/m: a quarter of a pixel of a camera of 640 × 480 at 0.5 m

/// A scan that shows floor up to 3 m everywhere, and a boundary without edges.
Objects openFloor() {
  Objects objects;
  objects.scan.range_m.assign(kRayCount, 3.0F);
  objects.scan.sigma_m.assign(kRayCount, 0.02F);
  objects.scan.label.assign(kRayCount, RayLabel::kFloorEnd);
  objects.scan.object.assign(kRayCount, 0);
  objects.boundary.inverse_m.assign(kBeamCount, 0.0F);
  objects.boundary.sigma.assign(kBeamCount, 0.0F);
  objects.boundary.moving.assign(kBeamCount, 0);
  return objects;
}

/// Every ray has two beams; the first one has its bearing.
std::size_t beamOf(std::size_t ray) {
  return ray * kBeamCount / kRayCount;
}

/// A single edge has no line around it.
void addEdge(Objects& objects, std::size_t ray, double range_m, double sigma_m) {
  objects.boundary.inverse_m[beamOf(ray)] = static_cast<float>(1.0 / range_m);
  objects.boundary.sigma[beamOf(ray)] = static_cast<float>(sigma_m / (range_m * range_m));
}

void setRay(Objects& objects, std::size_t ray, double range_m, RayLabel label, std::uint16_t object = 0) {
  objects.scan.range_m[ray] = static_cast<float>(range_m);
  objects.scan.label[ray] = label;
  objects.scan.object[ray] = object;
}

void expectRay(const Scan& rays, std::size_t i, double range_m, RayLabel label, std::uint16_t object = 0) {
  EXPECT_NEAR(rays.range_m[i], range_m, 1e-5) << i;  // the boundary holds 1/range as float
  EXPECT_EQ(static_cast<int>(rays.label[i]), static_cast<int>(label)) << i;
  EXPECT_EQ(rays.object[i], object) << i;
}

void expectSameScan(const Scan& rays, const Scan& scan) {
  EXPECT_EQ(rays.range_m, scan.range_m);
  EXPECT_EQ(rays.sigma_m, scan.sigma_m);
  EXPECT_EQ(rays.label, scan.label);
  EXPECT_EQ(rays.object, scan.object);
}

TEST(MapRays, EndsRayAtTheEdgeWithItsSigma) {
  Objects objects = openFloor();
  addEdge(objects, 90, 1.7, 0.012);
  setRay(objects, 200, 0.9, RayLabel::kFloorEnd);  // the floor was followed less far than to the edge
  addEdge(objects, 200, 2.5, 0.03);
  setRay(objects, 300, 0.0, RayLabel::kInvalid);
  addEdge(objects, 300, 1.1, 0.004);
  MapRays map_rays({});
  const Scan& rays = map_rays.of(objects);
  expectRay(rays, 90, 1.7, RayLabel::kObstacle);
  EXPECT_NEAR(rays.sigma_m[90], 0.012, 1e-6);
  expectRay(rays, 200, 2.5, RayLabel::kObstacle);
  EXPECT_NEAR(rays.sigma_m[200], 0.03, 1e-6);
  expectRay(rays, 300, 1.1, RayLabel::kObstacle);
  EXPECT_NEAR(rays.sigma_m[300], 0.004, 1e-6);
  expectRay(rays, 91, 3.0, RayLabel::kFloorEnd);
}

/// Inverse range of the walls x = ±2 m and y = ±1.5 m from the origin.
double roomInverse(double bearing) {
  return std::max(std::abs(std::cos(bearing)) / 2.0, std::abs(std::sin(bearing)) / 1.5);
}

TEST(MapRays, PlacesRaysOnTheFittedWallWithTheSigmaOfTheLine) {
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0.0, kInverseSigma);
  MapRays map_rays({});
  double raw = 0.0, fitted = 0.0, normalised = 0.0;
  int count = 0;
  for (int frame = 0; frame < 20; ++frame) {
    Objects objects = openFloor();
    for (std::size_t i = 0; i < kBeamCount; ++i) {
      const double bearing = 2.0 * M_PI * static_cast<double>(i) / kBeamCount;
      objects.boundary.inverse_m[i] = static_cast<float>(roomInverse(bearing) + noise(random));
      objects.boundary.sigma[i] = static_cast<float>(kInverseSigma);
    }
    const Scan& rays = map_rays.of(objects);
    for (std::size_t i = 0; i < kRayCount; ++i) {
      const double bearing = 2.0 * M_PI * static_cast<double>(i) / kRayCount;
      const double across = std::abs(std::cos(bearing)) / 2.0, along = std::abs(std::sin(bearing)) / 1.5;
      if (std::abs(across - along) < 0.1) continue;  // at a corner there is no line
      const double inverse = 1.0 / static_cast<double>(rays.range_m[i]),
                   error = inverse - roomInverse(bearing);
      const double sigma = static_cast<double>(rays.sigma_m[i]) * inverse * inverse;
      raw += std::pow(static_cast<double>(objects.boundary.inverse_m[beamOf(i)]) - roomInverse(bearing), 2);
      fitted += error * error;
      normalised += error * error / (sigma * sigma);
      ++count;
    }
  }
  EXPECT_GT(count, 20 * 250);
  EXPECT_NEAR(std::sqrt(raw / count), kInverseSigma, 0.1 * kInverseSigma);
  // A line through 41 beams has √(2/41) = 0.22 of the noise of one beam in its middle, more beside corners.
  EXPECT_LT(std::sqrt(fitted / count), 0.4 * kInverseSigma);
  // χ² per ray: 1 if σ is right. About 20 independent lines per frame: ±0.07.
  EXPECT_NEAR(normalised / count, 1.0, 0.35);
}

// An error that neighbouring edges share does not average out over a line.
TEST(MapRays, KeepsTheSharedErrorOfALine) {
  Objects objects = openFloor();
  for (std::size_t i = 0; i < kBeamCount; ++i) {
    objects.boundary.inverse_m[i] =
        static_cast<float>(roomInverse(2.0 * M_PI * static_cast<double>(i) / kBeamCount));
    objects.boundary.sigma[i] = static_cast<float>(kInverseSigma);
  }
  MapRaysOptions options;
  MapRays independent(options);
  options.shared_share = 0.9;
  MapRays shared(options);
  // The middle of the wall x = 2 m: σ of the range is σ·r².
  const double of_one_m = kInverseSigma * 4.0;
  EXPECT_LT(independent.of(objects).sigma_m[0], 0.4 * of_one_m);
  const double kept_m = static_cast<double>(shared.of(objects).sigma_m[0]);
  EXPECT_GT(kept_m, 0.89 * of_one_m);
  EXPECT_LT(kept_m, 1.05 * of_one_m);
}

TEST(MapRays, IsUndecidedFromTheScanThatEndsClearlyBeforeTheEdge) {
  // Closer than a cell and 2 σ = 5 cm + 2 cm they are the same.
  Objects objects = openFloor();
  for (const std::size_t i : {10U, 20U, 30U, 40U, 50U}) addEdge(objects, i, 2.0, 0.01);
  setRay(objects, 10, 1.92, RayLabel::kObstacle);
  setRay(objects, 20, 1.94, RayLabel::kObstacle);
  setRay(objects, 30, 1.2, RayLabel::kUnknown, 7);
  setRay(objects, 40, 1.2, RayLabel::kUndecided);
  setRay(objects, 50, 1.2, RayLabel::kRobot, 8);
  MapRays map_rays({});
  const Scan& rays = map_rays.of(objects);
  expectRay(rays, 10, 1.92, RayLabel::kUndecided);
  EXPECT_EQ(rays.sigma_m[10], objects.scan.sigma_m[10]);
  expectRay(rays, 20, 2.0, RayLabel::kObstacle);
  expectRay(rays, 30, 1.2, RayLabel::kUndecided, 7);
  expectRay(rays, 40, 1.2, RayLabel::kUndecided);
  expectRay(rays, 50, 1.2, RayLabel::kRobot, 8);
}

TEST(MapRays, KeepsLabelAndTrackOfAnObjectAtTheEdge) {
  Objects objects = openFloor();
  for (const std::size_t i : {10U, 20U, 30U, 40U}) addEdge(objects, i, 2.0, 0.01);
  setRay(objects, 10, 1.98, RayLabel::kUnknown, 7);
  setRay(objects, 20, 2.06, RayLabel::kObstacle, 7);
  setRay(objects, 30, 2.08, RayLabel::kUnknown, 7);  // the object is clearly behind the edge
  setRay(objects, 40, 1.98, RayLabel::kUnknown, 0);  // belongs to no track
  setRay(objects, 50, 1.5, RayLabel::kUnknown, 9);   // no edge
  setRay(objects, 60, 1.5, RayLabel::kObstacle, 9);
  MapRays map_rays({});
  const Scan& rays = map_rays.of(objects);
  expectRay(rays, 10, 2.0, RayLabel::kUnknown, 7);
  expectRay(rays, 20, 2.0, RayLabel::kObstacle, 7);
  expectRay(rays, 30, 2.0, RayLabel::kObstacle);
  expectRay(rays, 40, 2.0, RayLabel::kObstacle);
  expectRay(rays, 50, 1.5, RayLabel::kUnknown, 9);
  expectRay(rays, 60, 1.5, RayLabel::kObstacle, 9);
}

TEST(MapRays, MakesMovingBeamsRobots) {
  Objects objects = openFloor();
  for (const std::size_t i : {10U, 20U, 30U, 40U}) addEdge(objects, i, 1.4, 0.01);
  for (const std::size_t i : {10U, 20U, 40U}) objects.boundary.moving[beamOf(i)] = 1;
  setRay(objects, 40, 0.9, RayLabel::kObstacle);  // the scan ends clearly before the edge
  setRay(objects, 20, 1.4, RayLabel::kObstacle, 3);
  MapRays map_rays({});
  const Scan& rays = map_rays.of(objects);
  expectRay(rays, 10, 1.4, RayLabel::kRobot);
  expectRay(rays, 20, 1.4, RayLabel::kRobot, 3);
  expectRay(rays, 30, 1.4, RayLabel::kObstacle);
  expectRay(rays, 40, 0.9, RayLabel::kRobot);
  objects.boundary.moving.clear();
  expectRay(map_rays.of(objects), 10, 1.4, RayLabel::kObstacle);
}

TEST(MapRays, IsUnknownWithoutAnEdgeWhereTheScanEndsAtNoTrack) {
  Objects objects = openFloor();
  setRay(objects, 10, 1.3, RayLabel::kObstacle);
  setRay(objects, 20, 1.3, RayLabel::kUndecided);
  MapRays map_rays({});
  const Scan& rays = map_rays.of(objects);
  expectRay(rays, 10, 1.3, RayLabel::kUnknown);
  EXPECT_EQ(rays.sigma_m[10], objects.scan.sigma_m[10]);
  expectRay(rays, 20, 1.3, RayLabel::kUndecided);
}

/// Edges at the first rays, floor at the others. `object`: track at the edges.
Objects partlyWalled(std::size_t edges, std::uint16_t object = 0) {
  Objects objects = openFloor();
  for (std::size_t i = 0; i < edges; ++i) {
    addEdge(objects, i, 2.0, 0.01);
    setRay(objects, i, 2.0, RayLabel::kObstacle, object);
  }
  return objects;
}

TEST(MapRays, ShowsNothingWithoutAnEdgeInARoom) {
  const auto labelOfLast = [](const Objects& objects) {
    MapRays map_rays({});
    return map_rays.of(objects).label.back();
  };
  EXPECT_EQ(labelOfLast(partlyWalled(73)), RayLabel::kInvalid);
  EXPECT_EQ(labelOfLast(partlyWalled(72)), RayLabel::kFloorEnd) << "a fifth of 360 rays";
  EXPECT_EQ(labelOfLast(partlyWalled(20)), RayLabel::kFloorEnd) << "an open arena";
  EXPECT_EQ(labelOfLast(partlyWalled(300, 5)), RayLabel::kFloorEnd) << "a tracked object is no structure";
}

TEST(MapRays, RemembersTheRoomForSeveralFrames) {
  MapRays map_rays({});
  for (int frame = 0; frame < 30; ++frame) map_rays.of(partlyWalled(300));
  const Objects open = openFloor();
  int frames_in_room = 0;
  while (frames_in_room < 100 && map_rays.of(open).label.back() == RayLabel::kInvalid) ++frames_in_room;
  // The share falls as 0.83·0.9ᵏ: below 0.2 after k = 13.
  EXPECT_GE(frames_in_room, 11);
  EXPECT_LE(frames_in_room, 15);
}

TEST(MapRays, LeavesTheScanUnchangedWithoutABoundary) {
  MapRays map_rays({});
  Objects objects = partlyWalled(300);
  map_rays.of(objects);
  objects.boundary.clear();
  expectSameScan(map_rays.of(objects), objects.scan);
  objects = partlyWalled(300);
  objects.scan = {};
  expectSameScan(map_rays.of(objects), objects.scan);
  objects = partlyWalled(300);
  objects.boundary.inverse_m.resize(kRayCount - 1);  // fewer beams than rays
  expectSameScan(map_rays.of(objects), objects.scan);
}

}  // namespace
}  // namespace omnifleet::occupancy
