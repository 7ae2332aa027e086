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

/// The set of contributions and the set of winning keyframe poses, ordered by (robot, time). Adding is
/// idempotent and commutative. Of two different contributions of the same robot and time, the one with the
/// larger bytes is kept. Of two poses, the one with the higher (term, revision) is kept, and if these are
/// equal, the one with the larger bytes. A contribution is held as received and, for use, corrected for the
/// camera error. The corrections may be many, so they are not all computed at once.
///
/// The sets hold the samples of all frames, so that replicas agree about them. A map uses the poses in its
/// own frame only (poseOf).
class ContributionStore {
 public:
  /// @param frame of the map, as in KeyframePose::frame
  explicit ContributionStore(std::string frame = {}) : frame_(std::move(frame)) {}

  struct Keyframe {
    std::shared_ptr<const Contribution> contribution;  ///< null until it arrives
    std::shared_ptr<const Contribution>
        corrected;                     ///< the same, corrected for the camera error: this one is used
    std::optional<KeyframePose> pose;  ///< empty until it arrives
    std::uint64_t contribution_digest = 0, pose_digest = 0;
  };
  using Path = std::map<TimeNs, Keyframe>;

  /// Lenses of the robots' cameras; call before anything is added. Equidistant for robots that are not
  /// listed.
  void setLenses(std::map<std::string, lens::Spread> lenses) { lenses_ = std::move(lenses); }
  /// Returns true if the set changed.
  bool add(const Contribution& contribution);
  bool add(const KeyframePose& pose);

  const std::string& frame() const { return frame_; }
  /// Pose of a keyframe in the map. Null if there is none yet, or if it is invalid, in another frame or more
  /// than 1500 m away.
  const KeyframePose* poseOf(const Keyframe& keyframe) const;

  /// Camera error reported by a robot's latest pose in the map. All contributions of the robot are corrected
  /// for it once correctNext() has been called often enough.
  CameraErrorPpm cameraError(const std::string& robot) const;
  /// Corrects the next contributions that are out of date after a change of the camera error, at most that
  /// many. Returns them in order of robot and time.
  std::vector<std::pair<std::string, TimeNs>> correctNext(std::size_t at_most);

  const std::map<std::string, Path>& robots() const { return robots_; }
  const Path* find(const std::string& robot) const;
  const Keyframe* find(const std::string& robot, TimeNs acquired_ns) const;
  std::size_t contributions() const { return contributions_; }
  std::size_t poses() const { return poses_; }

 private:
  void noteCameraError(const std::string& robot);
  std::shared_ptr<const Contribution> withoutError(const std::shared_ptr<const Contribution>& seen) const;

  std::string frame_;
  std::map<std::string, lens::Spread> lenses_;
  std::map<std::string, Path> robots_;
  std::map<std::string, CameraErrorPpm> errors_;  ///< errors to correct for; none: zero
  std::map<std::string, TimeNs>
      uncorrected_from_;  ///< time from which contributions are still to be corrected
  std::size_t contributions_ = 0, poses_ = 0;
};

}  // namespace omnifleet::occupancy
