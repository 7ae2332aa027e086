#include "estimation/view.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::estimation {

View View::from(const Track& track, const Eigen::Vector2d& foot_m, double camera_height_m,
                double sigma_factor, const lens::Spread& lens) {
  View view;
  view.sigma_factor = sigma_factor;
  view.foot_m = foot_m;
  view.camera_height_m = camera_height_m;
  view.height_m = track.height_m;
  view.height_sigma_m = track.height_sigma_m;
  const std::size_t k = std::min(track.supports.b_m.size(), track.supports.sigma_m.size());
  view.b_m.resize(k);
  view.sigma_m.resize(k);
  for (std::size_t i = 0; i < k; ++i) {
    const float b = track.supports.b_m[i], sigma = track.supports.sigma_m[i];
    const bool good = std::isfinite(b) && std::isfinite(sigma) && sigma > 0.0F;
    view.b_m[i] = good ? static_cast<double>(b) : 0.0;
    view.sigma_m[i] = good ? sigma_factor * static_cast<double>(sigma) : 0.0;
  }
  view.seen_b_m = view.b_m;
  view.seen_camera_height_m = camera_height_m;
  view.by_error.assign(k, CameraError::Zero());
  for (std::size_t i = 0; i < k; ++i) {
    if (view.sigma_m[i] > 0) view.by_error[i] = view.derivativeAt(i, lens);
  }
  return view;
}

CameraError View::derivativeAt(std::size_t direction, const lens::Spread& lens) const {
  const std::size_t k = seen_b_m.size();
  const auto seen = [&](std::size_t i) { return sigma_m[i] > 0 ? seen_b_m[i] : std::nan(""); };
  return supportByCameraError({seen((direction + k - 1) % k), seen_b_m[direction], seen((direction + 1) % k)},
                              direction, k, seen_camera_height_m, lens);
}

void View::assume(const CameraError& other) {
  error = other;
  camera_height_m = cameraHeight(other);
  for (std::size_t i = 0; i < b_m.size(); ++i) {
    if (sigma_m[i] > 0) b_m[i] = seen_b_m[i] - by_error[i].dot(other);
  }
}

int View::usable() const {
  return static_cast<int>(std::count_if(sigma_m.begin(), sigma_m.end(), [](double s) { return s > 0; }));
}

namespace {

Corner cornerAt(double angle_rad, int directions) {
  const double step_rad = 2.0 * M_PI / directions;
  const double cotangent = 1.0 / std::tan(step_rad), inverse_sine = 1.0 / std::sin(step_rad);
  double turns = angle_rad / step_rad;
  turns -= directions * std::floor(turns / directions);
  const int i = static_cast<int>(turns) % directions;
  const double beyond = (turns - std::floor(turns)) * step_rad;
  const double sine = std::sin(beyond), cosine = std::cos(beyond);
  return {i,
          (i + 1) % directions,
          cosine - cotangent * sine,
          sine * inverse_sine,
          -cotangent * cosine - sine,
          cosine * inverse_sine};
}

}  // namespace

TurnedGrid::TurnedGrid(double turn_rad, int from, int to)
    : turn_rad_(turn_rad), from_(from), to_(to), first_(cornerAt(turn_rad, to)) {}

Corner TurnedGrid::at(int direction) const {
  if (to_ % from_ != 0) return cornerAt(turn_rad_ + 2.0 * M_PI * direction / from_, to_);
  const int shift = direction * (to_ / from_);
  Corner corner = first_;
  corner.i = (first_.i + shift) % to_;
  corner.j = (first_.j + shift) % to_;
  return corner;
}

void PartialOutline::add(const Eigen::Vector2d& n) {
  normal_ += row(n) * row(n).transpose();
}

bool PartialOutline::solve(const Eigen::Vector3d& sums, Eigen::Vector2d& centre, double& half_width) const {
  constexpr double kLeastDeterminant = 1e-4;  // per row; 0.25 for a whole turn, 0.0067 for a third
  const double rows = normal_(0, 0);
  if (!(rows > 0) || normal_.determinant() < kLeastDeterminant * rows * rows * rows) return false;
  const Eigen::Vector3d solution = normal_.ldlt().solve(sums);
  half_width = solution(0);
  centre = solution.tail<2>();
  return true;
}

