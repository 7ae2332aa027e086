#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "dataset/capture.h"
#include "options/options.h"

namespace omnifleet::dataset {

struct LiveCameraOptions {
  double retry_first_s = 0.1;    ///< s, pause after the first failed attempt to open the device; it doubles
  double retry_longest_s = 2.0;  ///< s, longest pause between two attempts
  double read_timeout_s = 5.0;   ///< s, a read without result for this long counts as a lost camera

  static LiveCameraOptions read(const options::Section& section);
};

/// A frame as the device delivered it.
struct LiveFrame {
  cv::Mat image;
  TimeNs time_ns = 0;          ///< when the frame arrived, by the clock of the camera
  std::uint32_t sequence = 0;  ///< counts the frames of all connections
};

/// Captures the frames of a device in a thread until it is destroyed. A device that fails is closed and
/// opened again, wherever it is then. The newest frame is kept; older ones that were not taken are dropped.
class LiveCamera {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param clock time stamp of a frame, called in the thread of the camera when the frame has arrived
  /// @param wake called in that thread after every frame and every change of loss()
  LiveCamera(std::unique_ptr<CaptureDevice> device, LiveCameraOptions options, std::function<TimeNs()> clock,
             std::function<void()> wake);
  /// Takes at most kStopLimit, even while a read of the device does not return.
  ~LiveCamera();
  LiveCamera(const LiveCamera&) = delete;
  LiveCamera& operator=(const LiveCamera&) = delete;

  /// The newest frame, if it was not taken yet. Exchanges the images, so that their memory is reused.
  bool take(LiveFrame& frame);

  struct Loss {
    Clock::time_point since;  ///< the last frame, or the construction
    std::string reason;
  };
  /// The device delivers no frames now; empty: it delivers. Also gives up a read that does not return. Call
  /// at least once per second.
  std::optional<Loss> loss(Clock::time_point now);

  /// Closes the device and opens it again after the longest pause: its frames are of no use.
  void reopen();

  static constexpr std::chrono::milliseconds kStopLimit{500};

 private:
  struct State;
  void startThread();

  std::shared_ptr<State> state_;  ///< shared with threads that may never return from the driver
};

}  // namespace omnifleet::dataset
