#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

/// One camera frame as it reaches the stage.
struct Frame {
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;  ///< as the camera stage reported it
  cv::Mat image;                       ///< BGR8 (CV_8UC3) or grey (CV_8UC1)
};

struct FrameCheckOptions {
  double dark_level = 12.0;      ///< grey level 0–255: a median below this in the seen area is "covered"
  double bright_level = 250.0;   ///< grey level 0–255: a pixel at or above is saturated
  double bright_fraction = 0.6;  ///< 0–1: share of saturated pixels that makes a frame "overexposed"
  double max_gap_s = 1.0;        ///< seconds between frames beyond which no vectors are made, …
  double max_gap_periods = 2.5;  ///< … and in times the median of the last intervals (≥ 1)
  int max_sequence_step = 1;     ///< frames: a larger step of the sequence number is a gap (≥ 1)
  static FrameCheckOptions read(const options::Section& section);
};

/// Says whether a frame can be used and whether it follows its predecessor without a gap.
class FrameCheck {
 public:
  FrameCheck(const lens::CameraModel& model, const ground::FloorView& view, const FrameCheckOptions& options);

  /// kOk, the state the frame came with, or what is found here: kEmpty, kWrongSize (other size or pixel type
  /// than the calibration), kOutOfOrder (not a millisecond later than the last accepted frame), kDark,
  /// kOverexposed.
  FrameState check(const Frame& frame);

  /// True when the frame just checked directly follows a usable one: only then are there vectors.
  bool follows() const { return follows_; }
  /// Seconds for which nothing came before the frame just checked, where they are more than `max_gap_s`;
  /// else 0.
  double gap_s() const { return gap_s_; }
  /// Of the camera's size and a type that is read here.
  bool fits(const cv::Mat& image) const {
    return image.size() == size_ && (image.type() == CV_8UC3 || image.type() == CV_8UC1);
  }
  /// Share of the pixels just beyond r = F that show something in the first usable frame, 0–1: an
  /// orthographic lens has no image there (Choi et al. 2014, eq. 7), whatever shows one has another
  /// projection. 0 for other lenses.
  double litBeyondLens() const { return lit_beyond_; }
  /// Goes on where another check of the same camera was, with a gap.
  void resume(const FrameCheck& before);

 private:
  bool isGap(double since_s);
  FrameState exposure(const cv::Mat& image);
  void sampleBeyond(const lens::CameraModel& model);

  cv::Size size_;
  FrameCheckOptions options_;
  std::vector<cv::Point> samples_;
  std::vector<cv::Point> beyond_;  ///< of the lens's image, until they were looked at
  double lit_beyond_ = 0.0;
  bool has_previous_ = false, previous_usable_ = false, follows_ = false;
  TimeNs previous_ns_ = 0;
  double gap_s_ = 0.0;
  std::uint32_t previous_sequence_ = 0;
  std::vector<double> intervals_s_;  ///< the last ones, oldest first
};

}  // namespace omnifleet::local_mapper
