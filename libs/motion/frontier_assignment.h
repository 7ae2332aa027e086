#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet::motion {

/// Which robot goes to which frontier, each frontier to at most one robot (coordinated exploration, Burgard
/// et al. 2005). The sum of the times is minimised, plus `near_s` for two robots whose frontiers are at the
/// same place, less in proportion up to `near_m` apart: what the one sees there, the other need not visit.
/// As many robots as possible get a frontier. Local search from the greedy assignment. The result depends on
/// the arguments alone; among equal neighbours the one that gives earlier robots earlier frontiers.
///
/// @param times_s per robot (in the order of their names) and frontier, s; infinity: the robot cannot get
/// there
/// @param places_m of the frontiers
/// @return per robot the index of its frontier, or −1
std::vector<int> assignFrontiers(const std::vector<std::vector<double>>& times_s,
                                 const std::vector<Eigen::Vector2d>& places_m, double near_s, double near_m);

}  // namespace omnifleet::motion
