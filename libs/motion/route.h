#pragma once

#include <Eigen/Core>
#include <vector>

#include "motion/floor_memory.h"
#include "motion/grid_search.h"

namespace omnifleet::motion {

/// Path around the obstacles between a robot and its goal. It is straight where that is free. Otherwise it is
/// the cheapest path over the cells of the floor memory (A*, Hart, Nilsson and Raphael 1968), where proximity
/// to obstacles costs. A path is kept until it is blocked or another is clearly cheaper, so that a robot in
/// front of the middle of a wall does not alternate between its two sides. Cells that were never seen count
/// as free: dead ends are discovered by seeing them. Avoidance steers along the path and avoids moving
/// objects.
class Route {
 public:
  struct Options {
    double tight_margin_m = 0.12;  ///< m, least clearance of a path
    double margin_m = 0.25;        ///< m, preferred clearance of a path
    double near_cost =
        3.0;  ///< 1, additional cost per metre at the tight margin; it falls to 0 at `margin_m`
    double switch_share =
        0.8;  ///< 1, a new path replaces the current one if it costs at most this share of it

    static Options read(const options::Section& section);
  };

  struct Leg {
    Eigen::Vector2d via_m = Eigen::Vector2d::Zero();  ///< next place to drive straight to
    double left_m = 0.0;                              ///< m, length of the whole path
    bool straight = true;                             ///< `via_m` is the goal itself
    /// The path ends at the goal; otherwise at the reachable place nearest to it.
    bool reaches = true;
  };

  explicit Route(const Options& options) : options_(options) {}

  /// Path from a place to a goal (map, metres) for a body of the given radius.
  Leg towards(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& goal_m,
              double radius_m);
  void forget() { path_m_.clear(); }

 private:
  bool isFree(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m,
              double clear_m) const;
  double stepCost(double clear_m, double radius_m) const;
  double costOf(const FloorMemory& floor, double radius_m) const;
  void dropDriven(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m);
  void priceCells(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m);
  void search(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& goal_m,
              double radius_m);
  Leg legOf(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m) const;

  Options options_;
  std::vector<Eigen::Vector2d> path_m_;                    ///< map, from the robot on; empty: straight line
  Eigen::Vector2d path_goal_m_ = Eigen::Vector2d::Zero();  ///< the goal for which it was searched
  bool reaches_ = true;
  int search_pause_ = 0;  ///< frames until the next search, after a search that did not reach the goal
  GridSearch search_;
  cv::Mat1f price_;
};

}  // namespace omnifleet::motion
