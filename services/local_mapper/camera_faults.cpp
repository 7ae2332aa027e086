#include "local_mapper/camera_faults.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace omnifleet::local_mapper {

FaultOptions FaultOptions::read(const options::Section& section) {
  FaultOptions o;
  section.read("frozen_m", o.frozen_m, {0.0, 100.0});
  section.read("frozen_rad", o.frozen_rad, {0.001, 100.0});
  section.read("occlusion_step", o.occlusion_step, {0.0, 10.0});
  section.finish();
  return o;
}

FreezeCheck::FreezeCheck(const ground::FloorView& view, const FaultOptions& options)
    : options_(options), rows_(view.rows()) {}

/// Of every other row of cells.
std::uint64_t FreezeCheck::fingerprintOf(const cv::Mat3f& means) const {
  // FNV-1a in four parts, so that one multiplication need not wait for another.
  constexpr std::uint64_t kPrime = 1099511628211U;
  std::uint64_t a = 14695981039346656037U, b = 1, c = 2, d = 3;
  for (std::size_t y = 0; y < rows_.size(); y += 2) {
    const cv::Vec3f* cell = means.ptr<cv::Vec3f>(static_cast<int>(y)) + rows_[y].start;
    for (int left = rows_[y].size(); left >= 8; left -= 8, cell += 8) {
      std::uint64_t words[12];
      std::memcpy(words, cell, sizeof words);
      for (std::size_t k = 0; k < 12; k += 4) {
        a = (a ^ words[k]) * kPrime;
        b = (b ^ words[k + 1]) * kPrime;
        c = (c ^ words[k + 2]) * kPrime;
        d = (d ^ words[k + 3]) * kPrime;
      }
    }
  }
  return (((a * kPrime ^ b) * kPrime ^ c) * kPrime ^ d) * kPrime;
}

bool FreezeCheck::isFrozen(const cv::Mat3f& means, const Motion& wheels) {
  if (options_.frozen_m <= 0.0) return false;
  const std::uint64_t fingerprint = fingerprintOf(means);
  if (fingerprint != fingerprint_) {
    fingerprint_ = fingerprint;
    rolled_m_ = turned_rad_ = 0.0;
    shows_objects_ = false;  // until setObjectCount()
    return false;
  }
  if (wheels.valid) {
    rolled_m_ += wheels.previous_from_current.translation().norm();
    turned_rad_ += std::abs(wheels.previous_from_current.theta_rad);
  }
  return shows_objects_ && (rolled_m_ > options_.frozen_m || turned_rad_ > options_.frozen_rad);
}

bool OcclusionCheck::differs(const cv::Vec3f& floor) const {
  return cv::norm(floor - floor_) > options_.occlusion_step * cv::norm(floor_);
}

FrameFault OcclusionCheck::faultOf(const FrameContent& content, const Motion& wheels) {
  if (options_.occlusion_step <= 0.0) return {};
  const bool is_hidden = content.horizon == HorizonState::kHidden;
  if (content.objects == 0 && objects_ > 0 && differs(content.floor))
    return {ErrorCode::kLensOccluded,
            "lens occluded: all objects vanished in the frame in which the floor's colour changed; clean the "
            "lens"};
  if (had_horizon_ && is_hidden && differs(content.floor))
    return {ErrorCode::kLensOccluded,
            "lens occluded: the horizon vanished in the frame in which the floor's colour changed; clean the "
            "lens"};
  objects_ = content.objects;
  floor_ = content.floor;
  had_horizon_ = content.horizon == HorizonState::kVisible;
  has_seen_ = has_seen_ || content.objects > 0 || content.walls;
  if (!has_seen_ && is_hidden)
    return {ErrorCode::kLensOccluded,
            "lens occluded: no object so far, and the image is the same above and below the horizon; clean "
            "the lens"};
  if (wheels.valid) bare_m_ += wheels.previous_from_current.translation().norm();
  if (has_seen_ || had_horizon_) bare_m_ = 0.0;
  return {};
}

HorizonState classifyHorizon(const ground::Horizon* horizon, const cv::Mat3f& cell_means) {
  // Minimum differences in brightness and in colour at equal brightness, as shares of the brightness:
  // occluders are lit unevenly.
  constexpr float kAlong = 0.15f, kAcross = 0.05f;
  constexpr int kOtherOf = 12;  // with at most one differing sector in this many, the horizon is hidden
  if (horizon == nullptr) return HorizonState::kOutOfView;
  int seen = 0, other = 0;
  for (int sector = 1; sector <= ground::Horizon::kSectors; ++sector) {
    const cv::Vec4f& colour = horizon->colours()[static_cast<std::size_t>(sector)];
    const std::vector<cv::Point>& edge = horizon->edge(sector);
    if (colour[0] < 0.0f || edge.empty()) continue;
    ++seen;
    cv::Vec3f below(0, 0, 0);
    for (const cv::Point& cell : edge) below += cell_means(cell) * (1.0f / static_cast<float>(edge.size()));
    const cv::Vec3f above(colour[0], colour[1], colour[2]);
    const float square = std::max(1.0f, above.dot(above)), gain = below.dot(above) / square;
    const float across2 = below.dot(below) / square - gain * gain;
    other += std::abs(gain - 1.0f) > kAlong || across2 > kAcross * kAcross ? 1 : 0;
  }
  if (4 * seen < ground::Horizon::kSectors) return HorizonState::kOutOfView;
  return kOtherOf * other <= seen ? HorizonState::kHidden : HorizonState::kVisible;
}

}  // namespace omnifleet::local_mapper
