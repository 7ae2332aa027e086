#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/laser.h"
#include "observation/observation.h"

namespace omnifleet::laser {

enum class Echo : std::uint8_t {
  kBlind,  ///< unknown: the robot's own body, or no echo from a scanner with unknown maximum range
  kNone,   ///< free up to the range
  kHit,
};

struct Beam {
  double bearing_rad = 0.0;  ///< about the scanner, in the axes of base_link, increasing from beam to beam
  double range_m = 0.0;      ///< of kHit and kNone
  Echo echo = Echo::kBlind;
  Eigen::Vector2d point_m = Eigen::Vector2d::Zero();  ///< from the scanner, axes of base_link
};

/// One scan, counter-clockwise for either direction of rotation of the scanner.
struct Beams {
  std::vector<Beam> beam;
  double spacing_rad = 0.0;  ///< > 0
  bool closed = false;       ///< full turn: the last beam is a neighbour of the first one

  /// Converts `row`, which problemOf() must accept. Buffers are reused.
  void set(const dataset::LaserRow& row, const dataset::LaserSensor& sensor);
  std::size_t size() const { return beam.size(); }
  /// Beam i modulo the number of beams, for use across the seam of a closed scan.
  const Beam& at(std::size_t i) const { return beam[i % beam.size()]; }
};

}  // namespace omnifleet::laser
