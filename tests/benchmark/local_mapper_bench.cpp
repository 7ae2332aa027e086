// One 1280×960 frame (Choi §III): the local mapper against a naive mapper with the same outputs.

#include <memory>
#include <opencv2/core.hpp>

#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/fairness.h"
#include "tests/benchmark/naive_mapper.h"

namespace omnifleet::bench {
namespace {

/// Feeds mappers with the images and wheel speeds of a recording's first robot.
class Feeder {
 public:
  explicit Feeder(const Recording& recording)
      : recording_(recording),
        camera_(recording.arena().camera(recording.robots().front() + "/fisheye").model),
        wheels_(recording.arena().robots.front().body.wheel_separation_m, {}),
        mapper_(camera_, local_mapper::Options{}) {}

  const lens::Camera& camera() const { return camera_; }
  /// Image and motion of the frame that was prepared last.
  const cv::Mat3b& image() const { return image_; }
  const Pose2& motion() const { return motion_.previous_from_current; }
  /// Does everything that precedes the stage and is not measured. The image is copied first: a camera
  /// process, too, writes the frame to shared memory shortly before. The recording itself is larger than any
  /// cache.
  void prepare(int step) {
    if (step > 0) add(step - 1);
    recording_.image(0, step).copyTo(image_);
    frame_ = {recording_.time(step), static_cast<std::uint32_t>(step), FrameState::kOk, image_};
    motion_ = wheels_.motionTo(frame_.acquired_ns);
  }
  const LocalMap& process() { return mapper_.process(frame_, motion_); }

 private:
  void add(int step) {
    const dataset::WheelRow row = recording_.wheels(0, step);
    wheels_.add(row.time_ns, row.left_mps, row.right_mps);
  }
  const Recording& recording_;
  lens::Camera camera_;
  motion::WheelIntegrator wheels_;
  local_mapper::LocalMapper mapper_;
  cv::Mat3b image_;
  local_mapper::Frame frame_;
  Motion motion_;
};

constexpr int kRounds = 5;  // measured; one round is the recording forward and backward

void measureLocalMapper(benchmark::State& state, const Recording& recording) {
  Feeder feeder(recording);
  int step = 0;
  // Two rounds to warm up: afterwards every buffer has its largest size. Whole rounds, so that the heap is
  // compared at the same frame of the recording.
  for (; step < 2 * recording.round(); ++step) {
    feeder.prepare(step);
    feeder.process();
  }
  Samples samples(state);
  samples.reserve();
  double objects = 0, vectors = 0;
  MemoryWatch memory;
  for (auto _ : state) {
    feeder.prepare(step++);
    const double begun = threadCpuMs();
    const LocalMap& local_map = feeder.process();
    samples.add(threadCpuMs() - begun);
    if (local_map.state != FrameState::kOk) state.SkipWithError("the local mapper rejected a frame");
    objects += static_cast<double>(local_map.objects.size());
    for (const auto& object : local_map.objects) vectors += static_cast<double>(object.vectors.size());
  }
  memory.report(state);
  samples.report(static_cast<std::size_t>(recording.round()));
  state.counters["objects"] = benchmark::Counter(objects, benchmark::Counter::kAvgIterations);
  state.counters["vectors"] = benchmark::Counter(vectors, benchmark::Counter::kAvgIterations);
}

void measureNaiveMapper(benchmark::State& state, const Recording& recording) {
  Feeder feeder(recording);
  NaiveMapper mapper(feeder.camera());
  for (int first : {0, 1}) {
    feeder.prepare(first);
    mapper.process(feeder.image(), feeder.motion());
  }
  Samples samples(state);
  double regions = 0, vectors = 0;
  int step = 2;
  for (auto _ : state) {
    feeder.prepare(step++);
    const double begun = threadCpuMs();
    const auto& found = mapper.process(feeder.image(), feeder.motion());
    samples.add(threadCpuMs() - begun);
    regions += static_cast<double>(found.size());
    for (const auto& region : found) vectors += static_cast<double>(region.to_m.size());
  }
  samples.report();
  state.counters["vectors"] = benchmark::Counter(vectors, benchmark::Counter::kAvgIterations);
  state.counters["regions"] = benchmark::Counter(regions, benchmark::Counter::kAvgIterations);
}

/// Runs both mappers over the recording. Their times are comparable only if both find the same objects.
void checkAgreement(benchmark::State& state, const Recording& recording, double min_share) {
  Feeder feeder(recording);
  NaiveMapper mapper(feeder.camera());
  Agreement sum;
  int step = 0;
  for (auto _ : state) {
    feeder.prepare(step);
    const auto& regions = mapper.process(feeder.image(), feeder.motion());
    ++step;
    const Agreement one = compare(feeder.process(), mapper, regions);
    sum.objects += one.objects;
    sum.matched_objects += one.matched_objects;
    sum.regions += one.regions;
    sum.matched_regions += one.matched_regions;
    sum.rays += one.rays;
    sum.equal_rays += one.equal_rays;
  }
  state.counters["matched_objects"] = static_cast<double>(sum.matched_objects) / std::max(1, sum.objects);
  state.counters["matched_regions"] = static_cast<double>(sum.matched_regions) / std::max(1, sum.regions);
  state.counters["scan_agreement"] = static_cast<double>(sum.equal_rays) / std::max(1, sum.rays);
  state.counters["objects"] = sum.objects;
  if (sum.objects == 0) state.SkipWithError("the local mapper found no object within 2 m");
  if (sum.matched_objects < min_share * sum.objects)
    state.SkipWithError("the naive mapper misses objects that the local mapper finds");
  if (sum.rays == 0 || sum.equal_rays < min_share * sum.rays)
    state.SkipWithError("the scans of the two mappers differ");
  if (sum.matched_regions < min_share * sum.regions)
    state.SkipWithError("the local mapper misses objects that the naive mapper finds");
}

}  // namespace

void registerLocalMapper(Scenes& scenes, const Plan& plan) {
  const auto add = [&](const std::string& scene, const Recording& (Scenes::*recording)(), double min_share) {
    const std::string name = "local_mapper/" + scene;
    benchmark::RegisterBenchmark(
        name.c_str(), [&, recording](benchmark::State& s) { measureLocalMapper(s, (scenes.*recording)()); })
        ->Iterations(scenes.round() * (plan.smoke ? 1 : kRounds))
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(
        (name + "/naive").c_str(),
        [&, recording](benchmark::State& s) { measureNaiveMapper(s, (scenes.*recording)()); })
        ->Iterations(plan.iterations(80))
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((name + "/same_objects").c_str(),
                                 [&, recording, min_share](benchmark::State& s) {
                                   checkAgreement(s, (scenes.*recording)(), min_share);
                                 })
        ->Iterations(plan.iterations(40))
        ->Unit(benchmark::kMillisecond);
  };
  add("typical", &Scenes::typical, 0.95);
  // In uneven light the naive mapper, with one histogram for the whole room, misses some of the many objects.
  add("cluttered", &Scenes::cluttered, 0.80);
}

}  // namespace omnifleet::bench
