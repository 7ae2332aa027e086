#pragma once

#include <chrono>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "bus/service.h"
#include "common/run_ends.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// The frames of one camera as a stage reads them: one loan at a time, torn frames told, the end heard.
class FrameInlet {
 public:
  FrameInlet(const bus::ServiceContext& context, const fleet::CameraSpec& camera, RunEnds& ends);

  /// The next frame, on loan until release(); nothing while one is held or none is there. Frames that do not
  /// come later than the last one are counted and left out.
  std::optional<bus::FrameView> take(bus::StatusBoard& status);
  /// Gives the loan back. False: the pixels were overwritten while they were used.
  bool release(bus::StatusBoard& status);
  /// The camera has said its last word and everything was taken. Live, the last frames may have been
  /// overwritten before they could be: what has not come within kGrace after that word is lost.
  bool ended() const;

  static constexpr std::chrono::milliseconds kGrace{500};

 private:
  std::string name_;
  std::unique_ptr<bus::FrameReader> reader_;
  TimeNs last_ns_ = RunEnds::kNothing;
  std::optional<TimeNs> end_ns_;
  bool may_lose_;
  std::chrono::steady_clock::time_point last_heard_{};  ///< of the camera: a frame or its end
};

/// The pixels without a copy: CV_8UC1 or CV_8UC3; empty where there are none.
cv::Mat asMat(const bus::FrameView& frame);

}  // namespace omnifleet::services
