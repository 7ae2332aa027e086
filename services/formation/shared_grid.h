#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "motion/exploration_grid.h"
#include "motion/formation_types.h"
#include "observation/observation.h"

namespace omnifleet::formation {

/// The exploration grid of the fleet: draws every published view at the published pose of the same time. The
/// own view is used when it is published, like those of the others. So robots that have received the same
/// samples have equal grids.
class SharedGrid {
 public:
  SharedGrid(const motion::ExplorationGrid::Options& options, const std::map<std::string, RobotBody>& bodies);

  /// Robots that stand for good at a known pose and publish nothing.
  void park(const std::map<std::string, Pose2>& map_from_bases);
  /// Adds what was published since the last call, and draws what is complete.
  void learn(const std::vector<PoseEstimate>& poses, const std::vector<motion::FormationState>& states);

  const motion::ExplorationGrid& grid() const { return grid_; }
  /// Latest published pose of a robot.
  std::optional<Pose2> pose(const std::string& robot) const;
  /// Latest state of a robot and its pose of the same time.
  struct Stated {
    motion::FormationState state;
    Pose2 map_from_base;
  };
  const std::map<std::string, Stated>& stated() const { return stated_; }
  /// Outline of a robot at a pose, map.
  Polygon outline(const std::string& robot, const Pose2& map_from_base) const;

 private:
  struct Timed {
    TimeNs acquired_ns;
    Pose2 map_from_base;
  };
  std::optional<Pose2> poseAt(const std::string& robot, TimeNs time_ns) const;
  void draw(const motion::FormationState& state, const Pose2& map_from_base);

  motion::ExplorationGrid grid_;
  std::map<std::string, RobotBody> bodies_;
  std::map<std::string, Polygon> outlines_m_;  ///< base_link
  std::map<std::string, std::deque<Timed>> poses_;
  std::map<std::string, std::deque<motion::FormationState>> pending_;
  std::map<std::string, Stated> stated_;
  std::map<std::string, bool> placed_;  ///< robots whose first pose has been drawn
};

}  // namespace omnifleet::formation
