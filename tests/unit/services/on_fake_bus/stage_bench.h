#pragma once

#include <spdlog/logger.h>
#include <spdlog/sinks/null_sink.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "fleet_in_process/in_process.h"

namespace omnifleet::test {

/// One stage of config/fleets/small.yaml, or of another fleet file, on the fake bus; the test plays its
/// neighbours.
class StageBench {
 public:
  explicit StageBench(const std::string& service, const std::string& robot, const std::string& out = {},
                      const std::string& fleet = {}, bus::RunMode mode = bus::RunMode::kLockstep)
      : network_(bus::makeFakeNetwork()),
        theirs_(bus::makeFakeBus(network_, {})),
        mine_(bus::makeFakeBus(network_, {})),
        topics(mode) {
    bus::ServiceOptions options;
    options.fleet = fleet;
    if (fleet.empty())
      options.fleet = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
    options.robot = robot;
    options.out = out;
    options.mode = mode;
    auto log = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>());
    stage_ = services::factoryOf(service)({*theirs_, options, topics, log});
    stage_->start();
  }

  bus::Bus& bus() { return *mine_; }
  void spin() {
    while (stage_->spin()) {
    }
  }
  /// Nothing has come for a while.
  void lull() {
    do {
      spin();
    } while (stage_->background());
  }
  bool background() { return stage_->background(); }
  /// Told since the last call.
  std::vector<std::string> problems() { return stage_->status().takeProblems(); }
  bus::StatusBoard::Snapshot status() { return stage_->status().snapshot(bus::StatusBoard::Clock::now()); }

 private:
  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> theirs_, mine_;

 public:
  bus::Topics topics;

 private:
  std::unique_ptr<bus::Service> stage_;
};

}  // namespace omnifleet::test
