#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formation/shared_grid.h"
#include "motion/avoidance.h"
#include "motion/exploration.h"

namespace omnifleet::formation {

/// One robot's part of the exploration: chooses its goal together with the others and drives there. Called
/// once per frame.
class Explorer {
 public:
  struct Options {
    motion::Exploration::Options plan;
    double plan_period_s = 0.4;  ///< s, between two assignments; all robots compute them in the same frames
    double silent_s = 2.0;       ///< s, a robot without a state for longer does not take part
    double look_s = 0.8;         ///< s, a frontier in view for this long that stays unknown is skipped
    double stuck_s = 6.0;        ///< s without progress towards a frontier until it is skipped
    double yield_s = 0.8;     ///< s, behind another robot that is in the way until this robot makes way; the
                              ///< first robot by name waits longer
    double longest_s = 45.0;  ///< s, bound of the time for one frontier
    double arrived_m = 0.06;  ///< m, a viewpoint within this distance is reached
    double arrived_rad = 0.15;       ///< rad, likewise its heading
    double turn_in_place_rad = 0.6;  ///< rad, beyond this heading error the robot turns without driving

    static Options read(const options::Section& section);
  };
  struct Frame {
    TimeNs acquired_ns = 0;
    double dt_s = 0.0;
    Pose2 map_from_base;                            ///< present
    std::vector<motion::Barriers::Solid> solids;    ///< map; the other robots
    std::optional<Eigen::Vector2d> nearest_m;       ///< map; nearest other robot that drives, if it is near
    std::optional<Eigen::Vector2d> nearest_goal_m;  ///< map; of that robot
    bool nearest_first = false;                     ///< its name comes first
    bool held = false;  ///< the command before was limited because something is near
  };
  struct Drive {
    bool explored = false;  ///< nothing reachable is unknown
    /// Wanted twist before the limits of acceleration.
    motion::Twist twist;
    std::optional<Eigen::Vector2d> goal_m;  ///< map
  };

  Explorer(const std::string& robot, const std::map<std::string, RobotBody>& bodies, const Options& options,
           const motion::DriveLimits& limits);

  /// Begins anew: no goal, nothing skipped.
  void restart();
  Drive drive(const Frame& frame, const SharedGrid& shared);

  const std::vector<motion::SkippedFrontier>& skipped() const { return skipped_; }
  std::uint32_t frontiers() const { return frontiers_; }

 private:
  std::vector<motion::Explorer> team(const SharedGrid& shared, TimeNs now_ns, std::size_t& own) const;
  void choose(const Frame& frame, const SharedGrid& shared);
  motion::Twist approach(const Frame& frame, const motion::ExplorationGrid& grid);
  motion::Twist turnTo(double off_rad) const;
  motion::Twist sweep(const Frame& frame) const;
  Eigen::Vector2d carrot(const Eigen::Vector2d& here_m, const std::vector<Eigen::Vector2i>& path,
                         const motion::ExplorationGrid& grid) const;
  void watch(const Frame& frame, double left_s, bool looking);
  bool yields(const Frame& frame, const motion::ExplorationGrid& grid, bool blocked);
  motion::Twist makeWay(const Frame& frame, const motion::ExplorationGrid& grid);
  std::optional<Eigen::Vector2i> wayMade(const Frame& frame, const motion::ExplorationGrid& grid) const;
  motion::Twist along(const Frame& frame, const motion::ExplorationGrid& grid,
                      const Eigen::Vector2i& goal) const;
  void skip(bool looked);

  std::string robot_;
  std::map<std::string, double> radius_m_;
  Options options_;
  motion::DriveLimits limits_;
  motion::Exploration exploration_;
  motion::DistanceField field_;
  cv::Mat1f price_;
  std::optional<motion::Exploration::Goal> goal_;
  std::vector<motion::SkippedFrontier> skipped_;
  std::uint32_t frontiers_ = 0;
  TimeNs planned_period_ = -1;
  int done_plans_ = 0;      ///< successive plans without a frontier
  double looking_s_ = 0.0;  ///< since the goal is in view
  double since_progress_s_ = 0.0, since_chosen_s_ = 0.0;
  double least_left_s_ = 0.0;               ///< least time left to the goal
  std::vector<Eigen::Vector2d> failed_m_;   ///< map; from where the goal was in view and stayed unknown
  double blocked_s_ = 0.0;                  ///< since another robot is in the way
  std::optional<Eigen::Vector2i> retreat_;  ///< where this robot makes way for another
  double retreat_s_ = 0.0;                  ///< left
  bool retried_ = false;                    ///< frontiers that were not reached have been tried again
  Eigen::Vector2d watched_m_ = Eigen::Vector2d::Zero();  ///< the goal that these times belong to
};

}  // namespace omnifleet::formation
