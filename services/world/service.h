#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "common/side_output.h"
#include "dataset/trajectory_files.h"
#include "dataset/writer.h"
#include "fleet/fleet.h"
#include "synthetic/laser_scanner.h"
#include "world/drivers.h"
#include "world/world.h"

namespace omnifleet::services {

/// The simulated arena. Input: wheel commands. Output: true poses (for its cameras), laser scans and wheel
/// odometry. In lockstep mode a step is taken when every robot has answered the previous frame. In live mode
/// steps follow the clock and use the latest commands; a robot without a command for `command_hold_s` stops,
/// as real bases do. Without a formation each robot drives by its tour, waypoints or speeds. Writes the truth
/// to OUT/recording when the run ends.
class ArenaWorldService : public bus::Service {
 public:
  ArenaWorldService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override;
  void start() override;
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override;
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override { return wake_at_; }
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return ended_ ? std::nullopt : merger_.waitingFor(now);
  }

 private:
  struct Command {
    std::size_t robot = 0;
    motion::WheelSpeeds speeds;
  };
  struct Laser {
    Outlet<v1::LaserScan> out;
    SideOutput<dataset::LaserWriter> recorder;
    synthetic::LaserScanner scanner;
  };
  struct RobotOutputs {
    Outlet<v1::Truth> truth;
    Outlet<v1::WheelOdometry> wheels;
    SideOutput<dataset::WheelsWriter> recorder;
    std::vector<dataset::StampedPose> path;
    std::unique_ptr<Laser> laser;  ///< if the arena has a laser
  };

  std::unique_ptr<Laser> makeLaser(const std::string& robot);
  bool pull();
  bool answered();
  void takeCommands();
  const std::vector<motion::WheelSpeeds>& heldCommands();
  void publishFrame();
  void publishTruth(const world::World::State& state);
  void publishScans(const world::World::State& state);
  void publishWheels(const world::World::Driven& driven);
  bool atRest();
  void finish(const std::string& reason);
  void saveTruth();

  bus::ServiceContext context_;
  fleet::Fleet fleet_;
  bool realtime_;
  world::World::Options options_;
  world::World world_;
  bus::TimeMerger<Command> merger_;
  bus::TimeMerger<Command>::Batch batch_;
  RunEnds ends_;
  std::vector<std::unique_ptr<Inlet<v1::WheelCommand, Command>>> inlets_;
  std::map<std::string, std::size_t> robots_;
  std::vector<RobotOutputs> outputs_;
  std::vector<motion::WheelSpeeds> commands_, held_;
  std::optional<world::Drivers> drivers_;  ///< if the fleet has no formation
  std::vector<TimeNs> commanded_ns_;
  int resting_frames_ = 0;
  std::uint32_t wheel_rows_ = 0;
  bool moved_ = false, last_published_ = false, ended_ = false, saved_ = false;
  std::optional<std::chrono::steady_clock::time_point> wake_at_;
};

/// The service of the arena, or of a recording.
std::unique_ptr<bus::Service> makeWorld(const bus::ServiceContext& context);

}  // namespace omnifleet::services
