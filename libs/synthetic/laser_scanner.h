#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Scans of an arena by the laser of one robot, traced with Embree. All beams lie in the plane at the height
/// of the scanner; the robot itself is excluded. Ranges have Gaussian noise. Objects beyond the range of the
/// scanner give no echo. Equal arena, robot, seed and frame number give equal scans, independent of earlier
/// scans.
class LaserScanner {
 public:
  /// Throws options::Error if the robot or the laser does not exist, std::runtime_error when Embree fails.
  LaserScanner(const Arena& arena, const std::string& robot, std::uint32_t seed);
  ~LaserScanner();
  LaserScanner(LaserScanner&&) noexcept;
  LaserScanner& operator=(LaserScanner&&) noexcept;

  /// Scan of a frame with the robots at these poses, one per robot of the arena in its order. Valid until the
  /// next call.
  const dataset::LaserRow& scan(int frame, const std::vector<Pose2>& map_from_bases);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::synthetic
