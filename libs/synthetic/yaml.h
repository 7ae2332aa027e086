#pragma once

// Readers for values that several sections of an arena file use. Private to this library.

#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "options/options.h"

namespace omnifleet::synthetic {

/// Reads [red, green, blue], each 0 … 255.
void readRgb(const options::Section& section, const std::string& key, dataset::Rgb& rgb);
/// Reads [x m, y m, θ rad].
void readPose(const options::Section& section, const std::string& key, Pose2& pose);
/// Reads rows [a, b, c] from one flat list.
void readRows(const options::Section& section, const std::string& key, std::vector<Eigen::Vector3d>& rows);

}  // namespace omnifleet::synthetic
