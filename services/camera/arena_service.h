#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "bus/service.h"
#include "camera/preview.h"
#include "common/inlet.h"
#include "common/side_output.h"
#include "dataset/writer.h"
#include "fleet/fleet.h"
#include "synthetic/renderer.h"

namespace omnifleet::services {

/// A camera of the simulated arena: renders a frame from the true poses at one time. Besides `evaluate` and
/// the world itself, the only component that uses the truth.
class ArenaCameraService : public bus::Service {
 public:
  ArenaCameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override;
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override { finish(ended_ ? "" : "stopped"); }
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override { return wake_at_; }

 private:
  struct TruePose {
    std::size_t robot = 0;
    std::uint32_t frame = 0;
    Pose2 map_from_base;
  };

  bool pull();
  void setPoses();
  bool render();
  void finish(const std::string& reason);

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  bool realtime_;
  std::map<std::string, std::size_t> robots_;  ///< index in the arena
  bus::TimeMerger<TruePose> merger_;
  bus::TimeMerger<TruePose>::Batch batch_;
  RunEnds ends_;
  std::vector<std::unique_ptr<Inlet<v1::Truth, TruePose>>> truths_;
  std::unique_ptr<bus::FrameWriter> writer_;
  SideOutput<dataset::ImageStreamWriter> recorder_;
  Preview preview_;
  synthetic::Renderer renderer_;
  std::vector<Pose2> map_from_bases_;
  bus::FrameHeader header_;
  bool pending_ = false;  ///< the poses are set, but the frame is not published yet
  bool ended_ = false;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::uint64_t samples_ = 0;
  std::optional<std::chrono::steady_clock::time_point> wake_at_;
};

}  // namespace omnifleet::services