Footprint::Footprint(const View& view) {
  const int k = static_cast<int>(view.b_m.size()), usable = view.usable();
  if (k < 3 || usable == 0) return;
  PartialOutline outline;
  Eigen::Vector3d sums = Eigen::Vector3d::Zero(), sums_by_height = Eigen::Vector3d::Zero();
  for (int i = 0; i < k; ++i) {
    if (view.sigma_m[static_cast<std::size_t>(i)] <= 0) continue;
    const double phi = 2.0 * M_PI * i / k, b = view.b_m[static_cast<std::size_t>(i)];
    const double q = view.isCameras() && b > 0 ? b / view.camera_height_m : 0.0;
    const Eigen::Vector3d row = PartialOutline::row({std::cos(phi), std::sin(phi)});
    outline.add(row.tail<2>());
    sums += b * row;
    sums_by_height += q * row;
  }
  const bool most = usable * 10 >= k * 9;
  if (most) {
    half_width_m = sums(0) / usable, half_width_by_height = sums_by_height(0) / usable;
    centre_m = 2.0 / usable * sums.tail<2>(), centre_by_height = 2.0 / usable * sums_by_height.tail<2>();
  }
  const bool facing = usable * 3 >= k && !most && outline.solve(sums, centre_m, half_width_m) &&
                      outline.solve(sums_by_height, centre_by_height, half_width_by_height) &&
                      half_width_m > 0;
  centre_m += view.foot_m;
  whole = most || (facing && !view.isCameras());
  partly = facing;
}

Body::Body(const RobotBody& body) : height_m_(body.height_m) {
  if (body.footprint_m.size() >= 3) {
    outline_ = body.footprint_m;
    for (const auto& p : outline_) reach_m_ = std::max(reach_m_, p.norm());
  } else {
    radius_m_ = reach_m_ = body.radius_m;
  }
}

double Body::support(const Eigen::Vector2d& n, double* slope) const {
  if (outline_.empty()) {
    if (slope != nullptr) *slope = 0.0;
    return radius_m_;
  }
  double best = -std::numeric_limits<double>::infinity();
  for (const auto& p : outline_) {
    const double value = n.dot(p);
    if (value <= best) continue;
    best = value;
    if (slope != nullptr) *slope = n.x() * p.y() - n.y() * p.x();
  }
  return best;
}

namespace {

/// One Gauss–Newton step with Cauchy weights; returns the weighted sum of squares and count.
struct Normal {
  Eigen::Matrix2d h = Eigen::Matrix2d::Zero();
  Eigen::Vector2d g = Eigen::Vector2d::Zero();
  double squares = 0.0, weight = 0.0;
};

Normal accumulate(const View& view, const Body& body, const Eigen::Matrix2d& body_from_base,
                  const Eigen::Vector2d& at) {
  constexpr double kOutlier_m = 0.03;  // residual at which a direction counts half
  const double inverse = inverseScale(body.height(), view.camera_height_m);
  const int k = static_cast<int>(view.b_m.size());
  Normal normal;
  for (int i = 0; i < k; ++i) {
    const double sigma = view.sigma_m[static_cast<std::size_t>(i)];
    if (sigma <= 0) continue;
    const double phi = 2.0 * M_PI * i / k;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    const double g = body.support(body_from_base * n) + n.dot(at - view.foot_m);
    const double r = view.b_m[static_cast<std::size_t>(i)] - silhouetteFromFootprint(g, inverse);
    const double unit = g < 0 ? 1.0 : inverse;  // residual on the scale of the footprint
    const double w = 1.0 / (1.0 + std::pow(r * unit / kOutlier_m, 2)) * std::pow(unit / sigma, 2);
    const double rf = r * unit;
    normal.h += w * n * n.transpose();
    normal.g += w * rf * n;
    normal.squares += w * rf * rf;
    normal.weight += w;
  }
  return normal;
}

}  // namespace

BodyFit fitBody(const View& view, const Body& body, double orientation_rad, const Eigen::Vector2d& start_m) {
  BodyFit fit{start_m, std::numeric_limits<double>::infinity()};
  const Eigen::Matrix2d body_from_base = Eigen::Rotation2Dd(-orientation_rad).toRotationMatrix();
  for (int iteration = 0; iteration < 5; ++iteration) {
    const Normal normal = accumulate(view, body, body_from_base, fit.position_m);
    if (normal.weight <= 0 || normal.h.determinant() < 1e-9 * normal.h.squaredNorm()) return fit;
    fit.position_m += normal.h.ldlt().solve(normal.g);
  }
  const Normal normal = accumulate(view, body, body_from_base, fit.position_m);
  // Plain, not weighted: what the weights hide is what tells another shape from this one.
  double squares = 0.0;
  int count = 0;
  const double inverse = inverseScale(body.height(), view.camera_height_m);
  const int k = static_cast<int>(view.b_m.size());
  for (int i = 0; i < k; ++i) {
    if (view.sigma_m[static_cast<std::size_t>(i)] <= 0) continue;
    const double phi = 2.0 * M_PI * i / k;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    const double g = body.support(body_from_base * n) + n.dot(fit.position_m - view.foot_m);
    squares += std::pow(footprintFromSilhouette(view.b_m[static_cast<std::size_t>(i)], inverse) - g, 2);
    ++count;
  }
  if (count >= 8 && normal.weight > 0) fit.rms_m = std::sqrt(squares / count);
  return fit;
}

}  // namespace omnifleet::estimation
