#include "local_mapper/camera_faults.h"

#include <cmath>

namespace omnifleet::local_mapper {

FaultOptions FaultOptions::read(const options::Section& section) {
  FaultOptions o;
  section.read("frozen_m", o.frozen_m, {0.0, 100.0});
  section.read("frozen_rad", o.frozen_rad, {0.001, 100.0});
  section.read("cover_step", o.cover_step, {0.0, 10.0});
  section.finish();
  return o;
}

FreezeCheck::FreezeCheck(const ground::FloorView& view, const FaultOptions& options) : options_(options) {
  constexpr int kStep_px = 8;
  for (int y = kStep_px / 2; y < view.imageSize().height; y += kStep_px)
    for (int x = kStep_px / 2; x < view.imageSize().width; x += kStep_px)
      if (view.mask()(y, x) != 0) samples_.emplace_back(x, y);
}

std::uint64_t FreezeCheck::fingerprintOf(const cv::Mat& image) const {
  std::uint64_t hash = 14695981039346656037U;  // FNV-1a
  const int channels = image.channels();
  for (const cv::Point& p : samples_) {
    const std::uint8_t* pixel = image.ptr<std::uint8_t>(p.y) + p.x * channels;
    std::uint64_t value = 0;
    for (int c = 0; c < channels; ++c) value = value << 8 | pixel[c];
    hash = (hash ^ value) * 1099511628211U;
  }
  return hash;
}

bool FreezeCheck::isFrozen(const cv::Mat& image, const Motion& wheels) {
  if (options_.frozen_m <= 0.0) return false;
  const std::uint64_t fingerprint = fingerprintOf(image);
  if (fingerprint != fingerprint_) {
    fingerprint_ = fingerprint;
    rolled_m_ = turned_rad_ = 0.0;
    shows_things_ = false;  // until saw()
    return false;
  }
  if (wheels.valid) {
    rolled_m_ += wheels.previous_from_current.translation().norm();
    turned_rad_ += std::abs(wheels.previous_from_current.theta_rad);
  }
  return shows_things_ && (rolled_m_ > options_.frozen_m || turned_rad_ > options_.frozen_rad);
}

bool CoverCheck::differs(const cv::Vec3f& floor) const {
  return cv::norm(floor - floor_) > options_.cover_step * cv::norm(floor_);
}

bool CoverCheck::isCovered(std::size_t objects, const cv::Vec3f& floor) {
  if (options_.cover_step <= 0.0) return false;
  covered_ = objects == 0 && (covered_ || objects_ > 0) && differs(floor);
  if (!covered_) {
    objects_ = objects;
    floor_ = floor;
  }
  return covered_;
}

}  // namespace omnifleet::local_mapper
