#include "laser/facing_side.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace omnifleet::laser {
namespace {

constexpr int kDirections = SupportFunction::kDirections;

Eigen::Vector2d unit(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad)};
}
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// A vertex of the chain with its uncertainty.
struct Vertex {
  Eigen::Vector2d at;
  double sigma_m = 0.0;                             ///< of the lines that meet there
  Eigen::Vector2d along = Eigen::Vector2d::Zero();  ///< direction of the face that ends here; zero at corners
  double along_sigma_m = 0.0;                       ///< σ of the end along the face
};

struct Circle {
  Eigen::Vector2d centre;
  double radius_m, squares_m2;
  Eigen::Matrix3d covariance_per_variance;  ///< of (x, y, radius)
};

double lineSigma(const Piece& piece, double range_sigma_m) {
  // σ at the end of a line through N points: √(1/N + 3/N) σ.
  return 2.0 * range_sigma_m / std::sqrt(static_cast<double>(piece.count()));
}

/// The end of a face: half a beam beyond the last echo, where it ends on average; at the last echo if the end
/// is hidden.
Vertex endOf(const Beam& beam, const Piece& piece, double spacing_rad, bool after, bool hidden,
             double range_sigma_m) {
  constexpr double kGrazing = 0.17;  // sine of 10°: flatter faces are not extended
  const Eigen::Vector2d on_line = piece.mean_m + piece.along * piece.along.dot(beam.point_m - piece.mean_m);
  const Eigen::Vector2d ray = unit(beam.bearing_rad + (after ? 0.5 : -0.5) * spacing_rad);
  const double sine = std::abs(cross(ray, piece.along));
  Vertex end{on_line, lineSigma(piece, range_sigma_m), piece.along,
             beam.range_m * spacing_rad / std::max(sine, kGrazing) / std::sqrt(12.0)};
  if (!hidden && sine >= kGrazing)
    end.at = ray * (cross(piece.mean_m, piece.along) / cross(ray, piece.along));
  return end;
}

void chainVertices(const Beams& beams, const Segment& segment, const std::vector<Piece>& pieces,
                   double range_sigma_m, std::vector<Vertex>& vertices) {
  vertices.clear();
  vertices.push_back(endOf(beams.at(segment.first), pieces.front(), beams.spacing_rad, false,
                           segment.hidden_before, range_sigma_m));
  for (std::size_t i = 0; i + 1 < pieces.size(); ++i) {
    const Piece &a = pieces[i], &b = pieces[i + 1];
    const double angle = std::max(0.3, std::abs(std::sin(bulge(a, b))));
    const double sigma = std::max(lineSigma(a, range_sigma_m), lineSigma(b, range_sigma_m)) / angle;
    vertices.push_back({corner(beams, segment, a, b), sigma, Eigen::Vector2d::Zero(), 0.0});
  }
  vertices.push_back(endOf(beams.at(segment.first + segment.count - 1), pieces.back(), beams.spacing_rad,
                           true, segment.hidden_after, range_sigma_m));
}

/// Supports of the chain's vertices, usable where the supporting vertex faces the scanner and is not a hidden
/// end.
void chainSupports(const std::vector<Vertex>& vertices, const Segment& segment, double floor_m,
                   SupportFunction& supports) {
  const Eigen::Vector2d first = vertices.front().at.normalized(), last = vertices.back().at.normalized();
  for (int k = 0; k < kDirections; ++k) {
    const Eigen::Vector2d n = unit(2.0 * M_PI * k / kDirections);
    if (n.dot(first) > 0.0 || n.dot(last) > 0.0) continue;
    std::size_t best = 0;
    for (std::size_t i = 1; i < vertices.size(); ++i) {
      if (n.dot(vertices[i].at) > n.dot(vertices[best].at)) best = i;
    }
    if ((best == 0 && segment.hidden_before) || (best + 1 == vertices.size() && segment.hidden_after))
      continue;
    const Vertex& v = vertices[best];
    const double along = n.dot(v.along) * v.along_sigma_m;
    supports.b_m[static_cast<std::size_t>(k)] = static_cast<float>(n.dot(v.at));
    supports.sigma_m[static_cast<std::size_t>(k)] =
        static_cast<float>(std::sqrt(floor_m * floor_m + v.sigma_m * v.sigma_m + along * along));
  }
}

