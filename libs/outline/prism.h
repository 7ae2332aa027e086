#pragma once

#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/support_function.h"
#include "options/options.h"

namespace omnifleet::outline {

/// One silhouette on the floor as one camera saw it.
struct PrismView {
  Pose2 map_from_base;
  Eigen::Vector2d foot_m = Eigen::Vector2d::Zero();  ///< foot of the camera, base_link
  double camera_height_m = 0.0;                      ///< H; 0: a laser, which sees the footprint itself
  SupportFunction supports;                          ///< about the foot, directions in base_link
  /// The sides look like the floor, and all of the silhouette is the top's: it lies s times as far from the
  /// foot on the contact side, too (docs/methods.md, "Tops alone").
  bool top_alone = false;

  /// By how much a support of b looks larger per metre of height: q in h_P(n) = n·c + b − h·q.
  double perHeight(double support_m) const {
    const bool is_of_top = camera_height_m > 0 && (top_alone || support_m > 0);
    return is_of_top ? support_m / camera_height_m : 0.0;
  }
};

struct PrismOptions {
  int directions = 96;             ///< support directions of the fitted footprint, in map
  double noise_m = 0.001;          ///< m, added to every σ (quadrature)
  double pose_sigma_m = 0.004;     ///< m, how far a view may be shifted as a whole (its pose and its lens)
  double robust_sigmas = 2.0;      ///< σ, residuals beyond it lose weight (Cauchy)
  int iterations = 12;             ///< at most
  int max_views = 32;              ///< the most telling ones from all sides are taken
  double max_height_share = 0.95;  ///< of the lowest camera's height: taller objects have no shadow edge
  double vertex_penalty = 4.0;     ///< χ² that a vertex must save to be drawn; 0: half-planes alone
  double max_gap_deg = 100.0;      ///< degrees without evidence beyond which a free outline is open
  bool plain_shapes = true;        ///< a rectangle or a disc is preferred where it explains the views as well
  /// Share of directions with evidence from which one closes an open outline: 0.39 is what one view tells of
  /// a thing that fills 40° of it and whose top is not seen.
  double min_coverage = 0.36;

  static PrismOptions read(const options::Section& section);
};

/// What is known of the height before the views are compared; σ ≤ 0: nothing.
struct HeightPrior {
  double height_m = 0.0;
  double sigma_m = 0.0;
};

/// Value of the fitted footprint's support function in one direction of the map frame.
struct DirectionEvidence {
  double support_m = 0.0;  ///< h_P(n) about `centre_m` of the fit
  double sigma_m = 0.0;    ///< ≤ 0: no view supports this direction
  int views = 0;           ///< with a weight that counts
};

struct PrismFit {
  bool valid = false;   ///< false: too few directions (an open outline) or no height
  Polygon footprint_m;  ///< map, convex, counter-clockwise
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();        ///< Steiner point, map
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of the centre, that of the height included
  double height_m = 0.0, height_sigma_m = 0.0;               ///< σ ≤ 0: unknown (no shadow edge seen)
  double spread =
      0.0;  ///< rms of residual ÷ its own σ, not reweighted: about 1 where all views show one body
  double rms_m = 0.0;     ///< of the residuals on the floor under the object, robustly weighted
  double coverage = 0.0;  ///< share of directions with evidence
  std::vector<DirectionEvidence> evidence;  ///< PrismOptions::directions of them, direction k = 2πk/K in map
  std::vector<double> view_rms_m;  ///< per given view, unweighted: an outlier shows; −1 where not used
};

/// Footprint and height from several views (docs/methods.md, "Support-function prism"). With c the foot of
/// the camera in map, g(n) = h_P(n) − n·c, s = H/(H − h): a view's support is b(n) = g where g < 0 (contact
/// side), s·g otherwise (the shadow of the top). With 1/s = 1 − h/H every usable direction of every view
/// gives
///     h_P(n) = n·c + b(n) − h·max(b(n), 0)/H,
/// linear in h, so the search in one dimension for the least variance between views is a linear least squares
/// with the mean h_P(n) of each direction eliminated; it is reweighted robustly. Moreover each view
/// may shift as a whole within `pose_sigma_m`, which takes up errors of pose, focal length and tilt.
/// Directions with σ ≤ 0 are not used. Of views of tops alone every direction gives h_P(n) = n·c + b − h·b/H.
/// Where the views say little about h and `prior` nothing, convexity does: at the two tangents from the foot
/// a too great height would fold the footprint. The footprint is the polygon whose support function is
/// nearest to the averages (half-planes intersected, their common inward bias returned); or, where that
/// explains the views as well (robust χ² plus `vertex_penalty`/2 per number), a rectangle or a disc with its
/// own height (plain_shape.h).
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
  double rms_m = 0.0;  ///< on the floor under the body; < 5 cm is a robot
};

/// Position (and heading unless round) of a known body that best explains the views: the same model
/// with the known body, solving position only (docs/methods.md, "Known bodies"). `guess_heading_rad` is tried
/// first where given (finite), else all round.
BodyFit fitBody(const std::vector<PrismView>& views, const KnownBody& body, const PrismOptions& options,
                double guess_heading_rad);

/// Steiner point of a footprint as one view shows it at a given height, map; false where the usable
/// directions span less than three quarters of a turn.
bool steinerPoint(const PrismView& view, double height_m, Eigen::Vector2d& centre_m);

/// What a camera at `view` would report for a prism: closed form, for predictions and tests. Directions as in
/// base_link of the view; `view.supports` is ignored.
SupportFunction prismSupports(const Polygon& footprint_m, double height_m, const PrismView& view,
                              double sigma_m, int directions = SupportFunction::kDirections);

}  // namespace omnifleet::outline
