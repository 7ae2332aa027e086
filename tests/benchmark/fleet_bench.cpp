// Latency from frame to map change, live, three robots at 10 Hz. The time runs from the publication of a
// frame until it has changed a replica of the map in another process. Local mappers, classifiers, localizer
// and mergers are the real programs. This process plays cameras (preloaded frames) and wheels, and holds one
// more replica, so that both times are read from one clock.

#include <algorithm>
#include <chrono>
#include <cstring>
#include <map>
#include <optional>

#include "adapters/adapters.h"
#include "bus/dds_bus.h"
#include "bus/idle_window.h"
#include "bus/topics.h"
#include "fleet/fleet.h"
#include "occupancy/occupancy_map.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kDomain = 94;
constexpr int kWarmUpSteps = 30;  // 3 s: all endpoints have matched and buffers have their final size
constexpr auto kMatchTimeout = std::chrono::seconds(30);

/// The programs of the fleet, without cameras, world and formation.
class Programs {
 public:
  explicit Programs(const fleet::Fleet& fleet) : folder_(test::freshDir("frame_to_map")) {
    for (const fleet::ProcessSpec& spec : fleet::processes(fleet)) {
      if (spec.service == "camera" || spec.service == "world" || spec.service == "formation") continue;
      if (spec.service == "localizer" && !spec.instance.empty()) continue;  // ceiling camera: none here
      start(spec);
    }
  }

 private:
  void start(const fleet::ProcessSpec& spec) {
    std::vector<std::string> argv{
        test::program(spec.service), "--mode", "live", "--fleet", benchmarkFile("fleet.yaml"), "--domain",
        std::to_string(kDomain)};
    if (!spec.instance.empty()) argv.insert(argv.end(), {"--robot", spec.instance});
    all_.push_back(
        std::make_unique<test::Process>(argv, folder_ + "/" + spec.service + "_" + spec.instance + ".log"));
  }
  std::string folder_;
  std::vector<std::unique_ptr<test::Process>> all_;
};

bus::DdsBusOptions busOptions() {
  bus::DdsBusOptions options;
  options.name = "benchmark";
  options.domain = kDomain;
  return options;
}

/// Times at which the cameras of the fleet take their frames.
enum class CameraTiming {
  kTogether,  ///< all at the same time: the hardest case
  kApart      ///< a third of a period apart, as with clocks that are not synchronized
};

/// Publishes camera frames and wheel speeds of every robot from the recording.
class Sources {
 public:
  Sources(bus::Bus& bus, const bus::Topics& topics, const Recording& recording, CameraTiming timing)
      : recording_(recording),
        shift_ns_(timing == CameraTiming::kTogether
                      ? 0
                      : recording.arena().periodNs() / static_cast<TimeNs>(recording.robots().size())) {
    for (std::size_t r = 0; r < recording.robots().size(); ++r) {
      const std::string& name = recording.robots()[r];
      cameras_.push_back(bus.frameWriter(name + "/fisheye", recording.image(r, 0).total() * 3));
      wheels_.push_back(bus.writer(topics.wheels_odometry, name));
    }
  }

  /// Waits for a reader of each stream. Returns false on timeout.
  bool matched() {
    bool all = true;
    for (auto& camera : cameras_) all = all && camera->waitForReaders(1, kMatchTimeout);
    for (auto& wheels : wheels_) all = all && wheels->waitForReaders(1, kMatchTimeout);
    return all;
  }

  std::size_t robots() const { return cameras_.size(); }
  const std::string& robot(std::size_t r) const { return recording_.robots()[r]; }
  /// Acquisition time of a frame.
  TimeNs time(std::size_t r, int step) const { return recording_.time(step) + shiftNs(r); }
  /// Shift of the robot's frames against those of the first robot.
  TimeNs shiftNs(std::size_t r) const { return static_cast<TimeNs>(r) * shift_ns_; }

  /// Copies the frames of a step into the loans.
  bool prepare(int step) {
    bus::FrameHeader header;
    header.sequence = static_cast<std::uint32_t>(step);
    for (std::size_t r = 0; r < cameras_.size(); ++r) {
      const cv::Mat3b& image = recording_.image(r, step);
      header.acquired_ns = time(r, step);
      header.width_px = image.cols;
      header.height_px = image.rows;
      std::uint8_t* loan = cameras_[r]->begin(header);
      if (!loan) return false;
      std::memcpy(loan, image.data, header.bytes());
    }
    return true;
  }

