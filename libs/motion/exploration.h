#pragma once

#include <opencv2/core.hpp>

#include <optional>
#include <string>
#include <vector>

#include "motion/distance_field.h"
#include "motion/exploration_grid.h"
#include "motion/frontiers.h"
#include "motion/motion_guard.h"
#include "options/options.h"

namespace omnifleet::motion {

/// A robot of the fleet as all robots know it: at its published pose.
struct Explorer {
  std::string name;
  Pose2 map_from_base;
  double radius_m = 0.15;                 ///< of the circle about base_link that holds the body
  Polygon outline_m;                      ///< map
  bool explores = false;                  ///< false: it stands, or does something else
  double field_of_view_rad = 0.0;         ///< of its latest view; 0: unknown
  double blind_m = 0.0;                   ///< Scan::blind_m, plus the distance of its origin from base_link
  std::optional<Eigen::Vector2d> goal_m;  ///< frontier that it heads for
  std::vector<SkippedFrontier> skipped;
};

/// Frontier exploration of a fleet (Yamauchi 1997; Burgard et al. 2005): where each robot goes to see unknown
/// floor. Each robot computes the goals of all from the same grid and the same published states; so all get
/// the same result, and no frontier is given to two robots.
class Exploration {
 public:
  struct Options {
    double margin_m = 0.05;       ///< m, least clearance of a path, from the circle about the body
    double wide_margin_m = 0.12;  ///< m, preferred clearance of a path
    double near_cost = 3.0;       ///< 1, additional cost per metre at the least clearance
    double extent_m = 0.5;        ///< m, larger frontiers are divided
    int least_cells = 4;          ///< smaller frontiers are left out
    double look_m = 1.0;          ///< m, farthest viewpoint of a frontier
    double look_part_s = 3.0;     ///< s, worth of seeing a whole frontier instead of none of it
    double keep_s = 1.5;          ///< s, advantage of the frontier that a robot heads for
    double beside_cost = 6.0;     ///< 1, additional cost per metre beside a robot that drives
    double near_s = 8.0;          ///< s, cost of two robots at one place
    double near_m = 1.5;          ///< m, apart from which two frontiers do not share their surroundings
    double cruise_mps = 0.25, turn_radps = 1.0;  ///< to estimate times; from the drive limits

    static Options read(const options::Section& section);
  };
  struct Goal {
    Frontier frontier;
    Viewpoint viewpoint;
    double time_s = 0.0;     ///< estimated, to the view
    bool exhausted = false;  ///< all viewpoints have shown nothing
  };
  struct Plan {
    std::vector<int> frontier_of;  ///< per robot, as passed; −1: none
    /// Those where floor that a body can cover begins, and that a robot sees from a place that it can reach.
    /// Floor behind a gap that is too narrow is not among them.
    std::vector<Frontier> frontiers;
    std::optional<Goal> own;
  };

  explicit Exploration(const Options& options) : options_(options) {}

  /// @param robots sorted by name @param own index of this robot @param failed_m places (map) from where it
  /// has looked at its goal and nothing became known
  Plan plan(const ExplorationGrid& grid, const std::vector<Explorer>& robots, std::size_t own,
            const std::vector<Eigen::Vector2d>& failed_m);

  /// Cost of driving across each cell for a robot of the given radius: infinity on unknown floor and nearer
  /// to obstacles than the least clearance, or to `solids` (map) than theirs. A robot at `here_m` that is
  /// nearer already can leave.
  void priceCells(const ExplorationGrid& grid, const Eigen::Vector2d& here_m, double radius_m,
                  const std::vector<Barriers::Solid>& solids, cv::Mat1f& price) const;

  const Options& options() const { return options_; }

 private:
  struct Choice {
    double time_s;
    Viewpoint viewpoint;
  };
  void findReachable(const ExplorationGrid& grid, const std::vector<Explorer>& robots);
  void addCoverable(const ExplorationGrid& grid, const DistanceField& field, double radius_m);
  bool isCoverable(const Frontier& frontier) const;
  void discourage(const ExplorationGrid& grid, const Polygon& outline_m, double radius_m,
                  cv::Mat1f& price) const;
  std::vector<double> timesTo(const Frontier& frontier, const ExplorationGrid& grid,
                              const std::vector<Explorer>& robots, std::size_t own,
                              Viewpoint& own_viewpoint) const;
  Choice choose(const std::vector<Viewpoint>& views, const DistanceField& field, const Explorer& robot,
                const ExplorationGrid& grid, const std::vector<Eigen::Vector2d>& failed_m) const;
  void lookFromElsewhere(const ExplorationGrid& grid, const Explorer& robot, std::size_t own,
                         const std::vector<Eigen::Vector2d>& failed_m, Goal& goal) const;
  ViewpointOptions viewpointOptions(const Explorer& robot, bool beyond_blind) const;

  Options options_;
  std::vector<DistanceField> fields_;  ///< per robot
  std::vector<bool> takes_part_;       ///< per robot
  std::vector<Eigen::Vector2i> here_;  ///< cells of the robots that take part
  cv::Mat1b standable_;                ///< nonzero: a robot can reach the cell
  cv::Mat1b coverable_;                ///< nonzero: within the body's circle and margin about such a cell
  cv::Mat1b opaque_;                   ///< nonzero: a standing robot
  cv::Mat1f price_;
};

/// Whether a place (map) belongs to a frontier: one of its cells is nearer than `near_m`.
bool isAt(const ExplorationGrid& grid, const Frontier& frontier, const Eigen::Vector2d& place_m,
          double near_m);

}  // namespace omnifleet::motion
