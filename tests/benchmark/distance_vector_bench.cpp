// Distance vector of a forward camera against a naive one: blur, flood fill, scan of each column,
// undistortion of the boundary's points in each frame.

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "distance_vector/distance_vector.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/unit/distance_vector/ray_caster.h"

namespace omnifleet::bench {
namespace {

constexpr int kBearings = 720;

/// Floor by a flood fill from the middle bottom, in whole pixels, without σ.
class NaiveDistanceVector {
 public:
  explicit NaiveDistanceVector(const lens::Camera& camera) : camera_(camera) {
    const lens::CameraModel& m = camera.model();
    matrix_ = (cv::Mat1d(3, 3) << m.focal_px.x(), 0, m.principal_point_px.x(), 0, m.focal_px.y(),
               m.principal_point_px.y(), 0, 0, 1);
    distortion_ = cv::Mat(m.distortion, true);
  }

  /// Metres per bearing; 0: nothing.
  const std::vector<float>& process(const cv::Mat& bgr) {
    cv::GaussianBlur(bgr, smooth_, {5, 5}, 0.0);
    cv::cvtColor(smooth_, lab_, cv::COLOR_BGR2Lab);
    mask_.create(bgr.rows + 2, bgr.cols + 2, CV_8UC1);
    mask_.setTo(0);
    cv::floodFill(lab_, mask_, {bgr.cols / 2, bgr.rows - 3}, {}, nullptr, {45, 12, 12}, {45, 12, 12},
                  4 | cv::FLOODFILL_FIXED_RANGE | cv::FLOODFILL_MASK_ONLY | (255 << 8));
    points_.clear();
    for (int u = 0; u < bgr.cols; ++u) {
      int v = bgr.rows - 1;
      while (v >= 0 && mask_.at<std::uint8_t>(v + 1, u + 1) != 0) --v;
      if (v < bgr.rows - 1) points_.emplace_back(static_cast<float>(u), static_cast<float>(v) + 0.5f);
    }
    ranges_.assign(kBearings, 0.0f);
    if (points_.empty()) return ranges_;
    cv::undistortPoints(points_, straight_, matrix_, distortion_);
    const Eigen::Matrix3d rotation = camera_.parentFromCamera().linear();
    for (const cv::Point2f& p : straight_) {
      const Eigen::Vector3d ray =
          rotation * Eigen::Vector3d(static_cast<double>(p.x), static_cast<double>(p.y), 1.0);
      if (!(ray.z() < 0.0)) continue;
      const Eigen::Vector2d floor = ray.head<2>() * (camera_.height() / -ray.z());
      const auto bin =
          static_cast<int>(std::lround(std::atan2(floor.y(), floor.x()) / (2.0 * M_PI) * kBearings));
      float& range = ranges_[static_cast<std::size_t>((bin + kBearings) % kBearings)];
      const auto metres = static_cast<float>(floor.norm());
      if (range == 0.0f || metres < range) range = metres;
    }
    return ranges_;
  }

 private:
  lens::Camera camera_;
  cv::Mat matrix_, distortion_, smooth_, lab_, mask_;
  std::vector<cv::Point2f> points_, straight_;
  std::vector<float> ranges_;
};

struct Views {
  lens::Camera camera{test::forwardCamera()};
  std::vector<cv::Mat> images;

  /// Blocks of several colours in a room, seen while the robot turns.
  Views() {
    const test::RayCaster caster(camera, 3);
    test::World world;
    world.texture = 0.02;
    world.room_half_m = {0.9, 0.8};
    for (cv::Vec3f& wall : world.wall_bgr) wall = {40, 50, 150};
    world.blocks.push_back({{0.5, 0.1}, {0.06, 0.05}, 0.4, 0.2, {170, 90, 40}});
    world.blocks.push_back({{0.1, 0.5}, {0.05, 0.08}, 1.0, 0.2, {50, 150, 60}});
    world.blocks.push_back({{-0.4, -0.2}, {0.07, 0.07}, 0.2, 0.2, {40, 160, 200}});
    for (int i = 0; i < 8; ++i) images.push_back(caster.render(world, {{0.0, 0.0}, 0.7854 * i}));
  }
};

const Views& views() {
  static const Views kViews;
  return kViews;
}

/// Both must see the same edges: of the bearings that both report, nine in ten agree within 6 % + one pixel.
void checkAgreement(benchmark::State& state) {
  NaiveDistanceVector naive(views().camera);
  distance_vector::DistanceVector vector(views().camera, {});
  const double pixel = 1.0 / (views().camera.model().focal_px.y() * views().camera.height());  // m per m²
  int both = 0, equal = 0, own = 0;
  for (const cv::Mat& image : views().images) {
    const auto& ranges = naive.process(image);
    vector.process(image);
    const Scan& scan = vector.scan();
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      if (scan.label[i] != RayLabel::kObstacle) continue;
      ++own;
      if (ranges[i] == 0.0f) continue;
      ++both;
      const auto a = static_cast<double>(ranges[i]), b = static_cast<double>(scan.range_m[i]);
      if (std::abs(a - b) < 0.06 * b + pixel * b * b) ++equal;
    }
  }
  state.counters["bearings"] = static_cast<double>(own) / static_cast<double>(views().images.size());
  if (own < 150 * static_cast<int>(views().images.size()))
    state.SkipWithError("the distance vector sees fewer than 150 bearings with an edge per image");
  if (both < own / 2 || equal < 0.9 * both) state.SkipWithError("the naive ranges differ");
}

void measureVector(benchmark::State& state) {
  checkAgreement(state);
  distance_vector::DistanceVector vector(views().camera, {});
  for (const cv::Mat& image : views().images) vector.process(image);
  Samples samples(state);
  samples.reserve();
  const MemoryWatch memory;
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    vector.process(views().images[i++ % views().images.size()]);
    samples.add(threadCpuMs() - begun);
  }
  memory.report(state);
  samples.report();
}

void measureNaive(benchmark::State& state) {
  checkAgreement(state);
  NaiveDistanceVector naive(views().camera);
  Samples samples(state);
  std::size_t i = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    benchmark::DoNotOptimize(naive.process(views().images[i++ % views().images.size()]).data());
    samples.add(threadCpuMs() - begun);
  }
  samples.report();
}

}  // namespace

void registerDistanceVector(const Plan& plan) {
  const int iterations = plan.iterations(400);
  const auto add = [&](const char* name, void (*run)(benchmark::State&)) {
    benchmark::RegisterBenchmark(name, run)
        ->Iterations(iterations)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  add("distance_vector/frame", measureVector);
  add("distance_vector/frame/naive", measureNaive);
}

}  // namespace omnifleet::bench
