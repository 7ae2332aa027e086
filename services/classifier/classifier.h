#pragma once

// Choi et al. 2014, §IV.2 (eq. 8, Fig. 11): tracks the objects of a local map from frame to frame and
// classifies them as robots or obstacles.

#include <map>
#include <string>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"
#include "scan/step_check.h"
#include "tracking/kind.h"
#include "tracking/own_motion.h"
#include "tracking/peers.h"
#include "tracking/tracker.h"

namespace omnifleet::classifier {

/// Classifier of one robot. Choi classifies by the flow vectors alone, which give no information while the
/// robots stand. This class combines motion over the floor, the known bodies and the published poses
/// (tracking/kind.h). `method: vectors` selects Choi's rule.
class Classifier {
 public:
  struct Options {
    tracking::TrackerOptions tracker;
    tracking::KindOptions kind;
    tracking::PeerOptions peers;
    scan::StepCheckOptions step_check;
    double gap_s = 1.0;      ///< s; after a longer gap people may have moved the robot, …
    double gap_steps = 5.0;  ///< 1, … if it is also so many times longer than the step before

    static Options read(const options::Section& section);
  };

  /// `bodies`: bodies of all robots of the fleet by name, including this one. Throws options::Error if
  /// `robot` is not among them.
  Classifier(const Options& options, const std::string& robot,
             const std::map<std::string, RobotBody>& bodies);

  /// Sets the initial poses of the robots at the time of the first local map. They are used until the first
  /// pose is published.
  void setInitialPoses(const std::vector<PoseEstimate>& initial_poses) {
    peers_.setInitialPoses(initial_poses);
  }

  /// Processes one sample, in time order. `poses` holds the latest published poses of all robots, including
  /// this one, at the previous frame; it may be empty, invalid or old. An invalid local map gives objects of
  /// the same state, with every track predicted and none visible. The result is valid until the next call.
  const Objects& process(const LocalMap& local_map, const std::vector<PoseEstimate>& poses);

 private:
  const LocalMap& withCheckedMotion(const LocalMap& received);
  void copyHeader(const LocalMap& local_map);
  void placeByCentroids(const LocalMap& local_map);
  void labelBoundary();
  void labelScan(const LocalMap& local_map);

  bool paper_centroids_;
  double gap_s_, gap_steps_;
  tracking::OwnMotion own_motion_;
  tracking::Peers peers_;
  tracking::Tracker tracker_;
  tracking::KindJudge judge_;
  scan::StepCheck step_check_;
  LocalMap corrected_;  ///< local map with a corrected motion, if the objects reject that of the wheels
  Objects objects_;
};

}  // namespace omnifleet::classifier
