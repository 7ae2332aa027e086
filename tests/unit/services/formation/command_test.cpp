// Commands at run time: sender and formation services on the fake bus, the services in a thread of their own.

#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include <atomic>
#include <thread>

#include "adapters/adapters.h"
#include "bus/fake_bus.h"
#include "command/command_sender.h"
#include "formation/service.h"

namespace omnifleet::services {
namespace {

using std::chrono::seconds;

const bus::Topics& topics() {
  static const bus::Topics kTopics(bus::RunMode::kLive);
  return kTopics;
}

/// Formation services that receive empty frames continuously, until the end of the scope.
class Formations {
 public:
  Formations(const std::shared_ptr<bus::FakeNetwork>& network, const fleet::Fleet& fleet,
             const std::vector<std::string>& robots)
      : bus_(bus::makeFakeBus(network)) {
    auto log = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_mt>());
    for (const std::string& robot : robots) {
      bus::ServiceOptions options;
      options.robot = robot;
      options.mode = bus::RunMode::kLive;
      services_.push_back(
          std::make_unique<FormationService>(bus::ServiceContext{*bus_, options, topics(), log}, fleet));
      writers_.push_back(bus_->writer(topics().objects, robot));
      robots_.push_back(robot);
    }
    thread_ = std::thread([this] { run(); });
  }
  ~Formations() {
    stop_ = true;
    thread_.join();
  }

 private:
  void run() {
    Objects objects;
    v1::Objects wire;
    while (!stop_) {
      objects.acquired_ns += 200'000'000;
      ++objects.sequence;
      for (std::size_t i = 0; i < robots_.size(); ++i) {
        objects.robot = robots_[i];
        adapters::toWire(objects, adapters::RunClock::kSim, wire);
        written_ = writers_[i]->write(wire) && written_;
        while (services_[i]->spin()) {
        }
      }
      std::this_thread::yield();
    }
  }

  std::unique_ptr<bus::Bus> bus_;
  std::vector<std::unique_ptr<FormationService>> services_;
  std::vector<std::unique_ptr<bus::Writer<v1::Objects>>> writers_;
  std::vector<std::string> robots_;
  bool written_ = true;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class Command : public testing::Test {
 protected:
  Command()
      : fleet_(fleet::Fleet::load(
            std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml", {}, {})),
        network_(bus::makeFakeNetwork()),
        bus_(bus::makeFakeBus(network_)) {}

  fleet::Fleet fleet_;
  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> bus_;
};

TEST_F(Command, ReachesAllRobotsAndKeepsUnsetFields) {
  const Formations formations(network_, fleet_, {"r1", "r2"});
  CommandRequest request;
  request.distance_m = 0.55;
  {
    CommandSender sender(*bus_, topics(), fleet_);
    ASSERT_TRUE(sender.send(request, 1'000, seconds(30)));
    EXPECT_TRUE(sender.missing().empty());
    EXPECT_EQ(sender.sent().shape, motion::FormationShape::kColumn) << "config/arenas/small.yaml";
    EXPECT_EQ(sender.sent().distance_m, 0.55);
  }
  CommandRequest second;
  second.shape = motion::FormationShape::kLine;
  CommandSender sender(*bus_, topics(), fleet_);
  // The clock of the second sender is behind. Its command still replaces the one in force.
  ASSERT_TRUE(sender.send(second, 500, seconds(30)));
  EXPECT_EQ(sender.sent().distance_m, 0.55) << "taken from the formations' states, not from the file";
  EXPECT_GT(sender.sent().acquired_ns, 1'000);
}

TEST_F(Command, ChangesTheBehaviourOfAllRobotsUntilAnotherIsCommanded) {
  const Formations formations(network_, fleet_, {"r1", "r2"});
  CommandRequest request;
  request.behaviour = motion::Behaviour::kBoundaryFollowing;
  request.boundary_m = 0.35;
  {
    CommandSender sender(*bus_, topics(), fleet_);
    ASSERT_TRUE(sender.send(request, 1'000, seconds(30)));
  }
  CommandRequest halt;
  halt.halt = true;
  CommandSender sender(*bus_, topics(), fleet_);
  ASSERT_TRUE(sender.send(halt, 2'000, seconds(30)));
  EXPECT_EQ(sender.sent().behaviour, motion::Behaviour::kBoundaryFollowing);
  EXPECT_EQ(sender.sent().boundary_m, 0.35);
}

TEST_F(Command, IsReceivedByLateJoiners) {
  const Formations first(network_, fleet_, {"r1"});
  auto reader = bus_->reader(topics().formation_state, "r2");
  TimeNs sent_ns = 0;
  {
    const Formations second(network_, fleet_, {"r2"});
    CommandSender sender(*bus_, topics(), fleet_);
    CommandRequest request;
    request.halt = true;
    ASSERT_TRUE(sender.send(request, 1'000, seconds(30)));
    sent_ns = sender.sent().acquired_ns;
  }
  v1::FormationState state;
  while (reader->take(state)) {
  }
  const Formations restarted(network_, fleet_, {"r2"});
  const auto until = std::chrono::steady_clock::now() + seconds(30);
  TimeNs command_ns = 0;
  while (command_ns != sent_ns && std::chrono::steady_clock::now() < until) {
    if (reader->take(state)) {
      command_ns = state.command_ns();
    } else {
      bus_->wait(std::chrono::milliseconds(10));
    }
  }
  EXPECT_EQ(command_ns, sent_ns);
}

TEST_F(Command, NamesRobotsThatDoNotAnswer) {
  const Formations formations(network_, fleet_, {"r1"});
  CommandSender sender(*bus_, topics(), fleet_);
  EXPECT_FALSE(sender.send({}, 1'000, std::chrono::milliseconds(200)));
  EXPECT_EQ(sender.missing(), (std::vector<std::string>{"r1", "r2"}))
      << "a command is not sent to part of a fleet";
}

}  // namespace
}  // namespace omnifleet::services
