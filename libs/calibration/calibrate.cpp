#include "calibration/calibrate.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "calibration/initial_guess.h"
#include "calibration/projection.h"
#include "lens/models.h"

namespace omnifleet::calibration {
namespace {

using lens::Projection;

/// Distance in pixels between a detected corner and the projection of its place on the board.
struct CornerError {
  Projection projection;
  Eigen::Vector2d corner_px, place_m;

  template <typename T>
  bool operator()(const T* intrinsics, const T* rotation, const T* translation, T* residual) const {
    const T place[3] = {T(place_m.x()), T(place_m.y()), T(0.0)};
    T ray[3];
    ceres::AngleAxisRotatePoint(rotation, place, ray);
    for (int i = 0; i < 3; ++i) ray[i] += translation[i];
    T pixel[2];
    if (!Projector<T>(projection, intrinsics).project(ray, pixel)) return false;
    residual[0] = pixel[0] - T(corner_px.x());
    residual[1] = pixel[1] - T(corner_px.y());
    return true;
  }
};

struct Parameters {
  std::array<double, kIntrinsics> intrinsics{};
  std::vector<std::array<double, 3>> rotation, translation;
};

/// Entries of the parameter block that stay fixed, because the projection does not use them. For ocam also e
/// of the affine part: a rotation of the camera about its axis compensates e by d and leaves every image
/// unchanged (OCamCalib estimates both).
std::vector<int> fixedEntries(Projection projection) {
  if (projection == Projection::kPinhole) return {};
  if (projection == Projection::kOcam) return {1};
  if (projection == Projection::kKannalaBrandt) return {8};
  return {4, 5, 6, 7, 8};
}

/// The ideal lens of findInitialGuess(), in the parameters of the projection. The ocam polynomial
/// approximates ρ = F·θ: z = ρ/tan(ρ/F) = F − ρ²/(3F) − ρ⁴/(45 F³) − …
std::array<double, kIntrinsics> ideal(const Request& request, double f) {
  const double cx = 0.5 * (request.image_width_px - 1), cy = 0.5 * (request.image_height_px - 1);
  if (request.projection != Projection::kOcam) return {f, f, cx, cy, 0, 0, 0, 0, 0};
  const double s = kOcamScale_px;
  return {1.0, 0.0, cx, cy, 0.0, -f, s / (3.0 * f), 0.0, s * s * s / (45.0 * f * f * f)};
}

Parameters parametersOf(const Request& request, const InitialGuess& guess) {
  Parameters p;
  p.intrinsics = ideal(request, guess.focal_px);
  for (const Eigen::Isometry3d& pose : guess.camera_from_board) {
    const Eigen::AngleAxisd turn(pose.rotation());
    const Eigen::Vector3d r = turn.angle() * turn.axis(), t = pose.translation();
    p.rotation.push_back({r.x(), r.y(), r.z()});
    p.translation.push_back({t.x(), t.y(), t.z()});
  }
  return p;
}

/// Least squares over all parameters. `fixed` lists the entries of the intrinsics that stay fixed.
bool solve(const std::vector<View>& views, const Board& board, Projection projection,
           const std::vector<int>& fixed, Parameters& p) {
  const std::vector<Eigen::Vector2d> places = board.corners_m();
  ceres::Problem problem;
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (std::size_t i = 0; i < places.size(); ++i) {
      auto* cost = new ceres::AutoDiffCostFunction<CornerError, 2, kIntrinsics, 3, 3>(
          new CornerError{projection, views[v].corners_px[i], places[i]});
      problem.AddResidualBlock(cost, nullptr, p.intrinsics.data(), p.rotation[v].data(),
                               p.translation[v].data());
    }
  }
  if (!fixed.empty()) problem.SetManifold(p.intrinsics.data(), new ceres::SubsetManifold(kIntrinsics, fixed));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.IsSolutionUsable();
}

lens::CameraModel modelOf(const Request& request, const std::array<double, kIntrinsics>& p) {
  lens::CameraModel model;
  model.projection = request.projection;
  model.kind =
      request.projection == Projection::kPinhole ? lens::CameraKind::kPinhole : lens::CameraKind::kFisheye;
  model.image_width_px = request.image_width_px;
  model.image_height_px = request.image_height_px;
  model.principal_point_px = {p[2], p[3]};
  if (request.projection == Projection::kOcam) {
    const double s = kOcamScale_px;
    model.distortion = {p[5], 0.0, p[6] / s, p[7] / (s * s), p[8] / (s * s * s), p[0], p[4], p[1]};
    // [row; column] = [c d; e 1]·[x'; y']
    return model;
  }
  model.focal_px = {p[0], p[1]};
  if (request.projection == Projection::kKannalaBrandt) model.distortion = {p[4], p[5], p[6], p[7]};
  if (request.projection == Projection::kPinhole) model.distortion = {p[4], p[5], p[6], p[7], p[8]};
  return model;
}

double outermostDeg(const Board& board, const std::vector<Eigen::Isometry3d>& poses) {
  double outermost = 0.0;
  for (const Eigen::Isometry3d& pose : poses) {
    for (const Eigen::Vector2d& place : board.corners_m()) {
      const Eigen::Vector3d ray = pose * Eigen::Vector3d(place.x(), place.y(), 0.0);
      outermost = std::max(outermost, std::atan2(ray.head<2>().norm(), ray.z()));
    }
  }
  return outermost / lens::kDegree;
}

/// The requested field of view, or 1.1 times the angle that the corners span, limited to the invertible
/// range.
void setField(const Request& request, double outermost_deg, lens::CameraModel& model) {
  if (request.fov_deg > 0.0) {
    model.fov_deg = request.fov_deg;
  } else if (request.projection != Projection::kPinhole) {
    model.fov_deg = std::min(std::floor(2.2 * outermost_deg * 100.0) / 100.0, lens::widestFovDeg(model));
  }
  lens::Lens::make(model);  // throws with the limit angle if the field of view is too wide
}

}  // namespace

