#include "scan/keyframe_graph.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace omnifleet::scan {
namespace {

/// Residual and Jacobians by right perturbations of both poses.
struct Linearised {
  Eigen::Vector3d residual;
  Eigen::Matrix3d by_from, by_to;
};

Eigen::Matrix2d crossed() {
  return (Eigen::Matrix2d() << 0.0, -1.0, 1.0, 0.0).finished();
}

/// residual = vector of measured⁻¹ · (from⁻¹ · to).
Linearised linearise(const Pose2& from, const Pose2& to, const Pose2& measured) {
  const Pose2 between = from.inverse() * to, off = measured.inverse() * between;
  Linearised l;
  l.residual = {off.x_m, off.y_m, wrapAngle(off.theta_rad)};
  const Eigen::Matrix2d turned = measured.rotation().transpose();
  l.by_to.setZero();
  l.by_to.topLeftCorner<2, 2>() = turned * between.rotation();
  l.by_to(2, 2) = 1.0;
  l.by_from.setZero();
  l.by_from.topLeftCorner<2, 2>() = -turned;
  l.by_from.topRightCorner<2, 1>() = -turned * crossed() * between.translation();
  l.by_from(2, 2) = -1.0;
  return l;
}

}  // namespace

/// The normal equations at the present poses.
struct KeyframeGraph::System {
  Eigen::SparseMatrix<double> h;
  Eigen::VectorXd g;

  explicit System(const KeyframeGraph& graph) {
    const auto n = static_cast<Eigen::Index>(3 * graph.poses_.size());
    g = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(graph.constraints_.size() * 27 + static_cast<std::size_t>(n));
    const auto addBlock = [&](Id row, Id column, const Eigen::Matrix3d& block) {
      if (row < column) return;  // the lower triangle
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          if (row != column || i >= j)
            entries.emplace_back(static_cast<int>(3 * row) + i, static_cast<int>(3 * column) + j,
                                 block(i, j));
    };
    const double scale2 = graph.options_.robust_sigmas * graph.options_.robust_sigmas;
    for (const Constraint& c : graph.constraints_) {
      const bool absolute = c.from == kMap;
      const Linearised l =
          linearise(absolute ? Pose2{} : graph.poses_[c.from], graph.poses_[c.to], graph.corrected(c));
      const double chi2 = l.residual.dot(c.information * l.residual);
      const Eigen::Matrix3d information = c.information / (1.0 + chi2 / (3.0 * scale2));
      addBlock(c.to, c.to, l.by_to.transpose() * information * l.by_to);
      g.segment<3>(3 * c.to) -= l.by_to.transpose() * information * l.residual;
      if (absolute) continue;
      addBlock(c.from, c.from, l.by_from.transpose() * information * l.by_from);
      addBlock(c.to, c.from, l.by_to.transpose() * information * l.by_from);
      addBlock(c.from, c.to, l.by_from.transpose() * information * l.by_to);
      g.segment<3>(3 * c.from) -= l.by_from.transpose() * information * l.residual;
    }
    for (Eigen::Index i = 0; i < n; ++i) entries.emplace_back(i, i, 1e-9);
    h.resize(n, n);
    h.setFromTriplets(entries.begin(), entries.end());
  }
};

KeyframeGraph::Id KeyframeGraph::add(const Pose2& map_from_keyframe) {
  poses_.push_back(map_from_keyframe);
  return static_cast<Id>(poses_.size() - 1);
}

std::size_t KeyframeGraph::addRelative(Id from, Id to, const Pose2& from_to,
                                       const Eigen::Matrix3d& covariance, const CameraDependence* cameras) {
  constraints_.push_back({from, to, from_to, covariance.inverse(),
                          cameras == nullptr ? nullptr : std::make_shared<CameraDependence>(*cameras)});
  if (cameras == nullptr) return constraints_.size() - 1;
  const std::size_t count = std::max(cameras->from_camera, cameras->to_camera) + 1;
  if (cameras_.size() < count) cameras_.resize(count, Eigen::Vector4d::Zero());
  return constraints_.size() - 1;
}

void KeyframeGraph::setCamera(std::uint32_t camera, const Eigen::Vector4d& error) {
  if (cameras_.size() <= camera) cameras_.resize(camera + 1, Eigen::Vector4d::Zero());
  cameras_[camera] = error;
}

CameraDependence::Vector KeyframeGraph::errorsOf(const CameraDependence& cameras) const {
  CameraDependence::Vector errors;
  errors << cameras_[cameras.to_camera], cameras_[cameras.from_camera];
  return errors;
}

Pose2 KeyframeGraph::corrected(const Constraint& c) const {
  if (!c.cameras) return c.measured;
  const Eigen::Vector3d off = c.cameras->by_error * (errorsOf(*c.cameras) - c.cameras->assumed);
  return c.measured * Pose2{off.x(), off.y(), off.z()}.inverse();
}

