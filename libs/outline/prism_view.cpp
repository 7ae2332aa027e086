#include <cmath>

#include "outline/prism.h"
#include "outline/prism_terms.h"

namespace omnifleet::outline {

PrismOptions PrismOptions::read(const options::Section& section) {
  PrismOptions o;
  section.read("directions", o.directions, {12, 720});
  section.read("noise_m", o.noise_m, {1e-5, 0.1});
  section.read("pose_sigma_m", o.pose_sigma_m, {1e-5, 0.5});
  section.read("robust_sigmas", o.robust_sigmas, {0.1, 100});
  section.read("iterations", o.iterations, {1, 100});
  section.read("max_views", o.max_views, {1, 500});
  section.read("max_height_share", o.max_height_share, {0.01, 0.99});
  section.read("vertex_penalty", o.vertex_penalty, {0, 1000});
  section.read("max_gap_deg", o.max_gap_deg, {10, 170});
  section.read("plain_shapes", o.plain_shapes);
  section.read("min_coverage", o.min_coverage, {0.1, 1.0});
  section.finish();
  return o;
}

bool steinerPoint(const PrismView& view, double height_m, Eigen::Vector2d& centre_m) {
  // With all directions the Steiner point is 2·mean(h n). With missing directions: least squares of h ≈ mean
  // width + n·p.
  const detail::Terms terms = detail::termsOf({view}, SupportFunction::kDirections, 0.001);
  if (terms.views() == 0) return false;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  int usable = 0;
  for (int k = 0; k < terms.directions; ++k) {
    const auto& term = terms.at(0, k);
    if (term.sigma <= 0) continue;
    ++usable;
    const Eigen::Vector3d row(1.0, terms.normals[static_cast<std::size_t>(k)].x(),
                              terms.normals[static_cast<std::size_t>(k)].y());
    normal += row * row.transpose();
    rhs += (term.a - height_m * term.b) * row;
  }
  if (4 * usable < 3 * terms.directions) return false;
  centre_m = normal.ldlt().solve(rhs).tail<2>();
  return centre_m.allFinite();
}

SupportFunction prismSupports(const Polygon& footprint_m, double height_m, const PrismView& view,
                              double sigma_m, int directions) {
  const Pose2 base_from_map = view.map_from_base.inverse();
  const double scale =
      view.camera_height_m > 0 ? view.camera_height_m / (view.camera_height_m - height_m) : 1.0;
  Polygon silhouette;
  for (const auto& p : footprint_m) {
    const Eigen::Vector2d in_base = base_from_map * p;
    if (!view.top_face_only) silhouette.push_back(in_base);
    silhouette.push_back(view.foot_m + scale * (in_base - view.foot_m));
  }
  return SupportFunction::of(silhouette, view.foot_m, sigma_m, directions);
}

}  // namespace omnifleet::outline