/// Gauss–Newton on the distances from the circle, starting from Kåsa's algebraic fit (1976). Nothing if the
/// echoes are not an arc that is convex towards the scanner.
std::optional<Circle> fitCircle(const Beams& beams, const Segment& segment, double max_radius_m) {
  constexpr double kLeastRadius_m = 0.02;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  const Eigen::Vector2d origin = beams.at(segment.first + segment.count / 2).point_m;
  for (std::size_t i = 0; i < segment.count; ++i) {
    const Eigen::Vector2d p = beams.at(segment.first + i).point_m - origin;
    const Eigen::Vector3d row(2.0 * p.x(), 2.0 * p.y(), 1.0);
    normal += row * row.transpose();
    rhs += row * p.squaredNorm();
  }
  const Eigen::Vector3d start = normal.ldlt().solve(rhs);
  Circle circle{start.head<2>(), std::sqrt(std::max(0.0, start(2) + start.head<2>().squaredNorm())), 0.0, {}};
  for (int iteration = 0; iteration < 6; ++iteration) {
    if (!circle.centre.allFinite() || circle.radius_m < kLeastRadius_m || circle.radius_m > max_radius_m)
      return std::nullopt;
    normal.setZero();
    rhs.setZero();
    circle.squares_m2 = 0.0;
    for (std::size_t i = 0; i < segment.count; ++i) {
      const Eigen::Vector2d from = beams.at(segment.first + i).point_m - origin - circle.centre;
      const double distance = std::max(1e-9, from.norm()), residual = distance - circle.radius_m;
      const Eigen::Vector3d row(from.x() / distance, from.y() / distance, 1.0);
      normal += row * row.transpose();
      rhs += row * residual;
      circle.squares_m2 += residual * residual;
    }
    const Eigen::Vector3d step = normal.ldlt().solve(rhs);
    if (!step.allFinite()) return std::nullopt;
    circle.centre += step.head<2>();
    circle.radius_m += step(2);
  }
  circle.covariance_per_variance = normal.inverse();
  circle.centre += origin;
  const bool sane = circle.covariance_per_variance.allFinite() && circle.radius_m >= kLeastRadius_m &&
                    circle.radius_m <= max_radius_m && circle.centre.norm() > circle.radius_m &&
                    circle.centre.norm() > origin.norm();
  return sane ? std::optional<Circle>(circle) : std::nullopt;
}

void circleSupports(const Circle& circle, const Beams& beams, const Segment& segment, double range_sigma_m,
                    double floor_m, SupportFunction& supports) {
  const double from = beams.at(segment.first).bearing_rad;
  const double to = beams.at(segment.first + segment.count - 1).bearing_rad;
  for (int k = 0; k < kDirections; ++k) {
    const Eigen::Vector2d n = unit(2.0 * M_PI * k / kDirections);
    const double b = n.dot(circle.centre) + circle.radius_m;
    if (b > 0.0) continue;
    const Eigen::Vector2d at = circle.centre + circle.radius_m * n;
    const double bearing = std::atan2(at.y(), at.x());
    if (segment.hidden_before && wrapAngle(bearing - from) < 0.0) continue;
    if (segment.hidden_after && wrapAngle(bearing - to) > 0.0) continue;
    const Eigen::Vector3d by(n.x(), n.y(), 1.0);
    const double variance = range_sigma_m * range_sigma_m * by.dot(circle.covariance_per_variance * by);
    supports.b_m[static_cast<std::size_t>(k)] = static_cast<float>(b);
    supports.sigma_m[static_cast<std::size_t>(k)] =
        static_cast<float>(std::sqrt(floor_m * floor_m + variance));
  }
}

/// The arc between its first and last echo.
void arcOutline(const Circle& circle, const Beams& beams, const Segment& segment,
                std::vector<Eigen::Vector2d>& out) {
  constexpr int kPoints = 12;
  const Eigen::Vector2d a = beams.at(segment.first).point_m - circle.centre;
  const Eigen::Vector2d b = beams.at(segment.first + segment.count - 1).point_m - circle.centre;
  const double start = std::atan2(a.y(), a.x()), turn = std::atan2(cross(a, b), a.dot(b));
  out.clear();
  for (int i = 0; i < kPoints; ++i)
    out.emplace_back(circle.centre + circle.radius_m * unit(start + turn * i / (kPoints - 1)));
}

Eigen::Vector2d nearestOf(const std::vector<Eigen::Vector2d>& outline) {
  Eigen::Vector2d nearest = outline.front();
  for (std::size_t i = 0; i + 1 < outline.size(); ++i) {
    const Eigen::Vector2d along = outline[i + 1] - outline[i];
    const double share = std::clamp(-outline[i].dot(along) / std::max(1e-12, along.squaredNorm()), 0.0, 1.0);
    const Eigen::Vector2d at = outline[i] + share * along;
    if (at.norm() < nearest.norm()) nearest = at;
  }
  return nearest;
}

}  // namespace

void facingSide(const Beams& beams, const Segment& segment, const std::vector<Piece>& pieces,
                double range_sigma_m, const FacingSideOptions& options, FacingSide& side) {
  std::vector<Vertex> vertices;
  chainVertices(beams, segment, pieces, range_sigma_m, vertices);
  side.supports.b_m.assign(kDirections, 0.0f);
  side.supports.sigma_m.assign(kDirections, 0.0f);
  double squares = 0.0;
  for (const Piece& piece : pieces) squares += piece.squares_m2;
  const double variance = range_sigma_m * range_sigma_m, each = std::log(static_cast<double>(segment.count));
  const double by_faces = squares / variance + 2.0 * static_cast<double>(pieces.size()) * each;
  const auto circle = fitCircle(beams, segment, options.max_radius_m);
  side.round = circle && circle->squares_m2 / variance + 3.0 * each < by_faces;
  side.outline_m.clear();
  if (side.round) {
    circleSupports(*circle, beams, segment, range_sigma_m, options.floor_m, side.supports);
    arcOutline(*circle, beams, segment, side.outline_m);
  } else {
    chainSupports(vertices, segment, options.floor_m, side.supports);
    for (const Vertex& vertex : vertices) side.outline_m.push_back(vertex.at);
  }
  side.mean_m.setZero();
  for (std::size_t i = 0; i < segment.count; ++i)
    side.mean_m += beams.at(segment.first + i).point_m / static_cast<double>(segment.count);
  side.nearest_m = nearestOf(side.outline_m);
  side.length_m = (vertices.back().at - vertices.front().at).norm();
}

}  // namespace omnifleet::laser
