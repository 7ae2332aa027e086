// Three robots at 10 Hz, live: from the moment a camera hands its frame over until a replica of the map, in
// another process, has changed by it. Local mappers, classifiers, localizer and mergers are the real
// programs; cameras (frames preloaded) and wheels are played here, and one more replica listens here, so that
// both moments are read from one clock.

#include <algorithm>
#include <chrono>
#include <cstring>
#include <map>
#include <optional>

#include "adapters/adapters.h"
#include "bus/dds_bus.h"
#include "bus/lull.h"
#include "bus/topics.h"
#include "fleet/fleet.h"
#include "occupancy/occupancy_map.h"
#include "tests/benchmark/benchmarks.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kDomain = 94;
constexpr int kWarmUpSteps = 30;  // 3 s: everybody has matched, buffers have grown
constexpr auto kPatience = std::chrono::seconds(30);

/// The programs of the fleet but for sources and formation.
class Programs {
 public:
  explicit Programs(const fleet::Fleet& fleet) : folder_(test::freshDir("frame_to_map")) {
    for (const fleet::ProcessSpec& spec : fleet::processes(fleet)) {
      if (spec.service == "camera" || spec.service == "world" || spec.service == "formation") continue;
      if (spec.service == "localizer" && !spec.instance.empty()) continue;  // no ceiling camera here
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

/// When the cameras of a fleet go off.
enum class Shutters {
  kTogether,  ///< all at one moment: the hardest case
  kApart      ///< each at its own, as nothing ties robots' clocks: here a third of a period after the other
};

/// Cameras and wheels of every robot, from the recording.
class Sources {
 public:
  Sources(bus::Bus& bus, const bus::Topics& topics, const Recording& recording, Shutters shutters)
      : recording_(recording),
        shift_ns_(shutters == Shutters::kTogether
                      ? 0
                      : recording.arena().periodNs() / static_cast<TimeNs>(recording.robots().size())) {
    for (std::size_t r = 0; r < recording.robots().size(); ++r) {
      const std::string& name = recording.robots()[r];
      cameras_.push_back(bus.frameWriter(name + "/fisheye", recording.image(r, 0).total() * 3));
      wheels_.push_back(bus.writer(topics.wheels_odometry, name));
    }
  }

  bool matched() {
    bool all = true;
    for (auto& camera : cameras_) all = all && camera->waitForReaders(1, kPatience);
    for (auto& wheels : wheels_) all = all && wheels->waitForReaders(1, kPatience);
    return all;
  }

  std::size_t robots() const { return cameras_.size(); }
  const std::string& robot(std::size_t r) const { return recording_.robots()[r]; }
  /// When the frame of a step was taken.
  TimeNs time(std::size_t r, int step) const { return recording_.time(step) + shiftNs(r); }
  /// How much later than the first robot's.
  TimeNs shiftNs(std::size_t r) const { return static_cast<TimeNs>(r) * shift_ns_; }

  /// The frames of a step into the loans.
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
  /// What the wheels say from the frame's time on.
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

/// The map as any robot's merger holds it, live.
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
  /// Takes what has arrived; `changed` is called for each keyframe that is now in the map.
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
  /// In a lull, as the mergers; false where there is nothing to do.
  bool correctSome() { return map_.correctSome(kCorrectedAtOnce); }

 private:
  template <class Changed>
  void settle(const Name& name, const Changed& changed) {
    const auto* keyframe = map_.store().find(name.first, name.second);
    if (keyframe && keyframe->contribution && keyframe->pose && keyframe->pose->valid) changed(name);
  }

  static constexpr std::size_t kCorrectedAtOnce = 8;  // as the mergers

  std::unique_ptr<bus::Reader<v1::Contribution>> contributions_;
  std::unique_ptr<bus::Reader<v1::KeyframePose>> poses_;
  v1::Contribution contribution_wire_;
  v1::KeyframePose pose_wire_;
  occupancy::Contribution contribution_;
  occupancy::KeyframePose pose_;
  occupancy::OccupancyMap map_;
};

/// When each robot's sample of each stage was heard here.
class Stages {
 public:
  Stages(bus::Bus& bus, const bus::Topics& topics)
      : local_maps_(bus.reader(topics.local_map)),
        objects_(bus.reader(topics.objects)),
        poses_(bus.reader(topics.pose)) {}

  /// `heard(stage, robot, time)` for all that has arrived.
  template <class Heard>
  void pull(const Heard& heard) {
    while (local_maps_->take(local_map_)) heard("local_map", name(local_map_));
    while (objects_->take(sample_)) heard("objects", name(sample_));
    while (poses_->take(pose_)) heard("pose", name(pose_));
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

using Latencies = std::map<std::string, std::vector<double>>;  ///< by stage, ms since the frame; "map" too

/// One step: frames out at their time, then the map watched until the next.
class Run {
 public:
  /// `stages`: may be null; listening to them costs their writers some time.
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
      watch(latencies_ms);
      sent_[{sources_.robot(r), sources_.time(r, step)}] = Clock::now();
      good = good && sources_.publish(r);
      const bool others_wait = r + 1 < sources_.robots() && sources_.shiftNs(r + 1) == sources_.shiftNs(r);
      for (; !others_wait && wheels_sent_ <= r; ++wheels_sent_)
        good = sources_.publishWheels(wheels_sent_, step) && good;
    }
    wheels_sent_ = 0;
    next_ = due + period_;
    return good;
  }
  /// Until the next frames are due.
  void watch(Latencies& latencies_ms) {
    const auto heard = [&](const char* stage, const Replica::Name& name) {
      const auto sent = sent_.find(name);
      if (sent == sent_.end()) return;
      latencies_ms[stage].push_back(
          std::chrono::duration<double, std::milli>(Clock::now() - sent->second).count());
    };
    const auto pull = [&] {
      if (stages_) stages_->pull(heard);
      if (replica_.pull([&](const Replica::Name& name) { heard("map", name); })) lull_.heard(Clock::now());
    };
    for (auto now = Clock::now(); now < next_; now = Clock::now()) {
      pull();
      if (lull_.here(now)) {
        lull_.used();
        if (replica_.correctSome()) continue;
      }
      bus_.wait((lull_.here(now) ? next_ : std::min(next_, lull_.next(now))) - now);
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
  std::size_t wheels_sent_ = 0;  ///< of so many robots in this step
  bus::Lull lull_;
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

void frameToMap(benchmark::State& state, const Recording& recording, Shutters shutters,
                bool listen_to_stages) {
  const fleet::Fleet fleet = fleet::Fleet::load(benchmarkFile("fleet.yaml"), "", {});
  const bus::Topics topics(bus::RunMode::kLive);
  const auto dds = bus::makeDdsBus(busOptions());
  Sources sources(*dds, topics, recording, shutters);
  Replica replica(*dds, topics, fleet);
  std::optional<Stages> stages;
  if (listen_to_stages) stages.emplace(*dds, topics);
  const Programs programs(fleet);
  if (!sources.matched()) return state.SkipWithError("the programs of the fleet did not come up");
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
  run.watch(latencies_ms);
  if (!good) state.SkipWithError("a frame could not be sent");
  if (latencies_ms["map"].size() < static_cast<std::size_t>(state.iterations()) / 2)
    state.SkipWithError("frames do not become part of the map");
  report(latencies_ms, state);
}

}  // namespace

void registerFleet(Scenes& scenes, const Plan& plan) {
  const auto add = [&](const char* name, Shutters shutters, bool stages, int iterations) {
    benchmark::RegisterBenchmark(name,
                                 [&scenes, shutters, stages](benchmark::State& state) {
                                   guarded(state,
                                           [&] { frameToMap(state, scenes.typical(), shutters, stages); });
                                 })
        ->Iterations(plan.smoke ? 20 : iterations)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  add("fleet/frame_to_map", Shutters::kTogether, false, 300);
  add("fleet/frame_to_map/stages", Shutters::kTogether, true, 100);
  add("fleet/frame_to_map/apart", Shutters::kApart, false, 300);
}

}  // namespace omnifleet::bench
