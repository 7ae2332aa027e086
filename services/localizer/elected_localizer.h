#pragma once

#include <map>
#include <memory>
#include <string>

#include "bus/service.h"
#include "common/office.h"
#include "fleet/fleet.h"
#include "localizer/service.h"

namespace omnifleet::services {

/// The localizer of one machine of a live fleet that runs on several machines: each has one, and one of them
/// estimates (office "estimator"). The others stand by and note the latest keyframe poses. When the
/// estimating one fails or cannot be reached, the next one continues from these poses and from the frames
/// that the classifiers keep. When two of them meet after the network was split, the one with the greater
/// term recovers the state of all robots and continues alone.
class ElectedLocalizer : public bus::Service {
 public:
  ElectedLocalizer(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  void start() override { status().state(bus::ServiceState::kWaiting); }
  bool spin() override;
  bool background() override { return estimator_ && estimator_->background(); }
  bool finished() const override { return estimator_ && estimator_->finished(); }
  void drain() override;
  bool succeeded() const override { return !estimator_ || estimator_->succeeded(); }
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override;
  bus::StatusBoard& status() override { return estimator_ ? estimator_->status() : Service::status(); }
  bus::IdleWindow& idleWindow() override {
    return estimator_ ? estimator_->idleWindow() : Service::idleWindow();
  }

 private:
  bool noteKeyframePoses();
  void begin();

  bus::ServiceContext context_;
  fleet::Fleet fleet_;
  Office office_;
  std::unique_ptr<bus::Reader<v1::KeyframePose>> keyframe_poses_;
  v1::KeyframePose sample_;
  LocalizerService::Takeover known_;
  std::unique_ptr<LocalizerService> estimator_;
};

}  // namespace omnifleet::services
