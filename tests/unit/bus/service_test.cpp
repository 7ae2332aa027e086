#include <gmock/gmock.h>
#include <spdlog/sinks/null_sink.h>

#include <thread>

#include "bus/idle_window.h"
#include "bus/service_runner.h"
#include "tests/unit/bus/any_bus.h"

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;
using testing::ThrowsMessage;

TEST(StatusBoard, ComputesRateQuantilesAndCounts) {
  StatusBoard board;
  const StatusBoard::Clock::time_point start = StatusBoard::Clock::now();
  board.state(ServiceState::kRunning);
  board.snapshot(start);
  EXPECT_FALSE(board.changed());
  for (int i = 1; i <= 100; ++i) board.processed(milliseconds(i), i % 10 != 0);
  board.dropped(3);
  board.expected(500);
  const auto figures = board.snapshot(start + seconds(4));
  EXPECT_DOUBLE_EQ(figures.rate_hz, 25.0);
  EXPECT_NEAR(figures.latency_p50_ms, 50.5, 0.5);  // between the two middle values
  EXPECT_NEAR(figures.latency_p99_ms, 99.0, 0.5);
  EXPECT_EQ(figures.processed, 100u);
  EXPECT_EQ(figures.invalid, 10u);
  EXPECT_EQ(figures.drops, 3u);
  EXPECT_EQ(figures.expected, 500u);
  EXPECT_DOUBLE_EQ(board.snapshot(start + seconds(5)).rate_hz, 0.0);
}

TEST(StatusBoard, KeepsOnlyTheLastLatencies) {
  StatusBoard board;
  for (int i = 0; i < 1024; ++i) board.processed(seconds(1));
  for (int i = 0; i < 1024; ++i) board.processed(milliseconds(1));
  EXPECT_NEAR(board.snapshot(StatusBoard::Clock::now()).latency_p99_ms, 1.0, 1e-6);
}

TEST(StatusBoard, ErrorIsPublishedAtOnceAndDegradesUntilCleared) {
  StatusBoard board;
  const auto now = StatusBoard::Clock::now();
  board.state(ServiceState::kRunning);
  board.snapshot(now);
  board.report({ErrorCode::kFileWriteFailed, "disk full"}, true);
  EXPECT_TRUE(board.changed());
  EXPECT_EQ(board.snapshot(now).state, ServiceState::kDegraded);
  board.report({ErrorCode::kFileWriteFailed, "disk full"}, true);
  EXPECT_FALSE(board.changed()) << "a repeated error is no change";
  board.clearError();
  EXPECT_TRUE(board.changed());
  EXPECT_EQ(board.snapshot(now).state, ServiceState::kRunning);
  EXPECT_EQ(board.snapshot(now).last_error, Message{});
}

TEST(IdleWindow, OpensAfterSilenceOrPatience) {
  const auto start = IdleWindow::Clock::now();
  IdleWindow idle_window;
  EXPECT_TRUE(idle_window.isOpen(start)) << "no input so far";
  idle_window.onInput(start);
  EXPECT_FALSE(idle_window.isOpen(start + IdleWindow::kSilence - milliseconds(1)));
  EXPECT_TRUE(idle_window.isOpen(start + IdleWindow::kSilence));
  for (milliseconds ago{0}; ago < IdleWindow::kPatience; ago += milliseconds(5)) {
    idle_window.onInput(start + ago);
    EXPECT_FALSE(idle_window.isOpen(start + ago));
  }
  EXPECT_EQ(idle_window.opensAt(start), start + IdleWindow::kPatience);
  idle_window.onUse();
  EXPECT_TRUE(idle_window.isOpen(start)) << "no input since the last use";
  idle_window.onInput(start + IdleWindow::kPatience);
  EXPECT_EQ(idle_window.opensAt(start), start + IdleWindow::kPatience + IdleWindow::kSilence);
}

