// The other process of the bus tests.
// bus_peer camera DOMAIN COUNT: sends COUNT frames to its first reader, then waits for SIGTERM.
// bus_peer service …: a service on runService() with the additional option --behaviour.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <iostream>
#include <optional>
#include <string>

#include "bus/dds_bus.h"
#include "bus/service_runner.h"
#include "bus/shared_memory.h"
#include "options/options.h"

namespace omnifleet::bus {
namespace {

void sayReady() {
  std::cout << "ready" << std::endl;
}

int runCamera(int domain, std::uint32_t count) {
  sigset_t stop;
  sigemptyset(&stop);
  sigaddset(&stop, SIGTERM);
  sigprocmask(SIG_BLOCK, &stop, nullptr);
  DdsBusOptions options;
  options.domain = domain;
  options.mode = RunMode::kLockstep;
  std::optional<SharedMemoryOwner> memory;
  const auto bus = makeDdsBus(options);
  memory.emplace(domain, "");
  FrameHeader header;
  header.width_px = 640;
  header.height_px = 480;
  const auto writer = bus->frameWriter("cam", header.bytes());
  sayReady();
  if (count > 0 && !writer->waitForReaders(1, std::chrono::seconds(10))) return 1;
  for (std::uint32_t k = 0; k < count; ++k) {
    header.acquired_ns = header.sequence = k;
    std::uint8_t* pixels = writer->begin(header);
    if (pixels == nullptr) return 1;
    std::fill_n(pixels, header.bytes(), static_cast<std::uint8_t>(k + 1));
    if (!writer->publish()) return 1;
  }
  std::cout << "sent" << std::endl;
  int received = 0;
  sigwait(&stop, &received);
  return 0;
}

/// Behaves as the test requests with --behaviour.
class TestService : public Service {
 public:
  TestService(const ServiceContext& context, std::string behaviour) : behaviour_(std::move(behaviour)) {
    if (behaviour_ == "bad-options") throw options::Error("fleet.yaml:3: robots: is required");
    poses_ = context.bus.reader(context.topics.pose, context.options.robot);
    answers_ = context.bus.writer(context.topics.formation_state, context.options.robot);
  }
  ~TestService() override {
    while (behaviour_ == "hangs") ::pause();
  }
  std::vector<Expectation> expectations() const override {
    return {{"a writer of pose", [this] { return poses_->matched() > 0; }},
            {"a reader of formation/state", [this] { return answers_->matched() > 0; }}};
  }
  void start() override { sayReady(); }
  bool spin() override {
    v1::Pose pose;
    if (!poses_->take(pose)) return false;
    if (behaviour_ == "throws") throw std::runtime_error("test exception");
    status().processed(std::chrono::milliseconds(2));
    v1::FormationState answer;
    answer.robot(pose.robot());
    answer.header(pose.header());
    finished_ = pose.header().sequence_number() == 99;
    if (!answers_->write(answer)) throw std::runtime_error(answers_->error());
    return true;
  }
  bool finished() const override { return finished_; }
  void drain() override { std::cout << "drained" << std::endl; }
  std::optional<Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    if (waiting_since_ == std::chrono::steady_clock::time_point{}) waiting_since_ = now;
    return Waiting{0, "pose of r1", now - waiting_since_};
  }

 private:
  std::string behaviour_;
  std::unique_ptr<Reader<v1::Pose>> poses_;
  std::unique_ptr<Writer<v1::FormationState>> answers_;
  std::chrono::steady_clock::time_point waiting_since_{};
  bool finished_ = false;
};

}  // namespace
}  // namespace omnifleet::bus

int main(int argc, char** argv) {
  using namespace omnifleet::bus;
  const std::string kind = argc > 1 ? argv[1] : "";
  if (kind == "camera" && argc == 4)
    return runCamera(std::stoi(argv[2]), static_cast<std::uint32_t>(std::stoul(argv[3])));
  if (kind != "service") return 64;
  std::string behaviour = "echo";
  return runService(
      argc - 1, argv + 1, "peer",
      [&](const ServiceContext& context) { return std::make_unique<TestService>(context, behaviour); },
      [&](CLI::App& app) { app.add_option("--behaviour", behaviour); });
}