  bool publish(std::size_t r) { return cameras_[r]->publish(); }
  /// Publishes the wheel speeds from the frame's time on.
  bool publishWheels(std::size_t robot, int step) {
    const dataset::WheelRow row = recording_.wheels(robot, step);
    v1::WheelOdometry wire;
    wire.robot(recording_.robots()[robot]);
    adapters::fillHeader(row.time_ns + shiftNs(robot), static_cast<std::uint32_t>(step),
                         adapters::RunClock::kSystem, wire.header());
    wire.v_left_mps(row.left_mps);
    wire.v_right_mps(row.right_mps);
    return wheels_[robot]->write(wire);
  }

 private:
  const Recording& recording_;
  TimeNs shift_ns_;
  std::vector<std::unique_ptr<bus::FrameWriter>> cameras_;
  std::vector<std::unique_ptr<bus::Writer<v1::WheelOdometry>>> wheels_;
};

/// The map as every robot's merger holds it in live mode.
class Replica {
 public:
  Replica(bus::Bus& bus, const bus::Topics& topics, const fleet::Fleet& fleet)
      : contributions_(bus.reader(topics.map_contribution)),
        poses_(bus.reader(topics.map_keyframe_pose)),
        map_(occupancy::OccupancyOptions::read(fleet.service("global_merger").child("occupancy")),
             fleet.bodies()) {
    map_.correctLater();
  }

  using Name = std::pair<std::string, TimeNs>;
  /// Takes all samples that have arrived and calls `changed` for each keyframe that is now in the map.
  /// Returns false if no sample has arrived.
  template <class Changed>
  bool pull(const Changed& changed) {
    bool any = false;
    while (contributions_->take(contribution_wire_)) {
      any = true;
      if (adapters::fromWire(contribution_wire_, contribution_) && map_.add(contribution_))
        settle({contribution_.robot, contribution_.acquired_ns}, changed);
    }
    while (poses_->take(pose_wire_)) {
      any = true;
      if (adapters::fromWire(pose_wire_, pose_) && map_.add(pose_))
        settle({pose_.robot, pose_.acquired_ns}, changed);
    }
    return any;
  }
  /// Recomputes deferred contributions in an idle window, as the mergers do. Returns false if there are none.
  bool correctSome() { return map_.correctSome(kCorrectedAtOnce); }

 private:
  template <class Changed>
  void settle(const Name& name, const Changed& changed) {
    const auto* keyframe = map_.store().find(name.first, name.second);
    if (keyframe && keyframe->contribution && keyframe->pose && keyframe->pose->valid) changed(name);
  }

  static constexpr std::size_t kCorrectedAtOnce = 8;  // as in the mergers

  std::unique_ptr<bus::Reader<v1::Contribution>> contributions_;
  std::unique_ptr<bus::Reader<v1::KeyframePose>> poses_;
  v1::Contribution contribution_wire_;
  v1::KeyframePose pose_wire_;
  occupancy::Contribution contribution_;
  occupancy::KeyframePose pose_;
  occupancy::OccupancyMap map_;
};

/// Receives the samples of the stages in between.
class Stages {
 public:
  Stages(bus::Bus& bus, const bus::Topics& topics)
      : local_maps_(bus.reader(topics.local_map)),
        objects_(bus.reader(topics.objects)),
        poses_(bus.reader(topics.pose)) {}

  /// Calls `received(stage, {robot, acquisition time})` for all samples that have arrived.
  template <class Received>
  void pull(const Received& received) {
    while (local_maps_->take(local_map_)) received("local_map", name(local_map_));
    while (objects_->take(sample_)) received("objects", name(sample_));
    while (poses_->take(pose_)) received("pose", name(pose_));
  }

 private:
  template <class Wire>
  static Replica::Name name(const Wire& wire) {
    return {wire.robot().to_string(), wire.header().acquired_ns()};
  }
  std::unique_ptr<bus::Reader<v1::LocalMap>> local_maps_;
  std::unique_ptr<bus::Reader<v1::Objects>> objects_;
  std::unique_ptr<bus::Reader<v1::Pose>> poses_;
  v1::LocalMap local_map_;
  v1::Objects sample_;
  v1::Pose pose_;
};

/// Milliseconds since publication of the frame, by stage; "map": until the map has changed.
using Latencies = std::map<std::string, std::vector<double>>;

/// Publishes the frames of each step at their times and receives map changes in between.
class Run {
 public:
  /// `stages` may be null: reading these topics slows down their writers.
  Run(Sources& sources, Replica& replica, Stages* stages, bus::Bus& bus, std::chrono::nanoseconds period)
      : sources_(sources),
        replica_(replica),
        stages_(stages),
        bus_(bus),
        period_(period),
        next_(Clock::now()) {}