TEST(IdleWindow, ClosesBeforeNextBurstIsDue) {
  const auto start = IdleWindow::Clock::now();
  constexpr milliseconds kPeriod{100}, kBurst{7};
  IdleWindow idle_window;
  const auto burstAt = [&](milliseconds at) {
    idle_window.onInput(start + at);
    idle_window.onInput(start + at + kBurst);
    idle_window.onUse();
  };
  burstAt(milliseconds(0));
  burstAt(kPeriod);
  EXPECT_TRUE(idle_window.isOpen(start + 2 * kPeriod)) << "one period does not make bursts regular";
  burstAt(2 * kPeriod + milliseconds(5));
  const auto due = start + 3 * kPeriod + milliseconds(10);
  EXPECT_TRUE(idle_window.isOpen(due - IdleWindow::kAhead - milliseconds(1)));
  EXPECT_FALSE(idle_window.isOpen(due - IdleWindow::kAhead));
  EXPECT_FALSE(idle_window.isOpen(due));
  EXPECT_EQ(idle_window.opensAt(due - milliseconds(1)), due + IdleWindow::kAhead)
      << "opens again when the burst does not come";
  EXPECT_TRUE(idle_window.isOpen(due + IdleWindow::kAhead));
  burstAt(4 * kPeriod + milliseconds(60));
  EXPECT_TRUE(idle_window.isOpen(start + 6 * kPeriod)) << "the burst came off schedule";
}

TEST(IdleWindow, IsAwaitedWhileBurstIsDue) {
  const auto bus = makeFakeBus(makeFakeNetwork());
  const auto now = IdleWindow::Clock::now();
  constexpr milliseconds kPeriod{100}, kLeft{5};
  IdleWindow idle_window;
  for (int ago = 3; ago >= 1; --ago) idle_window.onInput(now + kLeft - ago * kPeriod);
  awaitIdleWindow(*bus, idle_window, [] { return false; });
  EXPECT_GE(IdleWindow::Clock::now() - now, kLeft + IdleWindow::kAhead);
}

TEST(IdleWindow, PredictsNoBurstForShortPeriods) {
  const auto start = IdleWindow::Clock::now();
  IdleWindow idle_window;
  for (milliseconds at{0}; at < milliseconds(1000); at += milliseconds(33)) {
    idle_window.onInput(start + at);
    idle_window.onUse();
    EXPECT_TRUE(idle_window.isOpen(start + at + milliseconds(32)));
  }
}

TEST(IdleWindow, IsAwaitedOnlyAfterInput) {
  const auto bus = makeFakeBus(makeFakeNetwork());
  IdleWindow idle_window;
  int samples = 0, pulls = 0;
  const auto pull = [&] { return ++pulls, samples-- > 0; };
  awaitIdleWindow(*bus, idle_window, pull);
  EXPECT_EQ(pulls, 1);
  samples = 2;
  const auto begun = IdleWindow::Clock::now();
  awaitIdleWindow(*bus, idle_window, pull);
  EXPECT_GE(pulls, 1 + 3);
  EXPECT_GE(IdleWindow::Clock::now() - begun, IdleWindow::kSilence);
  bus->requestStop();
  pulls = 0;
  awaitIdleWindow(*bus, idle_window, pull);
  EXPECT_EQ(pulls, 0);
}

/// A stage that adds one to x and publishes the pose, on topics "pose/<n>".
class AddOne : public Service {
 public:
  AddOne(Bus& bus, const Topic<v1::Pose>& in, const Topic<v1::Pose>& out, int samples)
      : in_(bus.reader(in)), out_(bus.writer(out)), left_(samples) {}
  std::vector<Expectation> expectations() const override {
    return {{"a writer of the input", [this] { return in_->matched() > 0; }}};
  }
  void start() override { log += "start "; }
  bool spin() override {
    v1::Pose pose;
    if (left_ == 0 || !in_->take(pose)) return false;
    if (pose.map_from_base().x() < 0) throw std::runtime_error("x below zero");
    pose.map_from_base().x(pose.map_from_base().x() + 1);
    --left_;
    status().processed(milliseconds(1));
    return out_->write(pose);
  }
  bool background() override {
    log += "background " + std::to_string(left_) + " ";
    if (in_background) in_background();
    return false;
  }
  bool finished() const override { return left_ == 0; }
  void drain() override { log += "drain "; }
  std::optional<Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    if (!since_) since_ = now;
    return Waiting{0, "the input of " + name, now - *since_};
  }

  std::string log, name = "a stage";
  std::function<void()> in_background;

 private:
  std::unique_ptr<Reader<v1::Pose>> in_;
  std::unique_ptr<Writer<v1::Pose>> out_;
  int left_;
  std::optional<std::chrono::steady_clock::time_point> since_;
};

