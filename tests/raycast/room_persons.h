#pragma once

#include <vector>

#include "tests/raycast/room_path.h"

namespace omnifleet::raycast {

inline constexpr double kOccluder_m = 1.5;  ///< farther persons do not count as occlusion

/// Share of the bearings from `at` along which a person is nearer than kOccluder_m and nearer than walls and
/// furniture.
double occludedShare(const House& house, const std::vector<Solid>& persons, const Eigen::Vector2d& at);

/// Persons who walk around the first robot, one list of solids per frame. Two persons of three show two legs
/// of 12 cm, the third wears a long coat of 36 cm. They keep clear of furniture, of robots and of the first
/// robot's way; a person left behind is replaced. As many come as occlude options.occluded_share on average.
/// Throws std::runtime_error if 40 persons are not enough.
std::vector<std::vector<Solid>> personsAround(const House& house, const Drive& drive,
                                              const FurnishedOptions& options);

}  // namespace omnifleet::raycast
