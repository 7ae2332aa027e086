#pragma once

#include <string>
#include <vector>

namespace omnifleet::import {

/// The UTIAS multi-robot cooperative localization and mapping data sets (Leung, Halpern, Barfoot and Liu,
/// IJRR 30(8), 2011). Robots have wheel odometry and a camera that measures range and bearing of barcodes on
/// landmarks and on other robots. The truth is from motion capture.
struct MrclamOptions {
  double wheel_separation_m =
      0.26;  ///< m; converts v and ω of the odometry to wheel speeds; any value is consistent
  double robot_radius_m = 0.17, robot_height_m = 0.3;
  double landmark_radius_m = 0.06;
  bool initial_poses = false;  ///< write the initial pose of each robot (from the truth)
  bool survey = false;         ///< write the surveyed landmark positions (landmarks.yaml, from the truth)
};

struct MrclamReport {
  int robots = 0, landmarks = 0;
  std::size_t odometry_rows = 0, observations = 0, unknown_barcodes = 0;
  std::vector<std::string> warnings;  ///< skipped rows, "FILE:LINE: reason"
};

/// Writes the data set in `source` (the folder with Barcodes.dat, or one above it) as a dataset of this
/// project. Robots are named r1…, landmarks by their subject numbers; barcodes are resolved. A barcode
/// without a subject keeps the name "barcode<n>" and is an unknown landmark. Throws options::Error for an
/// invalid source, std::runtime_error when a file cannot be written.
MrclamReport importMrclam(const std::string& source, const std::string& out, const MrclamOptions& options);

/// Unpacks a .tar.gz into `folder` with the tar of the system. Throws options::Error on failure.
void unpack(const std::string& archive, const std::string& folder);

}  // namespace omnifleet::import
