#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/laser.h"
#include "observation/observation.h"

namespace omnifleet::laser {

enum class Echo : std::uint8_t {
  kBlind,  ///< nothing known: the robot's own body, or no echo from a scanner whose reach is not known
  kNone,   ///< free so far
  kHit,
};

struct Beam {
  double bearing_rad = 0.0;  ///< about the scanner, in the axes of base_link, growing from beam to beam
  double range_m = 0.0;      ///< of kHit and kNone
  Echo echo = Echo::kBlind;
  bool stands = true;                                 ///< what it hits is no robot that may drive
  Eigen::Vector2d point_m = Eigen::Vector2d::Zero();  ///< from the scanner, axes of base_link
};

/// One scan, counter-clockwise, whichever way the scanner turns.
struct Beams {
  std::vector<Beam> beam;
  double spacing_rad = 0.0;  ///< > 0
  bool closed = false;       ///< the last beam is the first one's neighbour

  /// `row` as problemOf() lets it pass; buffers are reused.
  void set(const dataset::LaserRow& row, const dataset::LaserSensor& sensor);
  std::size_t size() const { return beam.size(); }
  /// Beam of any index, across the seam where the scan is closed.
  const Beam& at(std::size_t i) const { return beam[i % beam.size()]; }
};

}  // namespace omnifleet::laser
