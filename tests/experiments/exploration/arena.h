#pragma once

#include <cstdint>
#include <string>

namespace omnifleet::exploration {

/// Writes OUT/arena.yaml and OUT/fleet.yaml for a seed: two robots with one forward camera each explore an
/// enclosed arena, two robots are parked, two ceiling cameras locate all four.
/// - Even seeds: the walls of `config/arenas/ahmed.yaml` and `ahmed2.yaml` in turn, free-standing obstacles
/// of
///   the seed. The robots that explore begin anywhere on their tours, with any heading.
/// - Odd seeds: the seed also draws the walls, and the initial poses of all robots. Two solids touch or leave
/// a
///   passage of 0.42 m.
/// @param arenas folder with the arena files @param longest_s longest run, s
/// @return the fleet file
std::string writeFleet(std::uint32_t seed, const std::string& arenas, double longest_s,
                       const std::string& out);

}  // namespace omnifleet::exploration
