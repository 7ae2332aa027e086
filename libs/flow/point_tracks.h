#pragma once

#include <Eigen/Core>
#include <vector>

#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::flow {

struct PointOptions {
  double max_sigma_m = 0.05;      ///< metres along the line of sight: points less certain are not told
  double min_parallax_deg = 2.0;  ///< degrees between the two lines of sight
  double gate_px = 1.5;           ///< pixels: a feature followed back to this near its last place is the same
  double sigmas = 3.0;     ///< σ by which two lines of sight may pass each other: else the thing moves
  double drift_px = 0.05;  ///< pixels: σ that every frame adds to the place of a followed feature
  double baseline_sigma = 0.014;  ///< 1: lasting scale error of the way that the wheels tell
  double turn_sigma_radpm = 0.1;  ///< rad/m: lasting error of the turn that a wheel tells, per metre rolled
  int max_frames = 30;            ///< frames that a feature is followed before it starts anew
  static PointOptions read(const options::Section& section);
};

/// Features followed over many frames, and where their points are. docs/methods.md on Choi §IV.2: after
/// removing the rotation a static point at height h, seen from height H, moves on the floor by −t·H/(H − h),
/// so the displacement's length gives h. Here the same in space, for any lens and rays at or above the
/// horizon too: the line of sight of now and that of the oldest frame in which the feature was seen meet at
/// the point (least squares along the present one), the motion between them is the robot's own. What does not
/// meet within its noise moves. σ along the line of sight from pixels, drift, and the covariance of the
/// motion. Wheels know the turn too badly for that (2 % of one wheel are 1° in 20 cm). What they err by per
/// metre rolled is learned: features of standing things lie in the plane of both lines of sight and the way
/// between them (the epipolar constraint, robust least squares in each frame, a Kalman filter over the
/// frames).
class PointTracks {
 public:
  /// @param camera must outlive this
  PointTracks(const lens::Camera& camera, const PointOptions& options, double sigma_px);

  /// The next frame, which the robot has reached by `motion`. Where that is not valid all is forgotten.
  void advance(const Motion& motion);
  /// A feature of the frame before, seen again.
  void follow(const Eigen::Vector2f& from_px, const Eigen::Vector2f& to_px);
  /// After the last of them: their points in the order of follow(), σ 0 where not known; until the next call.
  const std::vector<ScenePoint>& points();
  /// Forgets all.
  void forget();

 private:
  /// Where the robot stands in `odom`, its own path since forget().
  struct Place {
    Pose2 odom_from_base;
    double variance_m2 = 0.0, variance_rad2 = 0.0;       ///< of the path until there, without what lasts
    Eigen::Vector2d rolled_m = Eigen::Vector2d::Zero();  ///< by both wheels until there
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
    int frames = 0;  ///< 0: none
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
  Place places_[2];                                       ///< in the frame before, and in this one
  Eigen::Vector2d turn_radpm_ = Eigen::Vector2d::Zero();  ///< learned: that each wheel tells too little
  Eigen::Matrix2d turn_covariance_;
  double turn_sigma_rad_ = 0.0;                             ///< of the last step
  bool is_placed_ = false;                                  ///< the motion from the frame before is known
  std::vector<Eigen::Vector2f> last_pixels_, next_pixels_;  ///< in the frame before, and in this one
  std::vector<Track> last_, next_;
  struct Constraint {
    double missed, per_rad, sigma;  ///< of the epipolar plane, rad; its derivative by the turn
  };
  std::vector<Constraint> constraints_;
  std::vector<ScenePoint> points_;
};

}  // namespace omnifleet::flow
