#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "outline/prism.h"
#include "outline/prism_terms.h"

namespace omnifleet::outline {
namespace {

using detail::Terms;

/// Support of the body's outline in every direction k for a heading.
std::vector<double> bodySupports(const KnownBody& body, const Terms& terms, double heading_rad) {
  const Eigen::Rotation2Dd body_from_map(-heading_rad);
  std::vector<double> supports;
  for (const auto& n : terms.normals)
    supports.push_back(detail::supportOf(body.outline_m, body_from_map * n));
  return supports;
}

/// Position of the body's origin from n·p = a − h·b − h_body(n), with Cauchy reweighting.
BodyFit placeAt(const Terms& terms, const KnownBody& body, const PrismOptions& options, double heading_rad) {
  const auto supports = bodySupports(body, terms, heading_rad);
  BodyFit fit;
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  double squares = 0.0, weights = 0.0;
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d rhs = Eigen::Vector2d::Zero();
    squares = weights = 0.0;
    for (std::size_t v = 0; v < terms.views(); ++v) {
      for (int k = 0; k < terms.directions; ++k) {
        const auto& term = terms.at(v, k);
        if (term.sigma <= 0) continue;
        const auto& n = terms.normals[static_cast<std::size_t>(k)];
        const double target = term.a - body.height_m * term.b - supports[static_cast<std::size_t>(k)];
        const double sigma =
            std::hypot(terms.sigmaAt(v, k, body.height_m, options.noise_m), options.pose_sigma_m);
        const double w = 1.0 / (sigma * sigma), off = target - n.dot(p);
        const double eased =
            round == 0 ? w : w / (1.0 + std::pow(off / (options.robust_sigmas * std::max(sigma, 0.01)), 2));
        squares += w * off * off;
        weights += w;
        normal += eased * n * n.transpose();
        rhs += eased * target * n;
      }
    }
    const double determinant = normal.determinant(), trace = normal.trace();
    if (!(determinant > 1e-3 * trace * trace)) return fit;  // the directions do not span the plane
    p = normal.ldlt().solve(rhs);
  }
  fit.valid = weights > 0 && p.allFinite();
  fit.rms_m = fit.valid ? std::sqrt(squares / weights) : 0.0;
  fit.map_from_body = {p.x(), p.y(), wrapAngle(heading_rad)};
  return fit;
}

bool isBetter(const BodyFit& a, const BodyFit& b) {
  return a.valid && (!b.valid || a.rms_m < b.rms_m);
}

/// Refines the best heading of a grid to 0.2°.
BodyFit refine(const Terms& terms, const KnownBody& body, const PrismOptions& options, BodyFit best,
               double step) {
  while (step > 0.0035 && best.valid) {
    step *= 0.5;
    const double heading = best.map_from_body.theta_rad;
    for (const double turn : {-step, step}) {
      const BodyFit fit = placeAt(terms, body, options, heading + turn);
      if (isBetter(fit, best)) best = fit;
    }
  }
  return best;
}

}  // namespace

BodyFit fitBody(const std::vector<PrismView>& views, const KnownBody& body, const PrismOptions& options,
                double guess_heading_rad) {
  const Terms all = detail::termsOf(views, options.directions, options.noise_m);
  if (all.views() == 0 || body.outline_m.size() < 3) return {};
  const Terms terms = detail::mostInformative(all, views, static_cast<std::size_t>(options.max_views));
  if (body.round) return placeAt(terms, body, options, 0.0);
  const bool guessed = std::isfinite(guess_heading_rad);
  const double step = guessed ? 0.1 : 2.0 * M_PI / 24;
  const int count = guessed ? 5 : 24;
  BodyFit best;
  for (int i = 0; i < count; ++i) {
    const double heading = guessed ? guess_heading_rad + step * (i - 2) : step * i;
    const BodyFit fit = placeAt(terms, body, options, heading);
    if (isBetter(fit, best)) best = fit;
  }
  return refine(terms, body, options, best, step);
}

}  // namespace omnifleet::outline
