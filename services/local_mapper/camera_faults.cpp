#include "local_mapper/camera_faults.h"

#include <cmath>
#include <cstring>

namespace omnifleet::local_mapper {

FaultOptions FaultOptions::read(const options::Section& section) {
  FaultOptions o;
  section.read("frozen_m", o.frozen_m, {0.0, 100.0});
  section.read("frozen_rad", o.frozen_rad, {0.001, 100.0});
  section.read("cover_step", o.cover_step, {0.0, 10.0});
  section.finish();
  return o;
}

FreezeCheck::FreezeCheck(const ground::FloorView& view, const FaultOptions& options)
    : options_(options), rows_(view.rows()) {}

/// Of every other row of cells.
std::uint64_t FreezeCheck::fingerprintOf(const cv::Mat3f& means) const {
  // FNV-1a, in four parts: one multiplication need not wait for the other.
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
  const bool covered = objects == 0 && objects_ > 0 && differs(floor);
  if (!covered) {
    objects_ = objects;
    floor_ = floor;
  }
  return covered;
}

}  // namespace omnifleet::local_mapper
