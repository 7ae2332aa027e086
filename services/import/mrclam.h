#pragma once

#include <string>
#include <vector>

namespace omnifleet::import {

/// The UTIAS multi-robot cooperative localisation and mapping data sets (Leung, Halpern, Barfoot and Liu,
/// IJRR 30(8), 2011): robots with wheel odometry and a camera that gives range and bearing of barcodes on
/// landmarks and on other robots; truth by motion capture.
struct MrclamOptions {
  double wheel_separation_m = 0.26;  ///< m; the odometry gives v and ω, wheels follow with any separation
  double robot_radius_m = 0.17, robot_height_m = 0.3;
  double landmark_radius_m = 0.06;
  bool initial_poses = false;  ///< tell where each robot starts (from the truth)
  bool survey = false;         ///< tell where the landmarks stand (landmarks.yaml, from the truth)
};

struct MrclamReport {
  int robots = 0, landmarks = 0;
  std::size_t odometry_rows = 0, observations = 0, unknown_barcodes = 0;
  std::vector<std::string> warnings;  ///< rows left out: FILE:LINE: why
};

/// Writes the data set in `source` (a folder that holds Barcodes.dat, or one below it does) as a dataset of
/// this project: robots r1…, landmarks by their subject numbers, barcodes resolved. A barcode that nobody
/// carries keeps its name "barcode<n>", as an unknown landmark. Throws options::Error for a source that is
/// none, std::runtime_error where something cannot be written.
MrclamReport importMrclam(const std::string& source, const std::string& out, const MrclamOptions& options);

/// Unpacks a .tar.gz into `folder` by the system's tar. Throws options::Error when it cannot be unpacked.
void unpack(const std::string& archive, const std::string& folder);

}  // namespace omnifleet::import
