#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "bus/service.h"
#include "common/frame_inlet.h"
#include "common/inlet.h"
#include "fleet/fleet.h"
#include "localizer/ceiling_front_end.h"

namespace omnifleet::services {

/// The front end of one ceiling camera: frames in, one sample of absolute pose measurements per frame out.
class CeilingService : public bus::Service {
 public:
  CeilingService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override { return {out_.expectation()}; }
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { out_.end(ends_, ended_ ? "" : "stopped"); }

 private:
  void process(const bus::FrameView& frame);
  void reportConflicts();

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  RunEnds ends_;
  FrameInlet frames_;
  LiveTimes live_times_;
  adapters::RunClock clock_;
  Outlet<v1::Measurement> out_;
  localizer::CeilingFrontEnd front_end_;
  std::vector<Measurement> found_;
  std::set<std::string> ambiguous_;  ///< robots with two markers in the last image
  v1::Measurement sample_;
  bool ended_ = false;
};

}  // namespace omnifleet::services
