#pragma once

#include <memory>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Plays what a recording holds beside images: wheel speeds. Nothing is lost: writers wait for their readers.
class DatasetWorldService : public bus::Service {
 public:
  DatasetWorldService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override;
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { finish(ended_ ? "" : "stopped"); }

 private:
  struct WheelStream {
    std::string robot;
    std::vector<dataset::WheelRow> rows;
    std::size_t next = 0;
    Outlet<v1::WheelOdometry> out;
  };
  WheelStream* earliest();
  void finish(const std::string& reason);

  bus::ServiceContext context_;
  RunEnds ends_;
  std::vector<std::unique_ptr<WheelStream>> streams_;
  v1::WheelOdometry sample_;
  bool ended_ = false;
};

}  // namespace omnifleet::services
