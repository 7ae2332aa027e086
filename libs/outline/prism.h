#pragma once

#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/support_function.h"
#include "options/options.h"

namespace omnifleet::outline {

/// One silhouette on the floor, seen by one camera.
struct PrismView {
  Pose2 map_from_base;
  Eigen::Vector2d foot_m = Eigen::Vector2d::Zero();  ///< foot of the camera, base_link
  double camera_height_m = 0.0;                      ///< H; 0: a laser, which measures the footprint itself
  SupportFunction supports;                          ///< about the foot, directions in base_link
  /// The sides look like the floor, so only the top face is segmented. Its projection on the floor is s times
  /// as far from the foot as the footprint, on the contact side too (docs/methods/global_merger.md).
  bool top_face_only = false;

  /// Increase of a support b per metre of height: q in h_P(n) = n·c + b − h·q.
  double perHeight(double support_m) const {
    const bool is_of_top = camera_height_m > 0 && (top_face_only || support_m > 0);
    return is_of_top ? support_m / camera_height_m : 0.0;
  }
};

struct PrismOptions {
  int directions = 96;          ///< support directions of the fitted footprint, in map
  double noise_m = 0.001;       ///< m, added to every σ in quadrature
  double pose_sigma_m = 0.004;  ///< m, σ of a shift of a whole view (errors of pose and lens)
  double robust_sigmas = 2.0;   ///< σ, larger residuals lose weight (Cauchy)
  int iterations = 12;          ///< at most
  int max_views = 32;           ///< the most informative views, taken from all sides
  double max_height_share =
      0.95;  ///< share of the lowest camera's height; the top of a taller object is not visible
  double vertex_penalty = 4.0;  ///< χ² that a vertex must save; 0: half-planes alone
  double max_gap_deg = 100.0;   ///< degrees without evidence from which a free outline counts as open
  bool plain_shapes = true;     ///< prefer a rectangle or a disc that explains the views equally well
  /// Share of directions with evidence from which a rectangle or a disc closes an open outline. 0.39 is the
  /// share from one view of an object that fills 40° and whose top is not visible.
  double min_coverage = 0.36;

  static PrismOptions read(const options::Section& section);
};

/// Height known before the views are compared; σ ≤ 0: unknown.
struct HeightPrior {
  double height_m = 0.0;
  double sigma_m = 0.0;
};

/// Value of the fitted footprint's support function in one direction of the map frame.
struct DirectionEvidence {
  double support_m = 0.0;  ///< h_P(n) about `centre_m` of the fit
  double sigma_m = 0.0;    ///< ≤ 0: no view supports this direction
  int views = 0;           ///< number of views with a significant weight
};

struct PrismFit {
  bool valid = false;   ///< false: too few directions (an open outline), or no height
  Polygon footprint_m;  ///< map, convex, counter-clockwise
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();  ///< Steiner point, map
  Eigen::Matrix2d covariance =
      Eigen::Matrix2d::Identity();              ///< of the centre, including the uncertainty of the height
  double height_m = 0.0, height_sigma_m = 0.0;  ///< σ ≤ 0: unknown (far side not visible)
  double spread =
      0.0;  ///< rms of residual ÷ its σ, without robust weights; about 1 if all views show one body
  double rms_m = 0.0;     ///< of the residuals on the floor under the object, with robust weights
  double coverage = 0.0;  ///< share of directions with evidence
  std::vector<DirectionEvidence> evidence;  ///< size PrismOptions::directions; direction k = 2πk/K in map
  std::vector<double>
      view_rms_m;  ///< per given view, without robust weights: shows outlier views; −1: not used
};

/// Footprint and height from several views (docs/methods/local_mapper.md). With c the foot of the camera in
/// map, g(n) = h_P(n) − n·c and s = H/(H − h), a view's support is b(n) = g where g < 0 (contact side), s·g
/// otherwise (projection of the top). With 1/s = 1 − h/H every usable direction of every view gives
/// h_P(n) = n·c + b(n) − h·max(b(n), 0)/H,
/// which is linear in h. The height with the least variance between views is a linear least-squares problem,
/// with the mean h_P(n) of each direction eliminated and robust reweighting. Each view may also shift as a
/// whole within `pose_sigma_m`, which absorbs errors of pose, focal length and tilt. Directions with σ ≤ 0
/// are not used. In a view of a top face alone every direction gives h_P(n) = n·c + b − h·b/H.
/// If the views and `prior` give little information on h, convexity does: at the two tangents from the foot
/// too large a height would make the footprint non-convex. The footprint is the polygon whose support
/// function is closest to the averages (intersection of half-planes, with their common inward bias removed).
/// A rectangle or a disc with its own height replaces it if it explains the views equally well (robust χ²
/// plus `vertex_penalty`/2 per parameter, plain_shape.h).
PrismFit fitPrism(const std::vector<PrismView>& views, const PrismOptions& options,
                  const HeightPrior& prior = {});

/// A known body: its footprint in its own frame (about its origin) and its height.
struct KnownBody {
  Polygon outline_m;
  double height_m = 0.0;
  bool round = false;  ///< a circle about the origin: no heading
};

struct BodyFit {
  bool valid = false;
  Pose2 map_from_body;
  double rms_m = 0.0;  ///< m on the floor under the body; below 5 cm it is a robot
};

/// Position, and heading unless round, of a known body that best explains the views: the prism model with
/// known footprint and height (docs/methods/classifier.md). A finite `guess_heading_rad` limits the search to
/// its surroundings; otherwise all headings are tried.
BodyFit fitBody(const std::vector<PrismView>& views, const KnownBody& body, const PrismOptions& options,
                double guess_heading_rad);

/// Steiner point in map of a footprint seen by one view, at a given height. Returns false if the usable
/// directions cover less than three quarters of a turn.
bool steinerPoint(const PrismView& view, double height_m, Eigen::Vector2d& centre_m);

/// Support function that a camera at `view` observes of a prism, in closed form, for predictions and tests.
/// Directions are those of the view's base_link. `view.supports` is ignored.
SupportFunction prismSupports(const Polygon& footprint_m, double height_m, const PrismView& view,
                              double sigma_m, int directions = SupportFunction::kDirections);

}  // namespace omnifleet::outline
