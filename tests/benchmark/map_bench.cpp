// A 360-ray scan into the map: ours (integer counts, octree written where a cell changes class) against
// OctoMap's insertPointCloud, both ending with the same map.

#include <octomap/OcTree.h>

#include <cmath>

#include "occupancy/occupancy_map.h"
#include "tests/benchmark/benchmarks.h"

namespace omnifleet::bench {
namespace {

using namespace occupancy;

constexpr int kRays = 360;
constexpr double kMaxRange_m = 5.0, kResolution_m = 0.05;

/// A room of 8.8 m × 6.8 m with columns, in closed form.
struct Column {
  double x, y, radius;
};
const Column kColumns[] = {
    {1.5, 1.0, 0.2}, {-1.2, 1.6, 0.15}, {0.4, -1.8, 0.25}, {-2.5, -1.1, 0.2}, {3.0, -0.4, 0.15}};

double rangeTo(double x, double y, double bearing) {
  const double c = std::cos(bearing), s = std::sin(bearing);
  double range = std::min((c > 0 ? 4.4 - x : -4.4 - x) / (std::abs(c) > 1e-9 ? c : 1e-9),
                          (s > 0 ? 3.4 - y : -3.4 - y) / (std::abs(s) > 1e-9 ? s : 1e-9));
  for (const Column& column : kColumns) {
    const double dx = column.x - x, dy = column.y - y;
    const double along = c * dx + s * dy, beside = c * dy - s * dx;
    if (along <= 0 || std::abs(beside) >= column.radius) continue;
    range = std::min(range, along - std::sqrt(column.radius * column.radius - beside * beside));
  }
  return range;
}

/// One scan for each of the two.
struct Scans {
  explicit Scans(int count) {
    for (int i = 0; i < count; ++i) add(i, 0.02 * i - 0.01 * count, 0.3 * std::sin(0.02 * i), 0.01 * i);
  }
  void add(int index, double x, double y, double theta) {
    KeyframePose pose;
    pose.robot = "r1";
    pose.acquired_ns = index * 200'000'000LL;
    pose.valid = true;
    pose.position = {static_cast<int>(std::lround(x * 1e4)), static_cast<int>(std::lround(y * 1e4))};
    pose.theta_dmrad = static_cast<int>(std::lround(theta * 1e4));
    Contribution contribution;
    contribution.robot = pose.robot;
    contribution.acquired_ns = pose.acquired_ns;
    octomap::Pointcloud cloud;
    const Pose2 map_from_base = pose.mapFromBase();
    for (int k = 0; k < kRays; ++k) {
      const double bearing = map_from_base.theta_rad + 2 * M_PI * k / kRays;
      const double range = rangeTo(map_from_base.x_m, map_from_base.y_m, bearing);
      contribution.range_dmm.push_back(static_cast<int>(std::lround(std::min(range, kMaxRange_m) * 1e4)));
      contribution.label.push_back(range < kMaxRange_m ? RayLabel::kObstacle : RayLabel::kFloorEnd);
      contribution.object.push_back(0);
      cloud.push_back(static_cast<float>(map_from_base.x_m + range * std::cos(bearing)),
                      static_cast<float>(map_from_base.y_m + range * std::sin(bearing)), kResolution_m / 2);
    }
    contributions.push_back(contribution);
    poses.push_back(pose);
    clouds.push_back(cloud);
    origins.emplace_back(map_from_base.x_m, map_from_base.y_m, kResolution_m / 2);
  }
  std::vector<Contribution> contributions;
  std::vector<KeyframePose> poses;
  std::vector<octomap::Pointcloud> clouds;
  std::vector<octomap::point3d> origins;
};

OccupancyMap emptyMap() {
  OccupancyOptions options;
  options.resolution_m = kResolution_m;
  options.max_range_m = kMaxRange_m;
  return OccupancyMap(options, {{"r1", {0.15, {}, 0.3, 0.3}}});
}

void ours(benchmark::State& state) {
  const Scans scans(static_cast<int>(state.max_iterations));
  OccupancyMap map = emptyMap();
  Samples samples(state);
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    map.add(scans.contributions[i]);
    map.add(scans.poses[i]);
    samples.add(threadCpuMs() - begun);
    ++i;
  }
  samples.report();
}

void insertPointCloud(benchmark::State& state) {
  const Scans scans(static_cast<int>(state.max_iterations));
  octomap::OcTree tree(kResolution_m);
  Samples samples(state);
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    tree.insertPointCloud(scans.clouds[i], scans.origins[i], kMaxRange_m);
    samples.add(threadCpuMs() - begun);
    ++i;
  }
  samples.report();
}

/// Same scans, same map: at least 97 % of the cells known to both are of the same class (rays graze cells
/// that one rounds in and the other out), and both know the same cells but for those and the robot's own.
void sameMap(benchmark::State& state) {
  const Scans scans(static_cast<int>(state.max_iterations));
  OccupancyMap map = emptyMap();
  octomap::OcTree tree(kResolution_m);
  std::size_t i = 0;
  for (auto _ : state) {
    map.add(scans.contributions[i]);
    map.add(scans.poses[i]);
    tree.insertPointCloud(scans.clouds[i], scans.origins[i], kMaxRange_m);
    ++i;
  }
  int both = 0, equal = 0, one = 0;
  for (double y = -3.6 + kResolution_m / 2; y < 3.6; y += kResolution_m) {
    for (double x = -4.6 + kResolution_m / 2; x < 4.6; x += kResolution_m) {
      const CellClass cell = map.at({x, y});
      const octomap::OcTreeNode* node = tree.search(x, y, kResolution_m / 2);
      if ((cell == CellClass::kUnknown) != (node == nullptr)) ++one;
      if (cell == CellClass::kUnknown || node == nullptr) continue;
      ++both;
      if ((cell == CellClass::kOccupied) == tree.isNodeOccupied(node)) ++equal;
    }
  }
  state.counters["cells"] = both;
  state.counters["equal"] = static_cast<double>(equal) / std::max(1, both);
  state.counters["known_to_one"] = static_cast<double>(one) / std::max(1, both);
  if (both < 1000 || equal < 0.97 * both || one > 0.03 * both) state.SkipWithError("the two maps differ");
}

}  // namespace

void registerMap(const Plan& plan) {
  benchmark::RegisterBenchmark("map/scan", ours)
      ->Iterations(plan.iterations(400))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("map/scan/octomap", insertPointCloud)
      ->Iterations(plan.iterations(400))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("map/scan/same_map", sameMap)
      ->Iterations(plan.iterations(100))
      ->Unit(benchmark::kMillisecond);
}

}  // namespace omnifleet::bench