CameraEvidence KeyframeGraph::cameraEvidence() const {
  CameraEvidence evidence;
  const auto n = static_cast<Eigen::Index>(4 * cameras_.size()),
             rows = static_cast<Eigen::Index>(3 * poses_.size());
  if (n == 0 || !solver_ || solver_->rows() != rows) return evidence;
  evidence.at.resize(n);
  for (std::size_t k = 0; k < cameras_.size(); ++k)
    evidence.at.segment<4>(static_cast<Eigen::Index>(4 * k)) = cameras_[k];
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(rows, n), information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(rows), gradient = Eigen::VectorXd::Zero(n);
  const double scale2 = options_.robust_sigmas * options_.robust_sigmas;
  for (const Constraint& c : constraints_) {
    const bool absolute = c.from == kMap;
    const Linearised l = linearise(absolute ? Pose2{} : poses_[c.from], poses_[c.to], corrected(c));
    const double chi2 = l.residual.dot(c.information * l.residual);
    const Eigen::Matrix3d weight = c.information / (1.0 + chi2 / (3.0 * scale2));
    g.segment<3>(3 * c.to) -= l.by_to.transpose() * weight * l.residual;
    if (!absolute) g.segment<3>(3 * c.from) -= l.by_from.transpose() * weight * l.residual;
    if (!c.cameras) continue;
    const CameraDependence& d = *c.cameras;
    const CameraDependence::Vector off = errorsOf(d) - d.assumed;
    const Eigen::Matrix<double, 8, 1> own = d.gradient - d.information * off,
                                      by_pose = -d.by_error.transpose() * weight * l.residual;
    const Eigen::Matrix<double, 8, 8> own_information =
        d.information + d.by_error.transpose() * weight * d.by_error;
    const Eigen::Index at[] = {4 * static_cast<Eigen::Index>(d.to_camera),
                               4 * static_cast<Eigen::Index>(d.from_camera)};
    for (int i = 0; i < 2; ++i) {
      const Eigen::Matrix<double, 3, 4> by = d.by_error.middleCols<4>(4 * i);
      gradient.segment<4>(at[i]) += own.segment<4>(4 * i) + by_pose.segment<4>(4 * i);
      cross.block<3, 4>(3 * c.to, at[i]) += l.by_to.transpose() * weight * by;
      if (!absolute) cross.block<3, 4>(3 * c.from, at[i]) += l.by_from.transpose() * weight * by;
      for (int k = 0; k < 2; ++k)
        information.block<4, 4>(at[i], at[k]) += own_information.block<4, 4>(4 * i, 4 * k);
    }
  }
  const Eigen::MatrixXd gain = solver_->solve(cross);
  evidence.information = information - cross.transpose() * gain;
  evidence.information = 0.5 * (evidence.information + evidence.information.transpose()).eval();
  evidence.gradient = gradient - gain.transpose() * g;
  return evidence;
}

void KeyframeGraph::addAbsolute(Id keyframe, const Pose2& map_from_keyframe,
                                const Eigen::Matrix3d& covariance) {
  constraints_.push_back({kMap, keyframe, map_from_keyframe, covariance.inverse(), nullptr});
}

KeyframeGraph::Appended KeyframeGraph::append(const KeyframeGraph& other, const Pose2& map_from_other) {
  const Appended first{static_cast<Id>(poses_.size()), constraints_.size()};
  for (const Pose2& pose : other.poses_) poses_.push_back(map_from_other * pose);
  if (cameras_.size() < other.cameras_.size())
    cameras_.resize(other.cameras_.size(), Eigen::Vector4d::Zero());
  for (Constraint c : other.constraints_) {
    c.to += first.pose;
    if (c.from == kMap) {
      c.measured = map_from_other * c.measured;
      c.information.setZero();
    } else {
      c.from += first.pose;
    }
    if (c.cameras) {
      for (const std::uint32_t camera : {c.cameras->from_camera, c.cameras->to_camera})
        cameras_[camera] = other.cameras_[camera];
    }
    constraints_.push_back(std::move(c));
  }
  return first;
}

double KeyframeGraph::optimise() {
  const std::vector<Pose2> before = poses_;
  for (int i = 0; i < options_.iterations && !poses_.empty(); ++i) {
    const System system(*this);
    const auto solver = std::make_shared<Solver>(system.h);
    const Eigen::VectorXd step = solver->solve(system.g);
    if (solver->info() != Eigen::Success || !step.allFinite()) break;
    solver_ = solver;
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      const Eigen::Vector3d d = step.segment<3>(static_cast<Eigen::Index>(3 * k));
      poses_[k] = poses_[k] * Pose2{d.x(), d.y(), d.z()};
    }
    if (step.cwiseAbs().maxCoeff() < options_.converged_m) break;
  }
  double moved = 0.0;
  for (std::size_t k = 0; k < poses_.size(); ++k)
    moved = std::max(moved, (poses_[k].translation() - before[k].translation()).norm());
  return moved;
}

Eigen::Matrix3d KeyframeGraph::covariance(Id keyframe) const {
  const auto at = static_cast<Eigen::Index>(3 * keyframe);
  Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(solver_->rows(), 3);
  unit.block<3, 3>(at, 0).setIdentity();
  const Eigen::MatrixXd columns = solver_->solve(unit);
  const Eigen::Matrix3d covariance = columns.block<3, 3>(at, 0);
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace omnifleet::scan
