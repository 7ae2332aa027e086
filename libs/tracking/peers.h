#pragma once

#include <map>
#include <string>
#include <vector>

#include "options/options.h"
#include "tracking/body_fit.h"
#include "tracking/own_motion.h"

namespace omnifleet::tracking {

struct PeerOptions {
  double max_age_s = 2.0;         ///< s, older published poses count as unknown
  double max_sigma_m = 0.5;       ///< m, a peer whose predicted place has a larger σ counts as unknown
  double speed_sigma_mps = 0.15;  ///< m/s, σ of the speed change of a peer since its last pose

  static PeerOptions read(const options::Section& section);
};

/// Another robot of the fleet, predicted to this frame's time.
struct Peer {
  std::string robot;
  BodyModel body;
  bool known = false;  ///< false: no usable pose of the peer, or this robot is not localized
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();      ///< footprint centre in odom
  double heading_rad = 0.0;                                ///< odom
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();  ///< odom axes
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  bool in_blob =
      false;  ///< its predicted outline lies within a blob of this frame: it is visible or hidden there
  bool may_be_there = false;  ///< this frame shows no floor at its published place: it is visible or hidden
};

/// Published poses (map) → places in odom at this frame's time. The poses belong to the previous frame
/// (feedback) or are older. Each peer is extrapolated with the velocity between its last two poses. The own
/// pose is extrapolated with the own motion, or by its velocity where the motion is unknown (no wheels).
class Peers {
 public:
  Peers(const PeerOptions& options, const std::string& own, const std::map<std::string, RobotBody>& bodies);

  /// Sets the initial poses of the robots. They are used until the first pose is published.
  void setInitialPoses(const std::vector<PoseEstimate>& initial_poses);
  /// All other robots, ordered by name.
  std::vector<Peer>& predict(const std::vector<PoseEstimate>& poses, const OwnMotion& own_motion);
  /// The newest published pose of this robot; nullptr before the first one.
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
  PoseEstimate extrapolated(const Last& last, TimeNs now_ns) const;
  void remember(const PoseEstimate& pose);
  void place(Peer& peer, const Last& last, const PoseEstimate& own, const Pose2& odom_from_base_then,
             TimeNs now_ns);

  PeerOptions options_;
  std::string own_;
  std::vector<Peer> peers_;
  std::map<std::string, Last> last_;
};

}  // namespace omnifleet::tracking