  bool step(int step, Latencies& latencies_ms) {
    bool good = sources_.prepare(step);
    const Clock::time_point due = next_;
    for (std::size_t r = 0; r < sources_.robots(); ++r) {
      next_ = due + std::chrono::nanoseconds(sources_.shiftNs(r));
      receive(latencies_ms);
      sent_[{sources_.robot(r), sources_.time(r, step)}] = Clock::now();
      good = good && sources_.publish(r);
      const bool next_is_due = r + 1 < sources_.robots() && sources_.shiftNs(r + 1) == sources_.shiftNs(r);
      for (; !next_is_due && wheels_sent_ <= r; ++wheels_sent_)
        good = sources_.publishWheels(wheels_sent_, step) && good;
    }
    wheels_sent_ = 0;
    next_ = due + period_;
    return good;
  }
  /// Receives map changes until the next frames are due.
  void receive(Latencies& latencies_ms) {
    const auto received = [&](const char* stage, const Replica::Name& name) {
      const auto sent = sent_.find(name);
      if (sent == sent_.end()) return;
      latencies_ms[stage].push_back(
          std::chrono::duration<double, std::milli>(Clock::now() - sent->second).count());
    };
    const auto pull = [&] {
      if (stages_) stages_->pull(received);
      if (replica_.pull([&](const Replica::Name& name) { received("map", name); }))
        idle_window_.onInput(Clock::now());
    };
    for (auto now = Clock::now(); now < next_; now = Clock::now()) {
      pull();
      if (idle_window_.isOpen(now)) {
        idle_window_.onUse();
        if (replica_.correctSome()) continue;
      }
      bus_.wait((idle_window_.isOpen(now) ? next_ : std::min(next_, idle_window_.opensAt(now))) - now);
    }
    pull();
  }

 private:
  Sources& sources_;
  Replica& replica_;
  Stages* stages_;
  bus::Bus& bus_;
  std::chrono::nanoseconds period_;
  Clock::time_point next_;
  std::size_t wheels_sent_ = 0;  ///< number of robots whose wheel speeds of this step are published
  bus::IdleWindow idle_window_;
  std::map<Replica::Name, Clock::time_point> sent_;
};

void report(Latencies& latencies_ms, benchmark::State& state) {
  reportPercentiles(latencies_ms["map"], state);
  state.counters["keyframes"] = static_cast<double>(latencies_ms["map"].size());
  for (auto& [stage, ms] : latencies_ms) {
    std::sort(ms.begin(), ms.end());
    state.counters[stage + "_ms"] = percentile(ms, 0.5);
  }
}

void frameToMap(benchmark::State& state, const Recording& recording, CameraTiming timing, bool read_stages) {
  const fleet::Fleet fleet = fleet::Fleet::load(benchmarkFile("fleet.yaml"), "", {});
  const bus::Topics topics(bus::RunMode::kLive);
  const auto dds = bus::makeDdsBus(busOptions());
  Sources sources(*dds, topics, recording, timing);
  Replica replica(*dds, topics, fleet);
  std::optional<Stages> stages;
  if (read_stages) stages.emplace(*dds, topics);
  const Programs programs(fleet);
  if (!sources.matched()) return state.SkipWithError("the programs of the fleet did not match within 30 s");
  Latencies latencies_ms;
  Run run(sources, replica, stages ? &*stages : nullptr, *dds,
          std::chrono::nanoseconds(recording.arena().periodNs()));
  bool good = true;
  int step = 0;
  for (; step < kWarmUpSteps; ++step) good = run.step(step, latencies_ms) && good;
  latencies_ms.clear();
  for (auto _ : state) {
    good = run.step(step, latencies_ms) && good;
    const auto& all = latencies_ms["map"];
    state.SetIterationTime(all.empty() ? 0.0 : 1e-3 * all.back());
    ++step;
  }
  run.receive(latencies_ms);
  if (!good) state.SkipWithError("a frame or wheel speed could not be published");
  if (latencies_ms["map"].size() < static_cast<std::size_t>(state.iterations()) / 2)
    state.SkipWithError("less than half a keyframe per step reached the map");
  report(latencies_ms, state);
}

}  // namespace

void registerFleet(Scenes& scenes, const Plan& plan) {
  const auto add = [&](const char* name, CameraTiming timing, bool stages, int iterations) {
    benchmark::RegisterBenchmark(name,
                                 [&scenes, timing, stages](benchmark::State& state) {
                                   guarded(state,
                                           [&] { frameToMap(state, scenes.typical(), timing, stages); });
                                 })
        ->Iterations(plan.smoke ? 20 : iterations)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  add("fleet/frame_to_map", CameraTiming::kTogether, false, 300);
  add("fleet/frame_to_map/stages", CameraTiming::kTogether, true, 100);
  add("fleet/frame_to_map/apart", CameraTiming::kApart, false, 300);
}

}  // namespace omnifleet::bench