class RunLoop : public testing::Test {
 protected:
  static Topic<v1::Pose> stage(int n) {
    return {"pose/" + std::to_string(n), Topics(RunMode::kReplay).pose.qos};
  }
  ExitCode run(Service& service) { return runLoop(*bus, service, options, publisher, log); }
  std::vector<v1::ServiceState> states() {
    std::vector<v1::ServiceState> result;
    v1::ServiceStatus status;
    while (watcher->take(status)) {
      if (result.empty() || result.back() != status.state()) result.push_back(status.state());
      last_status = status;
    }
    return result;
  }

  std::shared_ptr<FakeNetwork> network = makeFakeNetwork();
  std::unique_ptr<Bus> bus = makeFakeBus(network), others = makeFakeBus(network);
  Topics topics{RunMode::kReplay};
  // Receives every status; the topic itself keeps only the last one.
  Topic<v1::ServiceStatus> all_status = [this] {
    auto topic = topics.service_status;
    topic.qos.keep_all = true;
    return topic;
  }();
  std::unique_ptr<Reader<v1::ServiceStatus>> watcher = others->reader(all_status);
  StatusPublisher publisher{*bus, topics, "adder", "r1"};
  v1::ServiceStatus last_status;
  ServiceOptions options = [] {
    ServiceOptions result;
    result.mode = RunMode::kReplay;
    result.silence_limit = seconds(1);
    return result;
  }();
  spdlog::logger log{"test", std::make_shared<spdlog::sinks::null_sink_mt>()};
};

TEST_F(RunLoop, WaitsForExpectationsRunsToEndAndPublishesStatus) {
  AddOne service(*bus, stage(0), stage(1), 3);
  const auto output = others->reader(stage(1));
  std::thread feeder([&] {
    const auto writer = others->writer(stage(0));
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(writer->write(poseOf("r1", k, k)));
    v1::Pose pose;
    for (int k = 0; k < 3;) k += output->take(pose) ? 1 : (others->wait(kPatience), 0);
  });
  EXPECT_EQ(run(service), ExitCode::kOk);
  feeder.join();
  EXPECT_EQ(service.log, "start drain ");
  EXPECT_THAT(states(), ElementsAre(v1::SERVICE_WAITING, v1::SERVICE_RUNNING, v1::SERVICE_FINISHED));
  EXPECT_EQ(last_status.processed(), 3u);
  EXPECT_EQ(last_status.service().to_string(), "adder");
  EXPECT_EQ(last_status.instance().to_string(), "r1");
  EXPECT_EQ(last_status.process_id(), static_cast<std::uint32_t>(::getpid()));
}

TEST_F(RunLoop, UnmetExpectationEndsRunWithItsName) {
  AddOne service(*bus, stage(0), stage(1), 3);
  EXPECT_EQ(run(service), ExitCode::kSilentStage);
  EXPECT_EQ(service.log, "drain ");
  states();
  EXPECT_THAT(last_status.last_error(), HasSubstr("a writer of the input"));
}

TEST_F(RunLoop, SilentInputEndsRunWithItsName) {
  AddOne service(*bus, stage(0), stage(1), 3);
  const auto silent = others->writer(stage(0));
  EXPECT_EQ(run(service), ExitCode::kSilentStage);
  EXPECT_EQ(service.log, "start drain ");
  states();
  EXPECT_EQ(last_status.error_code(), toString(ErrorCode::kStreamSilent));
  EXPECT_THAT(last_status.last_error().to_string(), StartsWith("the input of a stage: no sample for 1 s"));
}

