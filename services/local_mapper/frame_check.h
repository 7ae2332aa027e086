#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

/// One camera frame as it reaches the stage.
struct Frame {
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;  ///< as reported by the camera stage
  cv::Mat image;                       ///< BGR8 (CV_8UC3) or grey (CV_8UC1)
};

struct FrameCheckOptions {
  double dark_level =
      12.0;  ///< grey level 0–255: a frame is dark (lens occluded) if the median in the view is below this
  double bright_level = 250.0;   ///< grey level 0–255: a pixel at or above is saturated
  double bright_fraction = 0.6;  ///< 0–1: share of saturated pixels from which a frame is overexposed
  double max_gap_s = 1.0;        ///< seconds between frames, beyond which no vectors are computed
  double max_gap_periods = 2.5;  ///< the same limit as a multiple of the median of the last intervals (≥ 1)
  int max_sequence_step = 1;     ///< frames: a larger step of the sequence number is a gap (≥ 1)
  static FrameCheckOptions read(const options::Section& section);
};

/// Checks whether a frame can be used and whether it follows its predecessor without a gap.
class FrameCheck {
 public:
  /// `view`: 255 where pixels show the world, of the camera's size; the exposure is judged there.
  FrameCheck(const lens::CameraModel& model, const cv::Mat1b& view, const FrameCheckOptions& options);

  /// kOk, the state the frame came with, or what is detected here: kEmpty, kWrongSize (other size or pixel
  /// type than the calibration), kOutOfOrder (less than a millisecond after the last accepted frame), kDark,
  /// kOverexposed.
  FrameState check(const Frame& frame);

  /// True when the frame just checked directly follows a usable one. Vectors are computed only then.
  bool follows() const { return follows_; }
  /// Seconds without a frame before the frame just checked, if more than `max_gap_s`; else 0.
  double gap_s() const { return gap_s_; }
  /// Has the image the camera's size and a supported type?
  bool fits(const cv::Mat& image) const {
    return image.size() == size_ && (image.type() == CV_8UC3 || image.type() == CV_8UC1);
  }
  /// Share of the pixels just beyond r = F that are lit in the first usable frame, 0–1. An orthographic lens
  /// has no image there (Choi et al. 2014, eq. 7), so a lens that shows one has another projection. 0 for
  /// other lenses.
  double litBeyondLens() const { return lit_beyond_; }
  /// Continues where another check of the same camera ended, with a gap.
  void resume(const FrameCheck& before);

 private:
  bool isGap(double since_s);
  FrameState exposure(const cv::Mat& image);
  void sampleBeyond(const lens::CameraModel& model);

  cv::Size size_;
  FrameCheckOptions options_;
  std::vector<cv::Point> samples_;
  std::vector<cv::Point> beyond_;  ///< pixels beyond the lens's image; empty once they were tested
  double lit_beyond_ = 0.0;
  bool has_previous_ = false, previous_usable_ = false, follows_ = false;
  TimeNs previous_ns_ = 0;
  double gap_s_ = 0.0;
  std::uint32_t previous_sequence_ = 0;
  std::vector<double> intervals_s_;  ///< the last ones, oldest first
};

}  // namespace omnifleet::local_mapper
