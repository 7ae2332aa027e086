#pragma once

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// A robot without a pose follows its own wheels in a frame of its own. Takes its scout to the time of a new
/// frame; starts afresh where the motion is not known.
void advanceScout(const FleetState& fleet, RobotNode& lost, const Objects& frame);

/// Something whose place in map is known was seen at a place of the scout's frame, or the scout itself was
/// seen from a place known, as well as `map_covariance` says. `of`: the point or robot that was seen or saw.
void addScoutPair(RobotNode& lost, const std::string& of, const Eigen::Vector2d& in_local,
                  const Eigen::Vector2d& in_map, const Eigen::Matrix2d& map_covariance);

/// Places a robot where what it has seen of named things, and who has seen it, agrees: the rigid motion that
/// most pairs of the last 30 s support. Needs at least five pairs, most of them agreeing, far enough apart to
/// tell the heading. What placed it ties it to those things alone, not to the map: where they turn out to
/// stand elsewhere, it goes with them, and nobody is surer of where north is than before.
bool locateByPoints(FleetState& fleet, RobotNode& lost, const Objects& frame);

}  // namespace omnifleet::estimation
