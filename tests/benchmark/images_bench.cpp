// Ceiling patch finder against HSV and inRange. Forward projection of points to the floor against backward
// mapping of the whole image.

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "lens/floor_table.h"
#include "local_mapper/local_mapper.h"
#include "markers/patch_finder.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/floor_remap.h"
#include "tests/benchmark/hsv_finder.h"

namespace omnifleet::bench {
namespace {

lens::Camera ceilingCamera(const Recording& recording) {
  return lens::Camera(recording.arena().camera("ceiling/c1").model);
}

/// `tracked` false: a new finder for each image, which searches the whole image.
void findPatches(benchmark::State& state, const Recording& recording, bool tracked) {
  const lens::Camera camera = ceilingCamera(recording);
  const auto make = [&] { return markers::MarkerFinder::make(camera, *recording.arena().markers, {}); };
  auto finder = make();
  if (tracked) finder->find(recording.ceiling(0), recording.time(0));
  Samples samples(state);
  int step = 1;
  for (auto _ : state) {
    if (!tracked) finder = make();
    const double begun = threadCpuMs();
    const auto& found = finder->find(recording.ceiling(step), recording.time(step));
    samples.add(threadCpuMs() - begun);
    if (found.size() != recording.robots().size())
      state.SkipWithError("the number of robots found differs from the recording");
    for (std::size_t r = 0; r < found.size(); ++r) {
      const double error_m =
          (found[r].map_from_base.translation() - recording.truth(r, step).translation()).norm();
      if (error_m > 0.01) state.SkipWithError("the position of a robot is more than 1 cm wrong");
    }
    ++step;
  }
  samples.report();
}

void findByHsv(benchmark::State& state, const Recording& recording) {
  HsvFinder finder(ceilingCamera(recording), *recording.arena().markers);
  Samples samples(state);
  int step = 1;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    const auto& found = finder.find(recording.ceiling(step));
    samples.add(threadCpuMs() - begun);
    if (found.size() != recording.robots().size())
      state.SkipWithError("the number of robots found differs from the recording");
    for (const auto& [robot, position_m] : found) {
      const auto& names = recording.robots();
      const auto r = static_cast<std::size_t>(std::find(names.begin(), names.end(), robot) - names.begin());
      // The masks have whole pixels: 1.5 cm is three pixels.
      if ((position_m - recording.truth(r, step).translation()).norm() > 0.015)
        state.SkipWithError("the position of a robot is more than 1.5 cm wrong");
    }
    ++step;
  }
  samples.report();
}

/// All pixels of a typical frame that have to be projected to the floor: contours and ends of vectors (Choi
/// §III.4).
std::vector<Eigen::Vector2f> pointsOf(const Recording& recording, const lens::Camera& camera) {
  local_mapper::LocalMapper mapper(camera, {});
  std::vector<Eigen::Vector2f> points;
  for (int step = 0; step < 2; ++step) {
    const LocalMap& local_map = mapper.process(
        {recording.time(step), static_cast<std::uint32_t>(step), FrameState::kOk, recording.image(0, step)},
        {});
    if (step == 0) continue;
    for (const auto& object : local_map.objects) {
      for (const auto& vector : object.vectors) {
        points.push_back(vector.from_px);
        points.push_back(vector.to_px);
      }
    }
    for (std::size_t i = 0; i < local_map.objects.size(); ++i) {
      const auto& pixels = mapper.floorContours()[i].pixels;
      points.insert(points.end(), pixels.begin(), pixels.end());
    }
  }
  return points;
}

void forward(benchmark::State& state, const Recording& recording, bool by_table) {
  const lens::Camera camera(recording.arena().camera(recording.robots().front() + "/fisheye").model);
  const lens::FloorTable table(camera);
  const auto points = pointsOf(recording, camera);
  Samples samples(state);
  double worst_m = 0;
  for (auto _ : state) {
    const double begun = threadCpuMs();
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2f& p : points) {
      if (by_table) {
        sum += table.at(p.x(), p.y()).cast<double>();
      } else if (const auto floor = camera.floorFromPixel(p.cast<double>())) {
        sum += *floor;
      }
    }
    benchmark::DoNotOptimize(sum);
    samples.add(threadCpuMs() - begun);
  }
  for (const Eigen::Vector2f& p : points) {
    const auto floor = camera.floorFromPixel(p.cast<double>());
    if (floor && (*floor - camera.foot()).norm() < 2.0)
      worst_m = std::max(worst_m, (*floor - table.at(p.x(), p.y()).cast<double>()).norm());
  }
  samples.report();
  state.counters["points"] = static_cast<double>(points.size());
  state.counters["table_error_mm"] = 1e3 * worst_m;
}

/// The peer in its fastest form: fixed-point maps are precomputed, and only the interpolation is measured.
void backward(benchmark::State& state, const Recording& recording) {
  const lens::Camera camera(recording.arena().camera(recording.robots().front() + "/fisheye").model);
  FloorRemap remap(camera, {camera.model().image_width_px, camera.model().image_height_px});
  cv::Mat3b plan;
  Samples samples(state);
  int step = 0;
  for (auto _ : state) {
    const cv::Mat3b& image = recording.image(0, step++);
    const double begun = threadCpuMs();
    remap.apply(image, plan);
    samples.add(threadCpuMs() - begun);
  }
  samples.report();
}

}  // namespace

void registerImages(Scenes& scenes, const Plan& plan) {
  const int iterations = plan.iterations(120);
  const auto add = [&](const char* name, auto run) {
    benchmark::RegisterBenchmark(name,
                                 [&scenes, run](benchmark::State& state) { run(state, scenes.typical()); })
        ->Iterations(iterations)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  using State = benchmark::State;
  add("patches/full", [](State& s, const Recording& r) { findPatches(s, r, false); });
  add("patches/tracked", [](State& s, const Recording& r) { findPatches(s, r, true); });
  add("patches/hsv", findByHsv);
  add("lens/points", [](State& s, const Recording& r) { forward(s, r, true); });
  add("lens/points/closed_form", [](State& s, const Recording& r) { forward(s, r, false); });
  add("lens/remap", backward);
}

}  // namespace omnifleet::bench
