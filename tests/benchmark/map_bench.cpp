// Merges scans of 360 rays and 64 points in space, as robots send them, into the map. OccupancyMap (integer
// counts; the octree is written where a cell changes its class) against OctoMap's insertPointCloud. Both end
// with the same map. The robot drives for a long time in one room, so that a growing cost becomes visible.

#include <octomap/OcTree.h>

#include <cmath>
#include <random>

#include "occupancy/occupancy_map.h"
#include "tests/benchmark/benchmarks.h"

namespace omnifleet::bench {
namespace {

using namespace occupancy;

constexpr int kRays = 360;
constexpr double kMaxRange_m = 5.0, kResolution_m = 0.05;

/// A column in a room of 8.8 m × 6.8 m. Ranges are computed in closed form.
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

/// A trackable point on a column or a wall; map, metres.
struct Feature {
  double x, y, z;
  std::uint16_t track;  ///< of the column or wall
};

std::vector<Feature> featuresOf(std::mt19937& random) {
  std::uniform_real_distribution<double> turn(-M_PI, M_PI), height(0.06, 0.45), share(0.0, 1.0);
  constexpr int kPerColumn = 80, kPerWall = 60;
  std::vector<Feature> features;
  std::uint16_t track = 0;
  for (const Column& column : kColumns) {
    ++track;
    for (int k = 0; k < kPerColumn; ++k) {
      const double a = turn(random);
      features.push_back({column.x + column.radius * std::cos(a), column.y + column.radius * std::sin(a),
                          height(random), track});
    }
  }
  for (const double side : {-1.0, 1.0}) {
    ++track;
    for (int k = 0; k < kPerWall; ++k)
      features.push_back({4.4 * (2 * share(random) - 1), side * 3.4, height(random), track});
    ++track;
    for (int k = 0; k < kPerWall; ++k)
      features.push_back({side * 4.4, 3.4 * (2 * share(random) - 1), height(random), track});
  }
  return features;
}

constexpr double kCameraHeight_m = 0.5;
constexpr double kFeatureRange_m = 3.0;  // 16 bits of 0.1 mm reach 3.2 m
constexpr int kTracks = 9;

/// The same scans in the form that each of the two maps takes.
struct Scans {
  explicit Scans(int count) {
    const auto features = featuresOf(random_);
    for (int i = 0; i < count; ++i)
      add(i, 1.9 * std::sin(0.02 * i), 0.55 * std::sin(0.0262 * i), 0.01 * i, features);
  }

  std::vector<Contribution> contributions;
  std::vector<KeyframePose> poses;
  std::vector<octomap::Pointcloud> clouds;  ///< ends of the rays, in the lowest layer of cells
  std::vector<octomap::point3d> origins;
  std::vector<octomap::Pointcloud> points;  ///< the points in space
  std::vector<octomap::point3d> cameras;

 private:
  void add(int index, double x, double y, double theta, const std::vector<Feature>& features) {
    KeyframePose pose;
    pose.robot = "r1";
    pose.acquired_ns = index * 200'000'000LL;
    pose.valid = true;
    pose.position = {static_cast<int>(std::lround(x * 1e4)), static_cast<int>(std::lround(y * 1e4))};
    pose.theta_dmrad = static_cast<int>(std::lround(std::remainder(theta, 2 * M_PI) * 1e4));
    Contribution contribution;
    contribution.robot = pose.robot;
    contribution.acquired_ns = pose.acquired_ns;
    contribution.camera_height_dmm = static_cast<int>(kCameraHeight_m * 1e4);
    const Pose2 map_from_base = pose.mapFromBase();
    addRays(map_from_base, contribution);
    addViews(contribution);
    addPoints(map_from_base, features, contribution);
    contributions.push_back(contribution);
    poses.push_back(pose);
  }

  void addRays(const Pose2& map_from_base, Contribution& contribution) {
    octomap::Pointcloud cloud;
    for (int k = 0; k < kRays; ++k) {
      const double bearing = map_from_base.theta_rad + 2 * M_PI * k / kRays;
      const double range = rangeTo(map_from_base.x_m, map_from_base.y_m, bearing);
      contribution.range_dmm.push_back(static_cast<int>(std::lround(std::min(range, kMaxRange_m) * 1e4)));
      contribution.label.push_back(range < kMaxRange_m ? RayLabel::kObstacle : RayLabel::kFloorEnd);
      contribution.object.push_back(0);
      cloud.push_back(static_cast<float>(map_from_base.x_m + range * std::cos(bearing)),
                      static_cast<float>(map_from_base.y_m + range * std::sin(bearing)), kResolution_m / 2);
    }
    clouds.push_back(cloud);
    origins.emplace_back(map_from_base.x_m, map_from_base.y_m, kResolution_m / 2);
  }

  /// One view with an outline for each object that the points belong to.
  static void addViews(Contribution& contribution) {
    for (std::uint32_t track = 1; track <= kTracks; ++track) {
      SupportView view;
      view.track_id = track;
      view.kind = ObjectKind::kObstacle;
      view.b_dmm.assign(SupportFunction::kDirections, 12345);
      view.sigma_dmm.assign(SupportFunction::kDirections, 30);
      contribution.views.push_back(view);
    }
  }

