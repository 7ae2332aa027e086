#pragma once

#include <optional>
#include <variant>

#include "bus/service.h"
#include "common/fault_runs.h"
#include "common/frame_inlet.h"
#include "common/inlet.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"
#include "local_mapper/front_mapper.h"
#include "local_mapper/wheel_check.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::services {

/// The local mapper of a robot with a forward camera and without a fisheye camera: frames and wheel speeds
/// in, one local map per frame out.
class FrontMapperService : public bus::Service {
 public:
  /// `debug_images`: write the two pictures of Ahmed's Fig. 1c and 1d of every frame to OUT/debug/<robot>.
  FrontMapperService(const bus::ServiceContext& context, const fleet::Fleet& fleet, bool debug_images);

  std::vector<bus::Expectation> expectations() const override { return {out_.expectation()}; }
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { out_.end(ends_, ended_ ? "" : "stopped"); }
  std::optional<bus::Waiting> waitingFor(std::chrono::steady_clock::time_point now) override {
    return merger_.waitingFor(now);
  }

 private:
  using Payload = std::variant<std::monostate, bus::FrameView, dataset::WheelRow>;

  bool pull();
  void process(const bus::FrameView& view);
  void reportFault();

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  bus::TimeMerger<Payload> merger_;
  bus::TimeMerger<Payload>::Batch batch_;
  RunEnds ends_;
  FrameInlet frames_;
  int frame_stream_;
  LiveTimes live_times_;
  adapters::RunClock clock_;
  std::optional<Inlet<v1::WheelOdometry, Payload>> wheels_;
  Outlet<v1::LocalMap> out_;
  motion::WheelIntegrator integrator_;
  local_mapper::WheelCheck wheel_check_;
  local_mapper::FrontMapper mapper_;
  std::string debug_folder_;  ///< empty: no debug images
  LocalMap local_map_;
  v1::LocalMap sample_;
  FaultRuns faults_;
  bool ended_ = false;
};

/// Options of the forward camera's mapper: `services: {local_mapper: …}`. Marks the keys of the other mappers
/// as known.
local_mapper::FrontMapper::Options frontOptions(const fleet::Fleet& fleet);

}  // namespace omnifleet::services