Calibration calibrate(const std::vector<View>& views, const Board& board, const Request& request) {
  if (views.size() < 3)
    throw std::runtime_error(
        fmt::format("the board was found in {} images; at least 3 are needed", views.size()));
  Parameters p = parametersOf(request, findInitialGuess(views, board, request));
  // First an ideal lens: centre and focal length converge before distortion is estimated.
  std::vector<int> first{4, 5, 6, 7, 8};
  if (request.projection == Projection::kOcam) first = {0, 1, 4, 7};
  if (!solve(views, board, request.projection, first, p) ||
      !solve(views, board, request.projection, fixedEntries(request.projection), p))
    throw std::runtime_error("no lens of this projection fits the corners");
  Calibration result;
  result.model = modelOf(request, p.intrinsics);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Eigen::Vector3d r = Eigen::Map<const Eigen::Vector3d>(p.rotation[v].data());
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (r.norm() > 0.0) pose.linear() = Eigen::AngleAxisd(r.norm(), r.normalized()).toRotationMatrix();
    pose.translation() = Eigen::Map<const Eigen::Vector3d>(p.translation[v].data());
    result.camera_from_board.push_back(pose);
  }
  result.outermost_deg = outermostDeg(board, result.camera_from_board);
  setField(request, result.outermost_deg, result.model);
  return result;
}

double reprojectionRms_px(const lens::Lens& lens, const Board& board, const View& view,
                          const Eigen::Isometry3d& camera_from_board) {
  const std::vector<Eigen::Vector2d> places = board.corners_m();
  double sum = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto pixel =
        lens.pixelFromRay(camera_from_board * Eigen::Vector3d(places[i].x(), places[i].y(), 0.0));
    if (!pixel) return std::numeric_limits<double>::infinity();
    sum += (*pixel - view.corners_px[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(places.size()));
}

double reprojectionRms_px(const lens::Lens& lens, const Board& board, const std::vector<View>& views,
                          const std::vector<Eigen::Isometry3d>& camera_from_board) {
  double sum = 0.0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const double rms = reprojectionRms_px(lens, board, views[v], camera_from_board[v]);
    sum += rms * rms;
  }
  return std::sqrt(sum / static_cast<double>(views.size()));
}

}  // namespace omnifleet::calibration