TEST_F(RunLoop, LiveModeIgnoresExpectationsAndSilence) {
  options.mode = RunMode::kLive;
  AddOne service(*bus, stage(0), stage(1), 3);
  std::thread stopper([&] {
    v1::ServiceStatus status;  // two statuses are one second apart, which exceeds the silence limit
    for (int running = 0; running < 3;) {
      if (!watcher->take(status)) {
        others->wait(kPatience);
      } else if (status.state() == v1::SERVICE_RUNNING) {
        ++running;
      }
    }
    bus->requestStop();
  });
  EXPECT_EQ(run(service), ExitCode::kStopped);
  stopper.join();
  EXPECT_THAT(service.log, StartsWith("start background 3 "));
}

TEST_F(RunLoop, LiveModeRunsBackgroundWithoutInput) {
  options.mode = RunMode::kLive;
  AddOne service(*bus, stage(0), stage(1), 4);
  service.in_background = [&] { bus->requestStop(); };
  const auto writer = others->writer(stage(0));
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(writer->write(poseOf("r1", k, k)));
  EXPECT_EQ(run(service), ExitCode::kStopped);
  EXPECT_EQ(service.log, "start background 1 drain ");
}

TEST_F(RunLoop, ReportsExceptionAsFailureInStatus) {
  AddOne service(*bus, stage(0), stage(1), 3);
  const auto writer = others->writer(stage(0));
  ASSERT_TRUE(writer->write(poseOf("r1", 0, -1)));
  EXPECT_EQ(run(service), ExitCode::kFailure);
  states();
  EXPECT_EQ(last_status.error_code(), toString(ErrorCode::kServiceFailed));
  EXPECT_EQ(last_status.last_error(), "x below zero");
}

TEST_F(RunLoop, DrainsOnlyWhenStoppedBeforeStart) {
  AddOne service(*bus, stage(0), stage(1), 3);
  bus->requestStop();
  EXPECT_EQ(run(service), ExitCode::kStopped);
  EXPECT_EQ(service.log, "drain ");
}

class InProcess : public RunLoop, public testing::WithParamInterface<bool> {};

TEST_P(InProcess, ResultsDoNotDependOnOrderOfStages) {
  InProcessFleet fleet;
  const auto source = others->writer(stage(0));
  const auto sink = others->reader(stage(3));
  auto a = std::make_unique<AddOne>(*bus, stage(0), stage(1), 50);
  auto b = std::make_unique<AddOne>(*bus, stage(1), stage(2), 50);
  auto c = std::make_unique<AddOne>(*bus, stage(2), stage(3), 50);
  if (GetParam()) std::swap(a, c);
  fleet.add("a", std::move(a));
  fleet.add("b", std::move(b));
  fleet.add("c", std::move(c));
  for (int k = 0; k < 50; ++k) ASSERT_TRUE(source->write(poseOf("r1", k, k)));
  fleet.run();
  for (int k = 0; k < 50; ++k) {
    v1::Pose pose;
    ASSERT_TRUE(sink->take(pose));
    EXPECT_EQ(pose.map_from_base().x(), k + 3);
  }
  EXPECT_EQ(dynamic_cast<AddOne&>(fleet.service(1)).log, "start drain ");
}
INSTANTIATE_TEST_SUITE_P(Order, InProcess, testing::Bool());

TEST_F(RunLoop, DeadlockNamesServiceAndMissingStream) {
  InProcessFleet fleet;
  const auto source = others->writer(stage(0));
  fleet.add("adder", std::make_unique<AddOne>(*bus, stage(0), stage(1), 2));
  ASSERT_TRUE(source->write(poseOf("r1", 0)));
  EXPECT_THAT([&] { fleet.run(); },
              ThrowsMessage<std::runtime_error>(
                  "deadlock, no service can continue: adder waits for the input of a stage"));
}

