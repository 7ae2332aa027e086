#include "local_mapper/frame_check.h"

#include <algorithm>
#include <array>

namespace omnifleet::local_mapper {

namespace {

constexpr std::size_t kIntervals = 9, kFewestIntervals = 3;

/// Brightest channel.
int levelAt(const cv::Mat& image, const cv::Point& p) {
  const int channels = image.channels();
  const std::uint8_t* c = image.ptr<std::uint8_t>(p.y) + p.x * channels;
  return channels == 3 ? std::max({c[0], c[1], c[2]}) : c[0];
}

}  // namespace

FrameCheckOptions FrameCheckOptions::read(const options::Section& section) {
  FrameCheckOptions o;
  section.read("dark_level", o.dark_level, {0.0, 255.0});
  section.read("bright_level", o.bright_level, {1.0, 255.0});
  section.read("bright_fraction", o.bright_fraction, {0.01, 1.0});
  section.read("max_gap_s", o.max_gap_s, {0.0, 3600.0});
  section.read("max_gap_periods", o.max_gap_periods, {1.0, 1e6});
  section.read("max_sequence_step", o.max_sequence_step, {1, 1000000});
  section.finish();
  return o;
}

FrameCheck::FrameCheck(const lens::CameraModel& model, const cv::Mat1b& view,
                       const FrameCheckOptions& options)
    : size_(model.image_width_px, model.image_height_px), options_(options) {
  intervals_s_.reserve(kIntervals);
  constexpr int kStep_px = 16;  // a few thousand pixels are enough for the exposure
  for (int y = 0; y < size_.height; y += kStep_px)
    for (int x = 0; x < size_.width; x += kStep_px)
      if (view(y, x) != 0) samples_.emplace_back(x, y);
  if (model.kind == lens::CameraKind::kFisheye && model.projection == lens::Projection::kOrthographic)
    sampleBeyond(model);
}

void FrameCheck::sampleBeyond(const lens::CameraModel& model) {
  constexpr double kFrom = 1.03, kTo = 1.12;  // of F; pixels blurred over the edge of the image are left out
  constexpr int kStep_px = 3;
  for (int y = 0; y < size_.height; y += kStep_px) {
    for (int x = 0; x < size_.width; x += kStep_px) {
      const double r =
          (Eigen::Vector2d(x, y) - model.principal_point_px).cwiseQuotient(model.focal_px).norm();
      if (r > kFrom && r < kTo) beyond_.emplace_back(x, y);
    }
  }
}

void FrameCheck::resume(const FrameCheck& before) {
  has_previous_ = before.has_previous_;
  previous_ns_ = before.previous_ns_;
  lit_beyond_ = before.lit_beyond_;
  previous_sequence_ = before.previous_sequence_;
  intervals_s_.assign(before.intervals_s_.begin(), before.intervals_s_.end());
}

FrameState FrameCheck::check(const Frame& frame) {
  follows_ = false;
  constexpr TimeNs kDoubled_ns = 1000000;  // some cameras deliver one frame twice, with another time
  const bool in_order = !has_previous_ || frame.acquired_ns >= previous_ns_ + kDoubled_ns;
  FrameState state = frame.state;
  if (state == FrameState::kOk) {
    if (frame.image.empty())
      state = FrameState::kEmpty;
    else if (!fits(frame.image))
      state = FrameState::kWrongSize;
    else if (!in_order)
      state = FrameState::kOutOfOrder;
    else
      state = exposure(frame.image);
  }
  const double since_s = has_previous_ ? 1e-9 * static_cast<double>(frame.acquired_ns - previous_ns_) : 0.0;
  gap_s_ = since_s > options_.max_gap_s ? since_s : 0.0;
  if (state == FrameState::kOk && previous_usable_) {
    const std::uint32_t step = frame.sequence - previous_sequence_;
    follows_ = !isGap(since_s) && step >= 1 && step <= static_cast<std::uint32_t>(options_.max_sequence_step);
  }
  previous_usable_ = state == FrameState::kOk;
  if (in_order) {
    has_previous_ = true;
    previous_ns_ = frame.acquired_ns;
    previous_sequence_ = frame.sequence;
  }
  return state;
}

/// Rows that are missing in a recording leave no gap in the sequence numbers.
bool FrameCheck::isGap(double since_s) {
  bool gap = since_s > options_.max_gap_s;
  if (intervals_s_.size() >= kFewestIntervals) {
    std::array<double, kIntervals> sorted;
    const auto end = std::copy(intervals_s_.begin(), intervals_s_.end(), sorted.begin());
    const auto middle = sorted.begin() + (end - sorted.begin()) / 2;
    std::nth_element(sorted.begin(), middle, end);
    gap = gap || since_s > options_.max_gap_periods * *middle;
  }
  if (intervals_s_.size() == kIntervals) intervals_s_.erase(intervals_s_.begin());
  intervals_s_.push_back(since_s);
  return gap;
}

FrameState FrameCheck::exposure(const cv::Mat& image) {
  std::array<int, 256> histogram{};
  for (const auto& p : samples_) ++histogram[static_cast<std::size_t>(levelAt(image, p))];
  const int half = static_cast<int>(samples_.size()) / 2;
  int below = 0, median = 0;
  while (median < 255 && (below += histogram[static_cast<std::size_t>(median)]) <= half) ++median;
  if (median < options_.dark_level) return FrameState::kDark;
  int bright = 0;
  for (int level = static_cast<int>(options_.bright_level); level < 256; ++level)
    bright += histogram[static_cast<std::size_t>(level)];
  if (bright > options_.bright_fraction * static_cast<double>(samples_.size()))
    return FrameState::kOverexposed;
  if (!beyond_.empty()) {
    const auto isLit = [&](const cv::Point& p) {
      return levelAt(image, p) >= std::max(options_.dark_level, 0.5 * median);
    };
    const auto lit = std::count_if(beyond_.begin(), beyond_.end(), isLit);
    lit_beyond_ = static_cast<double>(lit) / static_cast<double>(beyond_.size());
    beyond_.clear();
  }
  return FrameState::kOk;
}

}  // namespace omnifleet::local_mapper
