#pragma once

#include <Eigen/Core>
#include <vector>

#include "motion/floor_memory.h"
#include "motion/grid_search.h"

namespace omnifleet::motion {

/// A way round what stands between a robot and where it wants to be. Straight on where that is free; else the
/// cheapest way over the cells of what it remembers (A*, Hart, Nilsson and Raphael 1968; nearness to things
/// costs), kept until it is blocked or another is plainly shorter, so that a robot before the middle of a
/// wall does not change its mind. What nobody has seen counts as free: dead ends are learned by looking into
/// them. Avoidance steers along it and keeps clear of what moves.
class Route {
 public:
  struct Options {
    double tight_margin_m = 0.12;  ///< m, ways keep so clear of things …
    double margin_m = 0.25;        ///< m, … and had rather keep this
    double near_cost = 3.0;     ///< 1, a metre at the tight margin costs so much more than one at `margin_m`
    double switch_share = 0.8;  ///< 1, another way is taken when it costs no more than this share

    static Options read(const options::Section& section);
  };

  struct Leg {
    Eigen::Vector2d via_m = Eigen::Vector2d::Zero();  ///< go straight to there next
    double left_m = 0.0;                              ///< of the whole way
    bool straight = true;                             ///< `via_m` is the goal itself
    /// Whether the way ends at the goal; else where one gets nearest to it.
    bool reaches = true;
  };

  explicit Route(const Options& options) : options_(options) {}

  /// From a place to a goal (map, metres) for a body of that radius.
  Leg towards(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& goal_m,
              double radius_m);
  void forget() { way_m_.clear(); }

 private:
  bool isFree(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m,
              double clear_m) const;
  double stepCost(double clear_m, double radius_m) const;
  double costOf(const FloorMemory& floor, double radius_m) const;
  void keepUp(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m);
  void priceCells(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m);
  void search(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& goal_m,
              double radius_m);
  Leg legOf(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m) const;

  Options options_;
  std::vector<Eigen::Vector2d> way_m_;                  ///< map, from the robot on; empty: straight
  Eigen::Vector2d way_to_m_ = Eigen::Vector2d::Zero();  ///< the goal that it was searched for
  bool reaches_ = true;
  int rest_ = 0;  ///< frames until a way is searched for again where none was found
  GridSearch search_;
  cv::Mat1f price_;
};

}  // namespace omnifleet::motion
