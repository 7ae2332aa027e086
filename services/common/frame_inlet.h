#pragma once

#include <chrono>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "bus/service.h"
#include "common/run_ends.h"
#include "common/source_times.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// The frames of one camera as input of a stage: one loan at a time; reports torn frames and detects the end.
class FrameInlet {
 public:
  FrameInlet(const bus::ServiceContext& context, const fleet::CameraSpec& camera, RunEnds& ends);

  /// From now on the frames have the times of `times`, which must outlive this. Null: their own.
  void follow(SourceTimes* times) { times_ = times; }

  /// The next frame, on loan until release(). Empty while a loan is held or when no frame is available.
  /// Frames that are not later than the last one are counted as dropped and skipped.
  std::optional<bus::FrameView> take(bus::StatusBoard& status);
  /// Returns the loan. Returns false when the pixels were overwritten while in use.
  bool release(bus::StatusBoard& status);
  /// True when the camera has announced its end and all its frames were taken. In live mode the last frames
  /// may have been overwritten; frames that do not arrive within kGrace after the announcement are lost.
  bool ended() const;

  static constexpr std::chrono::milliseconds kGrace{500};

 private:
  std::string name_;
  std::unique_ptr<bus::FrameReader> reader_;
  SourceTimes* times_ = nullptr;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::optional<TimeNs> end_ns_;
  bool may_lose_;
  std::chrono::steady_clock::time_point last_event_{};  ///< time of the last frame or end announcement
};

/// The pixels without a copy: CV_8UC1 or CV_8UC3; empty when the frame has none.
cv::Mat asMat(const bus::FrameView& frame);

}  // namespace omnifleet::services
