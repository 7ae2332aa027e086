#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "appearance/signature.h"
#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::fernandez {

/// Frequencies that the signatures of a set hold: all of a row of 512 columns.
inline constexpr int kFrequencies = 255;

struct SetImage {
  std::uint32_t sequence = 0;  ///< index of its row in data.csv
  TimeNs time_ns = 0;
  Pose2 truth;                   ///< map_from_base
  Pose2 odometry;                ///< by the wheel rows alone, from the first image of the set
  appearance::Signature rows;    ///< of all 64 rows of a panorama near the horizon: the literal method
  appearance::Signature pooled;  ///< of 16 rows, occluded sectors interpolated: the default of omnifleet
};

/// The images of the first robot of a recording, each unwrapped once, with the rows of its wheels.
struct ImageSet {
  std::vector<SetImage> images;
  bool has_wheels = false;

  std::vector<Eigen::Vector2d> truth(int step) const;
  std::vector<Eigen::Vector2d> odometry(int step) const;
  /// Length of the true path, metres.
  double length_m() const;

  /// Reads the recording. Images that are unreadable or have no true pose are left out. Throws
  /// options::Error and std::runtime_error.
  static ImageSet load(const std::string& recording);
};

}  // namespace omnifleet::fernandez
