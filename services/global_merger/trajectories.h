#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dataset/trajectory_files.h"
#include "observation/observation.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// Trajectories and localization states of a map, from the pose samples of the localizer.
///
/// Poses in the frame of the map are causal: of several samples with one time the first valid one is kept,
/// and later corrections do not change it. A pose in another frame has no place here. Once the localizer has
/// related the two frames, it publishes all poses of the robot again as keyframe poses; the trajectory then
/// has the keyframe pose of that time (the one that the map uses).
class Trajectories {
 public:
  struct Trajectory {
    std::vector<dataset::StampedPose> poses;
    std::vector<dataset::StampedCovariance> covariances;  ///< row by row
  };

  /// Every sample, valid or not, of any frame.
  /// @param frame of the map, as in PoseEstimate::frame
  void add(const PoseEstimate& pose, const std::string& frame);

  /// Trajectories in order of time, of the robots that have any pose in the map. The covariance of a replaced
  /// pose is diagonal, from the σ of the keyframe pose and its rounding; its datum is that of the robot's
  /// next pose, or else of the one before.
  std::map<std::string, Trajectory> of(const occupancy::ContributionStore& store) const;
  /// States and events of all pose samples, in order of time, of any frame.
  const std::map<std::string, std::vector<dataset::StampedLocalization>>& localization() const {
    return states_;
  }
  /// Time and frame of the latest valid sample of a robot.
  std::optional<std::pair<TimeNs, std::string>> latest(const std::string& robot) const;

 private:
  struct Samples {
    Trajectory in_map;
    std::set<TimeNs> elsewhere;  ///< times of valid samples in another frame
    TimeNs latest_ns = 0;        ///< of the valid samples
    std::string latest_frame;
  };
  static Trajectory whole(const Samples& samples, const occupancy::ContributionStore::Path* path,
                          const occupancy::ContributionStore& store);

  std::map<std::string, Samples> samples_;  ///< of robots with a valid sample
  std::map<std::string, std::vector<dataset::StampedLocalization>> states_;
};

}  // namespace omnifleet::global_merger
