#pragma once

#include <Eigen/Core>
#include <vector>

#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::flow {

struct PointOptions {
  double max_sigma_m = 0.05;      ///< metres along the line of sight: less certain points are not reported
  double min_parallax_deg = 2.0;  ///< degrees between the two lines of sight
  double gate_px =
      1.5;  ///< pixels: a feature tracked back to within this distance of a last position is the same feature
  double sigmas = 3.0;  ///< σ by which two lines of sight may miss each other; beyond that the object moves
  double drift_px = 0.05;         ///< pixels: σ that every frame adds to the position of a tracked feature
  double baseline_sigma = 0.014;  ///< 1: systematic scale error of the distance from the wheels
  double turn_sigma_radpm = 0.1;  ///< rad/m: systematic turn error of one wheel per metre rolled
  int max_frames = 30;            ///< frames after which the track of a feature restarts
  static PointOptions read(const options::Section& section);
};

/// Features tracked over many frames, and the positions of their points in space
/// (docs/methods/local_mapper.md). Choi §IV.2: after removing the rotation, a static point at height h, seen
/// from height H, moves on the floor by −t·H/(H − h), so the length of the displacement gives h. This class
/// does the same in space, for any lens, also for rays at or above the horizon. The current line of sight and
/// that of the oldest frame in which the feature was seen intersect at the point (least squares along the
/// current one). The motion between them is the robot's own. A point whose lines miss each other by more than
/// their noise moves. σ along the line of sight follows from pixel noise, drift, and the covariance of the
/// motion.
/// The turn measured by wheels is not accurate enough: 2 % of one wheel are 1° in 20 cm. So the error per
/// metre rolled is estimated. Features of static objects lie in the plane of both lines of sight and the
/// baseline (epipolar constraint); robust least squares in each frame, a Kalman filter over the frames.
class PointTracks {
 public:
  /// @param camera must outlive this object
  PointTracks(const lens::Camera& camera, const PointOptions& options, double sigma_px);

  /// Begins the next frame, which the robot reached by `motion`. If `motion` is not valid, all tracks are
  /// discarded.
  void advance(const Motion& motion);
  /// Adds a feature of the previous frame that was tracked into this one.
  void follow(const Eigen::Vector2f& from_px, const Eigen::Vector2f& to_px);
  /// Call after the last follow(). Points in the order of follow(), σ = 0 where unknown; valid until the next
  /// call.
  const std::vector<ScenePoint>& points();
  /// Discards all tracks.
  void forget();

 private:
  /// Pose of the robot in `odom`, its own path since forget().
  struct Place {
    Pose2 odom_from_base;
    double variance_m2 = 0.0, variance_rad2 = 0.0;       ///< of the path so far, without systematic errors
    Eigen::Vector2d rolled_m = Eigen::Vector2d::Zero();  ///< distance rolled by both wheels so far
  };
  /// A line of sight in `odom`.
  struct Sight {
    Eigen::Vector3d in_base, from_m, direction;
    double rad_per_px = 0.0;
    Place from;
    void place(const Place& place, const lens::Camera& camera);
  };
  struct Track {
    Sight first, now;
    int frames = 0;  ///< 0: no track
  };

  bool sightOf(const Eigen::Vector2f& pixel, const Place& place, Sight& sight) const;
  bool find(const Eigen::Vector2f& from_px, Eigen::Vector2f& last_px, Track& track);
  double noiseOf(const Track& track, double range_ratio) const;
  bool isAboveFloor(const Track& track, double across_m) const;
  void learnTurn();
  void findConstraints();
  ScenePoint meet(const Track& track) const;

  const lens::Camera* camera_;
  PointOptions options_;
  double sigma_px_;
  Place places_[2];  ///< at the previous frame and at this one
  Eigen::Vector2d turn_radpm_ =
      Eigen::Vector2d::Zero();  ///< estimated correction of the turn per metre rolled, per wheel
  Eigen::Matrix2d turn_covariance_;
  double turn_sigma_rad_ = 0.0;                             ///< σ of the turn of the last step
  bool is_placed_ = false;                                  ///< the motion since the previous frame is known
  std::vector<Eigen::Vector2f> last_pixels_, next_pixels_;  ///< in the previous frame and in this one
  std::vector<Track> last_, next_;
  struct Constraint {
    double missed, per_rad,
        sigma;  ///< deviation from the epipolar plane (rad), its derivative by the turn, and its σ
  };
  std::vector<Constraint> constraints_;
  std::vector<ScenePoint> points_;
};

}  // namespace omnifleet::flow
