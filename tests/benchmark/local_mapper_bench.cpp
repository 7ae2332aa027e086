// Choi §III, one 1280×960 frame: ours against the naive pipeline of the same outcome.

#include <memory>
#include <opencv2/core.hpp>

#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/fairness.h"
#include "tests/benchmark/naive_mapper.h"

namespace omnifleet::bench {
namespace {

/// Our mapper fed from a recording.
class Feeder {
 public:
  explicit Feeder(const Recording& recording)
      : recording_(recording),
        camera_(recording.arena().camera(recording.robots().front() + "/fisheye").model),
        wheels_(recording.arena().robots.front().body.wheel_separation_m, {}),
        mapper_(camera_, local_mapper::Options{}) {}

  const lens::Camera& camera() const { return camera_; }
  /// Of the frame prepared last.
  const cv::Mat3b& image() const { return image_; }
  const Pose2& motion() const { return motion_.previous_from_current; }
  /// All that happens before the stage itself: the frame has just been written, as by a camera's process into
  /// shared memory, so it does not come from a recording that is larger than any cache.
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

constexpr int kRounds = 5;  // forward and back; as many frames as `ours` measures, in rounds

void ours(benchmark::State& state, const Recording& recording) {
  Feeder feeder(recording);
  int step = 0;
  // Two rounds: every buffer has had its largest content, and the heap is looked at in the same frame again.
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
    if (local_map.state != FrameState::kOk) state.SkipWithError("a frame was refused");
    objects += static_cast<double>(local_map.objects.size());
    for (const auto& object : local_map.objects) vectors += static_cast<double>(object.vectors.size());
  }
  memory.report(state);
  samples.report(static_cast<std::size_t>(recording.round()));
  state.counters["objects"] = benchmark::Counter(objects, benchmark::Counter::kAvgIterations);
  state.counters["vectors"] = benchmark::Counter(vectors, benchmark::Counter::kAvgIterations);
}

void naive(benchmark::State& state, const Recording& recording) {
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

/// Both over the recording: the comparison is only fair where both find the same.
void agreement(benchmark::State& state, const Recording& recording, double least) {
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
    sum.found += one.found;
    sum.regions += one.regions;
    sum.known += one.known;
    sum.rays += one.rays;
    sum.alike += one.alike;
  }
  state.counters["found"] = static_cast<double>(sum.found) / std::max(1, sum.objects);
  state.counters["known"] = static_cast<double>(sum.known) / std::max(1, sum.regions);
  state.counters["scan_alike"] = static_cast<double>(sum.alike) / std::max(1, sum.rays);
  state.counters["objects"] = sum.objects;
  if (sum.objects == 0) state.SkipWithError("our local mapper found nothing near");
  if (sum.found < least * sum.objects) state.SkipWithError("the naive mapper misses objects that ours finds");
  if (sum.rays == 0 || sum.alike < least * sum.rays) state.SkipWithError("the scans differ");
  if (sum.known < least * sum.regions)
    state.SkipWithError("our mapper misses objects that the naive one finds");
}

}  // namespace

void registerLocalMapper(Scenes& scenes, const Plan& plan) {
  const auto add = [&](const std::string& scene, const Recording& (Scenes::*recording)(), double least) {
    const std::string name = "local_mapper/" + scene;
    benchmark::RegisterBenchmark(name.c_str(),
                                 [&, recording](benchmark::State& s) { ours(s, (scenes.*recording)()); })
        ->Iterations(scenes.round() * (plan.smoke ? 1 : kRounds))
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark((name + "/naive").c_str(),
                                 [&, recording](benchmark::State& s) { naive(s, (scenes.*recording)()); })
        ->Iterations(plan.iterations(80))
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(
        (name + "/same_objects").c_str(),
        [&, recording, least](benchmark::State& s) { agreement(s, (scenes.*recording)(), least); })
        ->Iterations(plan.iterations(40))
        ->Unit(benchmark::kMillisecond);
  };
  add("typical", &Scenes::typical, 0.95);
  // The naive mapper's one histogram for the whole room loses some of the many things in uneven light.
  add("cluttered", &Scenes::cluttered, 0.80);
}

}  // namespace omnifleet::bench
