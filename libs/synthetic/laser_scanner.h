#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Scans of an arena by one robot's laser, traced on Embree: all in the plane of the scanner's height, the robot
/// itself left out. Ranges have Gaussian noise; what lies beyond the scanner's reach gives no echo. Equal (arena,
/// robot, seed, frame) give equal scans, whatever was scanned before.
class LaserScanner {
 public:
  /// Throws options::Error for a robot or laser that is not there, std::runtime_error when Embree fails.
  LaserScanner(const Arena& arena, const std::string& robot, std::uint32_t seed);
  ~LaserScanner();
  LaserScanner(LaserScanner&&) noexcept;
  LaserScanner& operator=(LaserScanner&&) noexcept;

  /// The scan of a frame with the robots at these poses, one per robot of the arena in its order. Valid until the next
  /// call.
  const dataset::LaserRow& scan(int frame, const std::vector<Pose2>& map_from_bases);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::synthetic