TEST_F(RunLoop, FleetWithUnmetExpectationDoesNotStart) {
  InProcessFleet fleet;
  fleet.add("adder", std::make_unique<AddOne>(*bus, stage(0), stage(1), 2));
  EXPECT_THAT([&] { fleet.run(); },
              ThrowsMessage<std::runtime_error>("adder expects: a writer of the input"));
}

TEST_F(RunLoop, FleetStopsBetweenRounds) {
  InProcessFleet fleet;
  const auto source = others->writer(stage(0));
  fleet.add("adder", std::make_unique<AddOne>(*bus, stage(0), stage(1), 2));
  int rounds = 0;
  fleet.run([&] { return ++rounds < 1; });
  EXPECT_EQ(dynamic_cast<AddOne&>(fleet.service(0)).log, "start drain ");
}

struct Parsed {
  std::optional<ExitCode> code;
  ServiceOptions options;
  std::string errors;
};

Parsed parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "program");
  Parsed parsed;
  testing::internal::CaptureStderr();
  parsed.code =
      parseCommandLine(static_cast<int>(arguments.size()), arguments.data(), "stage", {}, parsed.options);
  parsed.errors = testing::internal::GetCapturedStderr();
  return parsed;
}

TEST(CommandLine, ReadsEveryCommonOption) {
  const Parsed parsed = parse({"--fleet",     "f.yaml",      "--robot",
                               "r1",          "--camera",    "r1/fisheye",
                               "--mode",      "lockstep",    "--dataset",
                               "d",           "--out",       "o",
                               "--config",    "a.yaml",      "--config",
                               "b.yaml",      "--domain",    "7",
                               "--log-level", "debug",       "--silence-limit",
                               "5",           "--interface", "10.0.0.1",
                               "--peer",      "pc2",         "--max-message-bytes",
                               "1400"});
  ASSERT_FALSE(parsed.code) << parsed.errors;
  EXPECT_EQ(parsed.options.fleet, "f.yaml");
  EXPECT_EQ(parsed.options.robot, "r1");
  EXPECT_EQ(parsed.options.camera, "r1/fisheye");
  EXPECT_EQ(parsed.options.mode, RunMode::kLockstep);
  EXPECT_EQ(parsed.options.dataset, "d");
  EXPECT_EQ(parsed.options.out, "o");
  EXPECT_THAT(parsed.options.configs, ElementsAre("a.yaml", "b.yaml"));
  EXPECT_EQ(parsed.options.domain, 7);
  EXPECT_EQ(parsed.options.log_level, "debug");
  EXPECT_EQ(parsed.options.silence_limit, seconds(5));
  EXPECT_THAT(parsed.options.network.interfaces, ElementsAre("10.0.0.1"));
  EXPECT_THAT(parsed.options.network.peers, ElementsAre("pc2"));
  EXPECT_EQ(parsed.options.network.max_message_bytes, 1400);
}

TEST(CommandLine, ReadsDomainFromEnvironmentUnlessGiven) {
  ::setenv("OMNIFLEET_DOMAIN", "42", 1);
  EXPECT_EQ(parse({}).options.domain, 42);
  EXPECT_EQ(parse({"--domain", "3"}).options.domain, 3);
  ::unsetenv("OMNIFLEET_DOMAIN");
  EXPECT_EQ(parse({}).options.domain, 0);
}

TEST(CommandLine, NamesInvalidOptionInOneLine) {
  for (const auto& [arguments, named] : std::vector<std::pair<std::vector<const char*>, std::string>>{
           {{"--domain", "233"}, "--domain"},
           {{"--mode", "fast"}, "--mode"},
           {{"--unknown"}, "--unknown"},
           {{"--silence-limit", "0"}, "--silence-limit"},
           {{"--max-message-bytes", "100000"}, "--max-message-bytes"}}) {
    const Parsed parsed = parse(arguments);
    EXPECT_EQ(parsed.code, ExitCode::kBadOptions);
    EXPECT_THAT(parsed.errors, HasSubstr(named));
    EXPECT_EQ(std::count(parsed.errors.begin(), parsed.errors.end(), '\n'), 1) << parsed.errors;
  }
}

}  // namespace
}  // namespace omnifleet::bus
