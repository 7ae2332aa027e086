// Motion by the texture of the floor against OpenCV's findTransformECC on the same floor, rectified by a
// table.

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

#include "local_mapper/floor_odometry.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/unit/ground/textured_floor.h"

namespace omnifleet::bench {
namespace {

const Pose2 kFloorStep{0.04, 0.0, 0.05};
constexpr TimeNs kFloorFrame_ns = 200'000'000;
constexpr double kFloorTolerance_m = 0.002;

/// A drive over a textured floor at 1280 × 960, forward and backward in turn.
struct FloorDrive {
  ground::testing::TexturedFloor floor{1280, 960};
  std::vector<cv::Mat1b> images;

  FloorDrive() {
    const ground::testing::FloorTexture texture(0.008, 1);
    Pose2 pose;
    for (unsigned k = 0; k < 8; ++k, pose = pose * kFloorStep)
      images.push_back(floor.image(texture, pose, {}, k + 1));
  }
  std::size_t round() const { return 2 * (images.size() - 1); }
  const cv::Mat1b& image(std::size_t step) const {
    const std::size_t k = step % round();
    return images[k < images.size() ? k : round() - k];
  }
  /// previous_from_current of a step.
  Pose2 motion(std::size_t step) const {
    const std::size_t k = step % round();
    return k > 0 && k < images.size() ? kFloorStep : kFloorStep.inverse();
  }
  /// What wheels say of it, 4 % off.
  Motion wheels(std::size_t step) const {
    Motion wheels;
    wheels.valid = step > 0;
    wheels.since_ns = static_cast<TimeNs>(step - 1) * kFloorFrame_ns;
    wheels.previous_from_current = motion(step);
    wheels.previous_from_current.x_m *= 1.04;
    wheels.previous_from_current.theta_rad *= 0.96;
    return wheels;
  }
};

const FloorDrive& floorDrive() {
  static const FloorDrive kDrive;
  return kDrive;
}

/// Rectifies the floor within the same annulus to cells of the same size; aligns each frame with the one
/// before.
class EccOdometry {
 public:
  explicit EccOdometry(const lens::Camera& camera) {
    const ground::FloorAlignmentOptions o;
    const int half = static_cast<int>(o.outer_m / o.cell_m), side = 2 * half + 1;
    map_.create(side, side);
    mask_ = cv::Mat1b::zeros(side, side);
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const Eigen::Vector2d at((x - half) * o.cell_m, (y - half) * o.cell_m);
        const auto pixel = camera.pixelFromPoint({at.x(), at.y(), 0.0});
        map_(y, x) = pixel ? cv::Vec2f(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()))
                           : cv::Vec2f(-1.0f, -1.0f);
        if (pixel && at.norm() > o.inner_m && at.norm() < o.outer_m) mask_(y, x) = 255;
      }
    cell_m_ = o.cell_m;
    half_ = half;
  }

  /// previous_from_current
  Pose2 add(const cv::Mat1b& image, const Pose2& predicted) {
    cv::remap(image, now_, map_, {}, cv::INTER_LINEAR);
    Pose2 motion;
    if (!before_.empty()) {
      // `warp` maps cells of the frame before to cells of this one.
      const Pose2 start = predicted.inverse();
      const auto c = static_cast<float>(std::cos(start.theta_rad)),
                 s = static_cast<float>(std::sin(start.theta_rad)), h = static_cast<float>(half_);
      cv::Mat1f warp = (cv::Mat1f(2, 3) << c, -s, h - c * h + s * h + static_cast<float>(start.x_m / cell_m_),
                        s, c, h - s * h - c * h + static_cast<float>(start.y_m / cell_m_));
      cv::findTransformECC(before_, now_, warp, cv::MOTION_EUCLIDEAN,
                           {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 1e-4}, mask_, 3);
      const double theta = std::atan2(static_cast<double>(warp(1, 0)), static_cast<double>(warp(0, 0)));
      const double x = static_cast<double>(warp(0, 0) * h + warp(0, 1) * h + warp(0, 2) - h) * cell_m_,
                   y = static_cast<double>(warp(1, 0) * h + warp(1, 1) * h + warp(1, 2) - h) * cell_m_;
      motion = Pose2{x, y, theta}.inverse();
    }
    cv::swap(before_, now_);
    return motion;
  }

 private:
  cv::Mat2f map_;
  cv::Mat1b mask_, before_, now_;
  double cell_m_ = 0.0;
  int half_ = 0;
};

/// Runs one round and fails if a step is farther off than the tolerance.
template <class Step>
void checkFloorSteps(benchmark::State& state, std::size_t first, const Step& step) {
  for (std::size_t i = first; i < first + floorDrive().round(); ++i) {
    const Pose2 error = step(i).inverse() * floorDrive().motion(i);
    if (error.translation().norm() > kFloorTolerance_m) state.SkipWithError("a step is more than 2 mm off");
  }
}

void measureFloorMotion(benchmark::State& state) {
  const FloorDrive& drive = floorDrive();
  local_mapper::FloorOdometry odometry(drive.floor.camera, drive.floor.view, {});
  std::size_t i = 0;
  const auto step = [&] {
    const FloorMotion motion =
        odometry.add(static_cast<TimeNs>(i) * kFloorFrame_ns, drive.image(i), {}, drive.wheels(i));
    ++i;
    return motion;
  };
  for (std::size_t k = 0; k < drive.round(); ++k) step();  // learns what is fixed in the image
  checkFloorSteps(state, i, [&](std::size_t) { return step().previous_from_current; });
  Samples samples(state);
  samples.reserve();
  const MemoryWatch memory;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    benchmark::DoNotOptimize(step().valid);
    samples.add(threadCpuMs() - begun);
  }
  memory.report(state);
  samples.report();
}

void measureEccMotion(benchmark::State& state) {
  const FloorDrive& drive = floorDrive();
  EccOdometry odometry(drive.floor.camera);
  std::size_t i = 0;
  const auto step = [&] {
    const Pose2 motion = odometry.add(drive.image(i), drive.wheels(i).previous_from_current);
    ++i;
    return motion;
  };
  step();
  guarded(state, [&] { checkFloorSteps(state, i, [&](std::size_t) { return step(); }); });
  Samples samples(state);
  for (auto _ : state) {
    const double begun = threadCpuMs();
    benchmark::DoNotOptimize(step());
    samples.add(threadCpuMs() - begun);
  }
  samples.report();
}

}  // namespace

void registerFloorMotion(const Plan& plan) {
  const int iterations = plan.iterations(200);
  const auto add = [&](const char* name, void (*run)(benchmark::State&)) {
    benchmark::RegisterBenchmark(name, run)
        ->Iterations(iterations)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  add("floor_motion/frame", measureFloorMotion);
  add("floor_motion/frame/ecc", measureEccMotion);
}

}  // namespace omnifleet::bench
