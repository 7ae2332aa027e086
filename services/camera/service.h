#pragma once

#include <memory>
#include <optional>

#include "bus/service.h"
#include "camera/preview.h"
#include "common/fault_runs.h"
#include "common/run_ends.h"
#include "common/side_output.h"
#include "dataset/frame_source.h"
#include "dataset/writer.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Publishes the frames of one camera from a dataset, a folder or a video. Frames are decoded
/// directly into the loan. A frame that cannot be read is published as invalid. Recorded sources run as fast
/// as their readers in replay mode, and at the recorded pace in live mode.
class CameraService : public bus::Service {
 public:
  CameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet);

  std::vector<bus::Expectation> expectations() const override;
  void start() override;
  bool spin() override;
  bool finished() const override { return ended_; }
  void drain() override;
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override { return wake_at_; }

 private:
  bool decode();
  bool due();
  void publish();
  void finish();

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  bool paced_;
  std::unique_ptr<dataset::FrameSource> source_;
  std::unique_ptr<bus::FrameWriter> writer_;
  FaultRuns faults_;
  SideOutput<dataset::ImageStreamWriter> recorder_;
  Preview preview_;
  RunEnds ends_;
  bus::FrameHeader header_;
  bool decoded_ = false;  ///< the open loan holds a frame
  bool ended_ = false;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::uint64_t samples_ = 0;
  std::uint64_t rejected_ = 0;  ///< of samples_
  TimeNs first_frame_ns_ = 0;
  std::chrono::steady_clock::time_point first_sent_{};
  std::optional<std::chrono::steady_clock::time_point> wake_at_;
};

std::unique_ptr<bus::Service> makeCamera(const bus::ServiceContext& context);

}  // namespace omnifleet::services
