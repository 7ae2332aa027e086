#pragma once

#include <memory>
#include <optional>

#include "bus/service.h"
#include "camera/preview.h"
#include "common/fault_runs.h"
#include "common/host_clock.h"
#include "common/run_ends.h"
#include "common/side_output.h"
#include "dataset/live_camera.h"
#include "dataset/writer.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Options of camera devices: `services: {camera: …}`.
struct CameraOptions {
  dataset::LiveCameraOptions device;
  double clock_jump_s =
      0.05;  ///< s, a system clock that was set by more than this is reported and corrected for

  static CameraOptions read(const options::Section& section);
  TimeNs clockJump_ns() const { return static_cast<TimeNs>(1e9 * clock_jump_s); }
};

/// Publishes the frames of a camera device until the run is stopped: a device that is absent or fails is
/// reported (camera_lost) and opened again. Frames have the time of their arrival by the shared clock of the
/// run (SharedClock).
class DeviceCameraService : public bus::Service {
 public:
  DeviceCameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet);
  /// With another device and other clocks, for tests. `read` must be thread-safe.
  DeviceCameraService(const bus::ServiceContext& context, const fleet::Fleet& fleet,
                      std::unique_ptr<dataset::CaptureDevice> device, ReadClocks read);

  std::vector<bus::Expectation> expectations() const override;
  void start() override { status().state(bus::ServiceState::kRunning); }
  bool spin() override;
  bool finished() const override { return false; }
  void drain() override;
  std::optional<std::chrono::steady_clock::time_point> wakeAt() const override { return wake_at_; }

 private:
  using Clock = std::chrono::steady_clock;

  void checkDevice();
  void checkSize(const dataset::FrameInfo& info);
  bool publish();

  bus::ServiceContext context_;
  fleet::CameraSpec camera_;
  CameraOptions options_;
  SharedClock clock_;
  ClockWatch clock_watch_;
  std::unique_ptr<bus::FrameWriter> writer_;
  FaultRuns faults_;
  SideOutput<dataset::ImageStreamWriter> recorder_;
  Preview preview_;
  RunEnds ends_;
  dataset::LiveFrame frame_;
  bool is_pending_ = false;  ///< frame_ waits for room
  bus::FrameHeader header_;
  std::optional<Clock::time_point> lost_since_;
  std::optional<Clock::time_point> back_since_;  ///< the status still says how long the camera was lost
  int wrong_sizes_ = 0;                          ///< consecutive frames
  TimeNs last_ns_ = RunEnds::kNothing;
  std::uint64_t samples_ = 0;
  std::optional<Clock::time_point> wake_at_;
  dataset::LiveCamera device_;  ///< last: its thread uses the bus and the clock
};

}  // namespace omnifleet::services
