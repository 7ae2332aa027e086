#pragma once

#include <spdlog/logger.h>
#include <spdlog/sinks/null_sink.h>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "fleet_in_process/in_process.h"

namespace omnifleet::test {

/// A bare floor and the surroundings above its horizon in the centre of an image, BGR8, for an equidistant
/// lens with f = 111.494 px.
inline void drawBareFloor(std::uint8_t* pixels, int width, int height) {
  constexpr double kHorizon_px = 111.494 * 0.5 * M_PI;
  constexpr std::uint8_t kFloor = 120, kAbove = 60;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const double r = std::hypot(u - 0.5 * (width - 1), v - 0.5 * (height - 1));
      std::memset(pixels + 3 * (v * width + u), r < kHorizon_px ? kFloor : kAbove, 3);
    }
  }
}

/// One stage of config/fleets/small.yaml (or of another fleet file) on the fake bus. The test plays its
/// neighbours.
class StageBench {
 public:
  explicit StageBench(const std::string& service, const std::string& robot, const std::string& out = {},
                      const std::string& fleet = {}, bus::RunMode mode = bus::RunMode::kLockstep,
                      int incarnation = 1)
      : network_(bus::makeFakeNetwork()),
        stage_bus_(bus::makeFakeBus(network_, {})),
        test_bus_(bus::makeFakeBus(network_, {})),
        topics(mode) {
    bus::ServiceOptions options;
    options.fleet = fleet;
    if (fleet.empty())
      options.fleet = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
    options.robot = robot;
    options.out = out;
    options.mode = mode;
    options.incarnation = incarnation;
    auto log = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>());
    stage_ = services::factoryOf(service)({*stage_bus_, options, topics, log});
    stage_->start();
  }

  bus::Bus& bus() { return *test_bus_; }
  void spin() {
    while (stage_->spin()) {
    }
  }
  /// Lets the stage work as in an idle window.
  void idle() {
    do {
      spin();
    } while (stage_->background());
  }
  /// The run has ended or was stopped.
  void drain() { stage_->drain(); }
  auto wakeAt() { return stage_->wakeAt(); }
  bool background() { return stage_->background(); }
  bool succeeded() const { return stage_->succeeded(); }
  /// Messages since the last call.
  std::vector<Message> messages() { return stage_->status().takeMessages(); }
  bus::StatusBoard::Snapshot status() { return stage_->status().snapshot(bus::StatusBoard::Clock::now()); }

 private:
  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> stage_bus_, test_bus_;

 public:
  bus::Topics topics;

 private:
  std::unique_ptr<bus::Service> stage_;
};

}  // namespace omnifleet::test
