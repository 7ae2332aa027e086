#pragma once

// Small readers that the arena's sections share; private to this library.

#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "options/options.h"

namespace omnifleet::synthetic {

/// [red, green, blue], 0 … 255.
void readRgb(const options::Section& section, const std::string& key, dataset::Rgb& rgb);
/// [x m, y m, θ rad]
void readPose(const options::Section& section, const std::string& key, Pose2& pose);
/// List of rows [a, b, c].
void readRows(const options::Section& section, const std::string& key, std::vector<Eigen::Vector3d>& rows);

}  // namespace omnifleet::synthetic
