// The stages after the local mapper, each on its inputs from the typical room.

#include "classifier/classifier.h"
#include "estimation/estimator.h"
#include "formation/formation.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/benchmark/stage_inputs.h"

namespace omnifleet::bench {
namespace {

std::map<std::string, RobotBody> bodiesOf(const Recording& recording) {
  std::map<std::string, RobotBody> bodies;
  for (const synthetic::ArenaRobot& robot : recording.arena().robots) bodies[robot.name] = robot.body;
  return bodies;
}

void classify(benchmark::State& state, const Recording& recording, const StageInputs& inputs) {
  classifier::Classifier classifier({}, recording.robots().front(), bodiesOf(recording));
  Samples samples(state);
  std::vector<PoseEstimate> poses;
  double tracks = 0;
  int step = 0;
  for (auto _ : state) {
    const LocalMap& local_map = inputs.local_maps[static_cast<std::size_t>(step)].front();
    const double begun = threadCpuMs();
    const Objects& objects = classifier.process(local_map, poses);
    samples.add(threadCpuMs() - begun);
    tracks += static_cast<double>(objects.tracks.size());
    poses = recording.poses(step++);
  }
  samples.report();
  state.counters["tracks"] = benchmark::Counter(tracks, benchmark::Counter::kAvgIterations);
}

estimation::FleetEstimator makeEstimator(const Recording& recording, bool batch) {
  std::vector<estimation::RobotSetup> setups;
  for (const synthetic::ArenaRobot& robot : recording.arena().robots)
    setups.push_back({robot.name, robot.body, recording.truth(setups.size(), 0)});
  estimation::EstimatorOptions options;
  if (batch) options.window_frames = 1 << 20;  // no marginalisation: each step solves the whole run
  return estimation::FleetEstimator(setups, options);
}

/// Estimates the poses of all robots at one time. `batch`: the peer, which solves the whole run each time.
void estimate(benchmark::State& state, const Recording& recording, const StageInputs& inputs, bool batch) {
  estimation::FleetEstimator estimator = makeEstimator(recording, batch);
  Samples samples(state);
  std::vector<const Objects*> frames;
  double error_m = 0, until_poses_ms = 0;
  int step = 0;
  for (auto _ : state) {
    frames.clear();
    for (const Objects& objects : inputs.objects[static_cast<std::size_t>(step)]) frames.push_back(&objects);
    const double begun = threadCpuMs();
    const auto poses = estimator.process(recording.time(step), frames, {});
    until_poses_ms += threadCpuMs() - begun;
    estimator.refine();
    samples.add(threadCpuMs() - begun);
    for (std::size_t r = 0; r < poses.size(); ++r) {
      error_m += (poses[r].map_from_base.translation() - recording.truth(r, step).translation()).norm() /
                 static_cast<double>(poses.size());
    }
    ++step;
  }
  samples.report();
  error_m /= step;
  state.counters["error_mm"] = 1e3 * error_m;
  state.counters["until_poses_ms"] = until_poses_ms / step;
  // Both must correct the wheels: dead reckoning exceeds this error after a few metres.
  if (error_m > 0.02) state.SkipWithError("the mean error of the poses exceeds 2 cm");
}

void formationStep(benchmark::State& state, const Recording& recording, const StageInputs& inputs) {
  const auto options = formation::Formation::Options::read(recording.arena().formation);
  formation::Formation formation(recording.robots()[1], bodiesOf(recording), options);
  Samples samples(state);
  std::vector<PoseEstimate> poses;
  int step = 0;
  for (auto _ : state) {
    const Objects& objects = inputs.objects[static_cast<std::size_t>(step)][1];
    const double begun = threadCpuMs();
    benchmark::DoNotOptimize(formation.process(objects, poses));
    samples.add(threadCpuMs() - begun);
    poses = recording.poses(step++);
  }
  samples.report();
}

}  // namespace

void registerStages(Scenes& scenes, const Plan& plan) {
  const int steps = plan.iterations(160);
  const auto inputs = std::make_shared<std::unique_ptr<StageInputs>>();
  const auto add = [&, inputs](const char* name, auto run) {
    benchmark::RegisterBenchmark(name,
                                 [&scenes, inputs, steps, run](benchmark::State& state) {
                                   if (!*inputs)
                                     *inputs = std::make_unique<StageInputs>(scenes.typical(), steps);
                                   run(state, scenes.typical(), **inputs);
                                 })
        ->Iterations(steps)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  using State = benchmark::State;
  add("classifier/frame", classify);
  add("estimator/frame",
      [](State& s, const Recording& r, const StageInputs& i) { estimate(s, r, i, false); });
  add("estimator/frame/batch",
      [](State& s, const Recording& r, const StageInputs& i) { estimate(s, r, i, true); });
  add("formation/frame", formationStep);
}

}  // namespace omnifleet::bench
