#pragma once

#include <map>
#include <string>
#include <vector>

#include "options/options.h"
#include "tracking/body_fit.h"
#include "tracking/own_motion.h"

namespace omnifleet::tracking {

struct PeerOptions {
  double max_age_s = 2.0;         ///< s, older published poses count as silence
  double max_sigma_m = 0.5;       ///< m, a pose less certain than this counts as silence
  double speed_sigma_mps = 0.15;  ///< m/s, what a peer may have changed its speed by since it published

  static PeerOptions read(const options::Section& section);
};

/// Another robot of the fleet, predicted to this frame's time.
struct Peer {
  std::string robot;
  BodyModel body;
  bool known = false;  ///< false: it publishes nothing usable (or we do not know where we are ourselves)
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();      ///< footprint centre in odom
  double heading_rad = 0.0;                                ///< odom
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  ///< odom axes
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  bool in_blob = false;       ///< what it would show lies within a blob of this frame: seen, or hidden there
  bool may_be_there = false;  ///< where it says that it is this frame shows no floor: seen, or hidden
};

/// Published poses (map) → places in odom now. The poses belong to the previous frame (feedback) or are
/// older; each peer is carried on with the velocity between its last two poses, the own pose with the own
/// motion, or likewise where that is not known (no wheels).
class Peers {
 public:
  Peers(const PeerOptions& options, const std::string& own, const std::map<std::string, RobotBody>& bodies);

  /// Where the robots start, for as long as nobody has published anything.
  void assume(const std::vector<PoseEstimate>& starts);
  /// All other robots in the order of their names.
  std::vector<Peer>& predict(const std::vector<PoseEstimate>& poses, const OwnMotion& own_motion);
  /// The newest published pose of this robot itself; nothing before there is one.
  const PoseEstimate* own() const;
  const std::vector<Peer>& all() const { return peers_; }

 private:
  struct Last {
    PoseEstimate pose;
    Pose2 twist;  ///< in its base_link, per second
    bool any = false;
    bool assumed = false;
  };
  void forgetAssumed();
  PoseEstimate carriedOn(const Last& last, TimeNs now_ns) const;
  void remember(const PoseEstimate& pose);
  void place(Peer& peer, const Last& last, const PoseEstimate& own, const Pose2& odom_from_base_then,
             TimeNs now_ns);

  PeerOptions options_;
  std::string own_;
  std::vector<Peer> peers_;
  std::map<std::string, Last> last_;
};

}  // namespace omnifleet::tracking
