#pragma once

// Choi et al. 2014, §IV.2 (eq. 8, Fig. 11): which objects of a local map are robots, which are obstacles,
// followed from frame to frame.

#include <map>
#include <string>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"
#include "tracking/kind.h"
#include "tracking/own_motion.h"
#include "tracking/peers.h"
#include "tracking/tracker.h"

namespace omnifleet::classifier {

/// One per robot. Departs from the paper where it must: Choi tells robots from obstacles by the vectors
/// alone, which says nothing while robots stand; here motion over the floor, the known bodies and the
/// published poses decide together (tracking/kind.h). `method: choi` is the paper's own rule.
class Classifier {
 public:
  struct Options {
    tracking::TrackerOptions tracker;
    tracking::KindOptions kind;
    tracking::PeerOptions peers;

    static Options read(const options::Section& section);
  };

  /// `bodies`: every robot of the fleet by name, the own one too. Throws options::Error if `robot` is not
  /// among them.
  Classifier(const Options& options, const std::string& robot,
             const std::map<std::string, RobotBody>& bodies);

  /// Where the robots start, known before anybody has published a pose; for the first local map's time.
  void assume(const std::vector<PoseEstimate>& starts) { peers_.assume(starts); }

  /// One sample out per sample in, in time order. `poses`: the latest published estimates of all robots (the
  /// own one too) at the previous frame; may be empty, invalid or old. An invalid local map gives objects of
  /// the same state with every track predicted and none visible. The result lives until the next call.
  const Objects& process(const LocalMap& local_map, const std::vector<PoseEstimate>& poses);

 private:
  const LocalMap& checked(const LocalMap& told);
  void passOn(const LocalMap& local_map);
  void placeByCentroids(const LocalMap& local_map);
  void labelScan(const LocalMap& local_map);

  bool paper_centroids_;
  tracking::OwnMotion own_motion_;
  tracking::Peers peers_;
  tracking::Tracker tracker_;
  tracking::KindJudge judge_;
  LocalMap refuted_;  ///< one whose motion what stands around refutes, with that which it shows
  Objects objects_;
};

}  // namespace omnifleet::classifier
