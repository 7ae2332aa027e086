#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "options/options.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::scan {

struct EdgeParallaxOptions {
  double baseline_m = 0.3;  ///< m, between two scans that are compared: edges at 3 m are known to 1–2 cm
  double most_baseline_m = 1.0;  ///< m; a scan that met no other after so much is replaced
  double motion_share = 0.03;    ///< 1, σ of the length of the motion, also of all motions together (wheels)
  double motion_radpm = 0.1;     ///< rad/m, σ of its turn
  double step_m = 0.01;          ///< m, σ of a match besides its own: errors that all beams share
  double memory = 20.0;          ///< number of comparisons over which they are averaged
  static EdgeParallaxOptions read(const options::Section& section);
};

/// Measures at which height edges are that a scan shows as if they were on the floor. An edge at height h
/// appears farther away by H/(H − h), in every direction; H is the height of the camera. So when the robot
/// moves by t, scans of such edges move by t·H/(H − h): the magnification of the motion that scan matching
/// finds, against that of wheels or floor. (Method: this project.)
class EdgeParallax {
 public:
  explicit EdgeParallax(const EdgeParallaxOptions& options = {}) : options_(options) {}

  /// Motion since the last call.
  void move(const Pose2& previous_from_current) {
    reference_from_now_ = reference_from_now_ * previous_from_current;
  }
  /// The next scan does not follow those before.
  void forget() { has_reference_ = false; }
  /// Other edges from now on.
  void restart();
  /// Compares the edges of a scan with those of an earlier one. @param usable beams that show such edges
  void add(const Boundary& boundary, const std::vector<bool>& usable);

  /// Of the motion, less 1: h/(H − h); 0 for edges on the floor.
  double excess() const { return information_ > 0.0 ? weighted_ / information_ : 0.0; }
  double sigma() const;
  int comparisons() const { return comparisons_; }

 private:
  bool compare(double moved_m);

  EdgeParallaxOptions options_;
  ScanMatcher matcher_;
  LineScan reference_, scan_;
  bool has_reference_ = false;
  Pose2 reference_from_now_;
  double information_ = 0.0, weighted_ = 0.0;  ///< of the excess, and times it
  int comparisons_ = 0;
};

}  // namespace omnifleet::scan
