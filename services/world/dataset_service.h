#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Plays what a recording holds beside images: wheel speeds, laser scans, ranges and bearings. Nothing is
/// lost: writers wait for their readers. One thread plays all streams, always the earliest row next: a reader
/// that needs several streams up to some time gets them, so none can wait for another.
class DatasetWorldService : public bus::Service {
 public:
  DatasetWorldService(const bus::ServiceContext& context, const fleet::Fleet& fleet);
  ~DatasetWorldService() override;

  std::vector<bus::Expectation> expectations() const override;
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { finish(ended_ ? "" : "stopped"); }

 private:
  class Stream;
  class WheelStream;
  class LaserStream;
  class ObservationStream;
  Stream* earliest();
  void finish(const std::string& reason);
  void tellWarnings(const std::vector<std::string>& warnings);

  bus::ServiceContext context_;
  RunEnds ends_;
  std::vector<std::unique_ptr<Stream>> streams_;
  bool ended_ = false;
};

}  // namespace omnifleet::services
