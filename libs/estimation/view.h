#pragma once

// One silhouette in one frame, and the prism that explains it (docs/methods/local_mapper.md, "Silhouettes and
// prism views").
// With the footprint's support h_P, camera foot c, camera height H and object height h, in direction n:
//   g(n) = h_P(n) − n·c;  predicted silhouette support = g where g < 0 (contact side), s·g otherwise,
//   s = H / (H − h).

#include <Eigen/Core>
#include <vector>

#include "estimation/camera_error.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// Support of a silhouette about the camera's foot, for the directions 2πk/K in base_link; usable ones only
/// carry σ > 0. `sigma_m` already holds the factor for correlation.
struct View {
  Eigen::Vector2d foot_m = Eigen::Vector2d::Zero();  ///< c in base_link
  double camera_height_m = 0.0;                      ///< H; 0: a laser, whose silhouette is the footprint
  std::vector<double> b_m;
  std::vector<double> sigma_m;                  ///< 0 where unusable
  double sigma_factor = 1.0;                    ///< the factor for correlation that they hold
  double height_m = 0.0, height_sigma_m = 0.0;  ///< of the object as measured by flow; σ ≤ 0: unknown

  // The same as seen, and what the camera's error does to it; b_m and camera_height_m are what is left when
  // `error` is taken off.
  std::vector<double> seen_b_m;
  double seen_camera_height_m = 0.0;
  std::vector<CameraError> by_error;  ///< derivative of b as seen, direction by direction
  CameraError error = CameraError::Zero();

  static View from(const Track& track, const Eigen::Vector2d& foot_m, double camera_height_m,
                   double sigma_factor, const lens::Spread& lens);
  int usable() const;

  /// Takes another error of the camera off what was seen.
  void assume(const CameraError& other);
  /// b of a direction, and the camera's height, when another error is taken off.
  double seenWithout(std::size_t direction, const CameraError& other) const {
    return b_m[direction] - by_error[direction].dot(other - error);
  }
  double cameraHeight(const CameraError& other) const { return seen_camera_height_m * (1.0 - other(1)); }
  bool isCameras() const { return seen_camera_height_m > 0; }  ///< else a laser's: none of these errors

 private:
  CameraError derivativeAt(std::size_t direction, const lens::Spread& lens) const;
};

/// Smallest (H − h)/H that is taken seriously: an object up to the camera's own height has no finite shadow.
inline constexpr double kLeastInverseScale = 0.05;

/// 1 for a laser (H = 0), which does not look over the top of things.
inline double inverseScale(double height_m, double camera_height_m) {
  if (!(camera_height_m > 0)) return 1.0;
  const double value = 1.0 - height_m / camera_height_m;
  return value < kLeastInverseScale ? kLeastInverseScale : value;
}

/// Silhouette support of footprint support g about the camera's foot.
inline double silhouetteFromFootprint(double g, double inverse_scale) {
  return g < 0 ? g : g / inverse_scale;
}
/// Its inverse.
inline double footprintFromSilhouette(double b, double inverse_scale) {
  return b < 0 ? b : b * inverse_scale;
}

/// A support function between two grid directions is that of the corner where their half-planes meet:
/// value = wi·v[i] + wj·v[j]; derivative by angle = di·v[i] + dj·v[j].
struct Corner {
  int i, j;
  double wi, wj, di, dj;
};
/// The corners that the directions of a grid of `from`, turned, meet in a grid of `to`. Where every step of
/// the one is whole steps of the other, all lie alike between two directions: one sine and cosine for all.
class TurnedGrid {
 public:
  TurnedGrid() = default;
  TurnedGrid(double turn_rad, int from, int to);
  Corner at(int direction) const;

 private:
  double turn_rad_ = 0.0;
  int from_ = 1, to_ = 1;
  Corner first_{};
};

/// Least squares of h(n) ≈ w + n·p over the directions that are known: Steiner point p and half mean width w
/// of a footprint of which a part is known (exact where all directions are).
class PartialOutline {
 public:
  void add(const Eigen::Vector2d& n);
  /// False where the directions span too little to tell width from place.
  bool solve(const Eigen::Vector3d& sums, Eigen::Vector2d& centre, double& half_width) const;
  static Eigen::Vector3d row(const Eigen::Vector2d& n) { return {1.0, n.x(), n.y()}; }

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
};

/// The footprint of one view alone in base_link, affine in the object's height h: Steiner centre
/// (2/K)·Σ g(n)·n = centre − h·centre_by_height, half its mean width likewise.
struct Footprint {
  bool whole = false;   ///< 9 of 10 directions are usable; of a laser, which sees facing sides only, a third
  bool partly = false;  ///< a third: least squares over these
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero(), centre_by_height = Eigen::Vector2d::Zero();
  double half_width_m = 0.0, half_width_by_height = 0.0;

  explicit Footprint(const View& view);
  Eigen::Vector2d centre(double height_m) const { return centre_m - height_m * centre_by_height; }
};

/// Support of a convex body in its own frame and its derivative by angle.
class Body {
 public:
  explicit Body(const RobotBody& body);
  /// In the direction of a unit vector.
  double support(const Eigen::Vector2d& n, double* slope = nullptr) const;
  double height() const { return height_m_; }
  double reach() const { return reach_m_; }  ///< largest distance of the outline from base_link

 private:
  double radius_m_ = 0.0, height_m_ = 0.0, reach_m_ = 0.0;
  Polygon outline_;
};

/// Position of a body of known shape and orientation in base_link that explains a view, by Gauss–Newton from
/// `start`; rms of what remains, metres.
struct BodyFit {
  Eigen::Vector2d position_m;
  double rms_m;
};
BodyFit fitBody(const View& view, const Body& body, double orientation_rad, const Eigen::Vector2d& start_m);

}  // namespace omnifleet::estimation
