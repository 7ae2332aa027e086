#include "calibration/initial_guess.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

namespace omnifleet::calibration {
namespace {

Eigen::Vector3d idealRay(const Eigen::Vector2d& from_centre_px, double focal_px, bool pinhole) {
  if (pinhole) return Eigen::Vector3d(from_centre_px.x(), from_centre_px.y(), focal_px).normalized();
  const double radius = from_centre_px.norm(), theta = radius / focal_px;
  const double scale = radius > 0.0 ? std::sin(theta) / radius : 0.0;
  return {scale * from_centre_px.x(), scale * from_centre_px.y(), std::cos(theta)};
}

/// Mean squared angle between the rays and the directions of the board's corners, rad².
double misfit(const std::vector<Eigen::Vector2d>& plane_m, const std::vector<Eigen::Vector3d>& rays,
              const Eigen::Isometry3d& camera_from_board) {
  double sum = 0.0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d to = camera_from_board * Eigen::Vector3d(plane_m[i].x(), plane_m[i].y(), 0.0);
    const double angle = std::atan2(to.cross(rays[i]).norm(), to.dot(rays[i]));
    sum += angle * angle;
  }
  return sum / static_cast<double>(rays.size());
}

}  // namespace

Eigen::Isometry3d poseFromRays(const std::vector<Eigen::Vector2d>& plane_m,
                               const std::vector<Eigen::Vector3d>& rays) {
  const double unit_m = plane_m.back().norm();
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d x(plane_m[i].x() / unit_m, plane_m[i].y() / unit_m, 1.0), &r = rays[i];
    Eigen::Matrix3d cross;
    cross << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
    Eigen::Matrix<double, 3, 9> a;  // ray × (h1 X + h2 Y + h3), the columns of H in sequence
    a << cross * x.x(), cross * x.y(), cross;
    normal += a.transpose() * a;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> solver(normal);
  Eigen::Matrix3d h = Eigen::Map<const Eigen::Matrix3d>(solver.eigenvectors().col(0).data());
  double forward = 0.0;
  for (std::size_t i = 0; i < rays.size(); ++i)
    forward += rays[i].dot(h * Eigen::Vector3d(plane_m[i].x() / unit_m, plane_m[i].y() / unit_m, 1.0));
  if (forward < 0.0) h = -h;
  h /= 0.5 * (h.col(0).norm() + h.col(1).norm());
  Eigen::Matrix3d r;
  r << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = svd.matrixU() * sign * svd.matrixV().transpose();
  pose.translation() = unit_m * h.col(2);
  return pose;
}

InitialGuess findInitialGuess(const std::vector<View>& views, const Board& board, const Request& request) {
  const bool pinhole = request.projection == lens::Projection::kPinhole;
  const Eigen::Vector2d centre(0.5 * (request.image_width_px - 1), 0.5 * (request.image_height_px - 1));
  const std::vector<Eigen::Vector2d> plane_m = board.corners_m();
  double farthest_px = 0.0;
  for (const View& view : views)
    for (const Eigen::Vector2d& corner : view.corners_px)
      farthest_px = std::max(farthest_px, (corner - centre).norm());
  InitialGuess best;
  double least = std::numeric_limits<double>::infinity();
  // From a lens that sees its farthest corner at 170° from the axis to a long telephoto lens.
  for (double focal_px = farthest_px / 3.0; focal_px < 20.0 * farthest_px; focal_px *= 1.04) {
    InitialGuess guess{focal_px, {}};
    double sum = 0.0;
    for (const View& view : views) {
      std::vector<Eigen::Vector3d> rays;
      for (const Eigen::Vector2d& corner : view.corners_px)
        rays.push_back(idealRay(corner - centre, focal_px, pinhole));
      guess.camera_from_board.push_back(poseFromRays(plane_m, rays));
      sum += misfit(plane_m, rays, guess.camera_from_board.back()) * focal_px * focal_px;
    }
    if (sum < least) {
      least = sum;
      best = guess;
    }
  }
  return best;
}

}  // namespace omnifleet::calibration
