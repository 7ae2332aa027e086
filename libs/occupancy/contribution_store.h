#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lens/spread.h"
#include "occupancy/contribution.h"

namespace omnifleet::occupancy {

/// What is held of one robot (topic map/have).
struct Held {
  std::string robot;
  TimeNs first_ns = 0, last_ns = 0;
  std::uint32_t contributions = 0, keyframe_poses = 0;
  std::uint64_t digest = 0;  ///< sum of the digests of all held, whatever the order
};

/// The set of contributions and the set of winning keyframe poses, ordered by (robot, time). Adding is
/// idempotent and commutative: of two different contributions with one name the one with the larger bytes
/// stays; of two poses the highest (term, revision), then the larger bytes. Contributions are held as they
/// came and beside it as they are to be used: without what the camera's error did to them (of which there may
/// be many, so that they are not all corrected at once).
class ContributionStore {
 public:
  struct Keyframe {
    std::shared_ptr<const Contribution> contribution;  ///< null until it arrives
    std::shared_ptr<const Contribution> seen;          ///< the same without the camera's error: what to use
    std::optional<KeyframePose> pose;                  ///< empty until it arrives
    std::uint64_t contribution_digest = 0, pose_digest = 0;
  };
  using Path = std::map<TimeNs, Keyframe>;

  /// Of the robots' cameras, before anything is added; equidistant where nothing is said.
  void setLenses(std::map<std::string, lens::Spread> lenses) { lenses_ = std::move(lenses); }
  /// True when the set changed.
  bool add(const Contribution& contribution);
  bool add(const KeyframePose& pose);

  /// What a robot's latest valid pose says of its camera; all its contributions are seen without it …
  CameraErrorPpm cameraError(const std::string& robot) const;
  /// … once this has been called often enough after it changed: the next contributions that still have to be
  /// corrected anew, in order of robot and time, at most so many.
  std::vector<std::pair<std::string, TimeNs>> correctNext(std::size_t at_most);

  const std::map<std::string, Path>& robots() const { return robots_; }
  const Path* find(const std::string& robot) const;
  const Keyframe* find(const std::string& robot, TimeNs acquired_ns) const;
  std::size_t contributions() const { return contributions_; }
  std::size_t poses() const { return poses_; }

  std::vector<Held> held() const;
  /// Contributions and poses of one robot with first_ns ≤ time ≤ last_ns, in order of time, for a peer that
  /// lacks them.
  std::vector<Contribution> contributionsBetween(const std::string& robot, TimeNs first_ns,
                                                 TimeNs last_ns) const;
  std::vector<KeyframePose> posesBetween(const std::string& robot, TimeNs first_ns, TimeNs last_ns) const;

 private:
  void noteCameraError(const std::string& robot);
  std::shared_ptr<const Contribution> withoutError(const std::shared_ptr<const Contribution>& seen) const;

  std::map<std::string, lens::Spread> lenses_;
  std::map<std::string, Path> robots_;
  std::map<std::string, CameraErrorPpm> errors_;  ///< to be taken off what is `seen`; none: zero
  std::map<std::string, TimeNs> behind_;          ///< from there on that has not been done yet
  std::size_t contributions_ = 0, poses_ = 0;
};

}  // namespace omnifleet::occupancy
