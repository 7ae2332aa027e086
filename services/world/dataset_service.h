#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bus/service.h"
#include "common/inlet.h"
#include "dataset/dataset.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Replays the data of a recording except images: wheel speeds, laser scans, range-bearing observations. No
/// sample is lost: writers wait for their readers. One thread replays all streams and always writes the
/// earliest row. A reader that needs several streams up to a time receives all of them, which prevents
/// deadlock.
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
  void reportWarnings(const std::vector<std::string>& warnings);

  bus::ServiceContext context_;
  RunEnds ends_;
  std::vector<std::unique_ptr<Stream>> streams_;
  bool ended_ = false;
};

}  // namespace omnifleet::services
