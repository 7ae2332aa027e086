#pragma once

#include <optional>
#include <variant>

#include "bus/service.h"
#include "common/fault_runs.h"
#include "common/inlet.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"
#include "laser/laser_mapper.h"
#include "local_mapper/wheel_check.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::services {

/// A scan as it reaches a stage.
struct LaserInput {
  dataset::LaserRow row;
  std::uint32_t sequence = 0;
};

/// The local mapper of a robot without a fisheye camera: laser scans and wheel speeds in, one local map per
/// scan out.
class LaserMapperService : public bus::Service {
 public:
  LaserMapperService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                     ReadClocks read = readHostClocks);

  std::vector<bus::Expectation> expectations() const override { return {out_.expectation()}; }
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { out_.end(ends_, ended_ ? "" : "stopped"); }
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  using Payload = std::variant<std::monostate, LaserInput, dataset::WheelRow>;

  bool pull();
  void process();

  bus::ServiceContext context_;
  std::string robot_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  LiveTimes live_times_;
  adapters::RunClock clock_;
  Inlet<v1::LaserScan, Payload> scans_;
  std::optional<Inlet<v1::WheelOdometry, Payload>> wheels_;
  Outlet<v1::LocalMap> out_;
  motion::WheelIntegrator integrator_;
  local_mapper::WheelCheck wheel_check_;
  laser::LaserMapper mapper_;
  LocalMap local_map_;
  v1::LocalMap sample_;
  FaultRuns faults_;
  bool ended_ = false;
};

/// Options of `services: {local_mapper: {laser: …}}`.
laser::Options laserOptions(const fleet::Fleet& fleet);
/// Messages about a scan, given the scans before it. @param map of the scan @param fault LaserMapper::fault()
std::vector<Message> scanFaults(FaultRuns& runs, const std::string& robot, const LocalMap& map,
                                const char* fault);

Validity takeScan(const v1::LaserScan& wire, LaserInput& scan);
/// Wheel integrator of a robot, as its local mapper uses it.
motion::WheelIntegrator makeIntegrator(const fleet::Fleet& fleet, const fleet::RobotSpec& robot);
/// The check of a robot's wheels: `services: {local_mapper: {wheels_missing_s}}` in live mode, where the
/// robot base may start later than the camera.
local_mapper::WheelCheck makeWheelCheck(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                                        const std::string& robot);
/// Option wheels_missing_s, s.
double wheelsMissing_s(const options::Section& section);

}  // namespace omnifleet::services
