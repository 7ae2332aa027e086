#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "structure/polylines.h"

namespace omnifleet::global_merger {

/// Ids of objects that come from cells begin here; those of fitted obstacles are smaller.
inline constexpr std::uint64_t kFirstStructureId = 1'000'000;

struct StructureRules {
  double pose_sigma_m = 0.0;  ///< m, error of pose and lens that the ray ends of a keyframe share
  int min_views = 1;          ///< lines of fewer keyframes (median over their cells) are not published
};

/// Objects for the polylines that do not belong to a fitted obstacle. A line is structure, unless it is
/// closed around a candidate that surely stands there: then it is an obstacle. Cells alone do not distinguish
/// a marking on the floor from what stands on it. A polyline belongs to an obstacle if most of its points lie
/// within kBeside_m of its outline.
/// @param standing_m centres of candidates that stand there, but whose outline could not be fitted all around
/// @param robots names, in the order of the bits of Polyline::observers
std::vector<dataset::MapObject> structureObjects(const std::vector<structure::Polyline>& lines,
                                                 const std::vector<dataset::MapObject>& obstacles,
                                                 const std::vector<Eigen::Vector2d>& standing_m,
                                                 const std::vector<std::string>& robots,
                                                 const StructureRules& rules = {});
inline constexpr double kBeside_m = 0.075;  ///< one and a half cells

}  // namespace omnifleet::global_merger