  /// The nearest visible features, with noise along the line of sight.
  void addPoints(const Pose2& map_from_base, const std::vector<Feature>& features,
                 Contribution& contribution) {
    std::vector<std::pair<double, const Feature*>> seen;
    for (const Feature& feature : features) {
      const double dx = feature.x - map_from_base.x_m, dy = feature.y - map_from_base.y_m;
      const double away = std::hypot(dx, dy);
      constexpr double kSurface_m = 0.02;
      if (away < kFeatureRange_m &&
          away < rangeTo(map_from_base.x_m, map_from_base.y_m, std::atan2(dy, dx)) + kSurface_m)
        seen.emplace_back(away, &feature);
    }
    std::sort(seen.begin(), seen.end());
    if (seen.size() > Contribution::kMaxPoints) seen.resize(Contribution::kMaxPoints);
    octomap::Pointcloud cloud;
    std::normal_distribution<double> error;
    for (const auto& [away, feature] : seen) {
      const double off = 1.0 + (0.005 / away + 0.005) * error(random_);  // along the line of sight
      const double x = map_from_base.x_m + off * (feature->x - map_from_base.x_m),
                   y = map_from_base.y_m + off * (feature->y - map_from_base.y_m),
                   z = kCameraHeight_m + off * (feature->z - kCameraHeight_m);
      const Eigen::Vector2d in_base = map_from_base.inverse() * Eigen::Vector2d(x, y);
      const auto dmm = [](double m) { return static_cast<std::int16_t>(std::lround(m * 1e4)); };
      contribution.points.push_back({feature->track, dmm(in_base.x()), dmm(in_base.y()), dmm(z), 100});
      cloud.push_back(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
    }
    points.push_back(cloud);
    cameras.emplace_back(map_from_base.x_m, map_from_base.y_m, kCameraHeight_m);
  }

  std::mt19937 random_{7};
};

OccupancyMap emptyMap() {
  OccupancyOptions options;
  options.resolution_m = kResolution_m;
  options.max_range_m = kMaxRange_m;
  return OccupancyMap(options, {{"r1", {0.15, {}, 0.3, 0.3}}});
}

/// Reports the median cost of a scan in the first and in the last quarter of the run.
void reportQuarters(const std::vector<double>& costs_ms, benchmark::State& state) {
  const auto middle = [](auto begin, auto end) {
    std::vector<double> some(begin, end);
    std::sort(some.begin(), some.end());
    return percentile(some, 0.5);
  };
  const auto quarter = static_cast<std::ptrdiff_t>(costs_ms.size() / 4);
  state.counters["first_quarter_ms"] = middle(costs_ms.begin(), costs_ms.begin() + quarter);
  state.counters["last_quarter_ms"] = middle(costs_ms.end() - quarter, costs_ms.end());
}

void mergeIntoOccupancyMap(benchmark::State& state) {
  const Scans scans(static_cast<int>(state.max_iterations));
  OccupancyMap map = emptyMap();
  Samples samples(state);
  std::vector<double> costs;
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    map.add(scans.contributions[i]);
    map.add(scans.poses[i]);
    costs.push_back(threadCpuMs() - begun);
    samples.add(costs.back());
    ++i;
  }
  samples.report();
  reportQuarters(costs, state);
}

/// The visible cells once per second of 5 scans, as the merger publishes them. Without the cost of the scans.
void visibleCells(benchmark::State& state) {
  constexpr int kScansPerSecond = 5;
  const Scans scans(kScansPerSecond * static_cast<int>(state.max_iterations));
  OccupancyMap map = emptyMap();
  Samples samples(state);
  std::size_t i = 0;
  for (auto _ : state) {
    for (int k = 0; k < kScansPerSecond; ++k, ++i) {
      map.add(scans.contributions[i]);
      map.add(scans.poses[i]);
    }
    const double begun = threadCpuMs();
    benchmark::DoNotOptimize(map.visible().surface.size());
    samples.add(threadCpuMs() - begun);
  }
  samples.report();
}

void insertPointCloud(benchmark::State& state) {
  const Scans scans(static_cast<int>(state.max_iterations));
  octomap::OcTree tree(kResolution_m);
  Samples samples(state);
  std::vector<double> costs;
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    tree.insertPointCloud(scans.clouds[i], scans.origins[i], kMaxRange_m);
    tree.insertPointCloud(scans.points[i], scans.cameras[i], kMaxRange_m);
    costs.push_back(threadCpuMs() - begun);
    samples.add(costs.back());
    ++i;
  }
  samples.report();
  reportQuarters(costs, state);
}

/// Checks that both maps agree: at least 97 % of the cells known to both have the same class, and at most 3 %
/// are known to only one map. They differ in cells that a ray only grazes and in cells under the robot.
void sameMap(benchmark::State& state) {
  const Scans scans(static_cast<int>(state.max_iterations));
  OccupancyMap map = emptyMap();
  octomap::OcTree tree(kResolution_m);
  std::size_t i = 0;
  for (auto _ : state) {
    map.add(scans.contributions[i]);
    map.add(scans.poses[i]);
    tree.insertPointCloud(scans.clouds[i], scans.origins[i], kMaxRange_m);
    tree.insertPointCloud(scans.points[i], scans.cameras[i], kMaxRange_m);
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
  if (both < 1000 || equal < 0.97 * both || one > 0.03 * both)
    state.SkipWithError("the maps differ in more than 3 % of the cells, or share fewer than 1000");
}

}  // namespace

void registerMap(const Plan& plan) {
  constexpr int kScans = 2000;  // 400 s at 5 Hz
  benchmark::RegisterBenchmark("map/scan", mergeIntoOccupancyMap)
      ->Iterations(plan.iterations(kScans))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("map/visible", visibleCells)
      ->Iterations(plan.iterations(200))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("map/scan/octomap", insertPointCloud)
      ->Iterations(plan.iterations(kScans))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("map/scan/same_map", sameMap)
      ->Iterations(plan.iterations(100))
      ->Unit(benchmark::kMillisecond);
}

}  // namespace omnifleet::bench
