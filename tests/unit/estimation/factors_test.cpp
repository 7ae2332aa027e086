// Residuals against numeric derivatives and against exact zeros at the truth.

#include <ceres/cost_function.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <random>

#include "estimation/factors.h"
#include "estimation/landmark.h"
#include "estimation/prism_factors.h"
#include "fleet_simulator.h"

namespace omnifleet::estimation {
namespace {

/// Largest difference between a factor's derivatives and central differences, relative to its largest
/// derivative.
double derivativeError(const ceres::CostFunction& cost, std::vector<Eigen::VectorXd> values) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  constexpr double kStep = 1e-7;  // small, so that the kinks of supports are not straddled
  const int rows = cost.num_residuals();
  std::vector<double*> blocks, outputs;
  std::vector<RowMajor> exact;
  for (auto& value : values) {
    blocks.push_back(value.data());
    exact.emplace_back(rows, value.size());
  }
  for (auto& jacobian : exact) outputs.push_back(jacobian.data());
  Eigen::VectorXd r(rows), plus(rows), minus(rows);
  cost.Evaluate(blocks.data(), r.data(), outputs.data());
  double worst = 0.0, largest = 0.0;
  for (std::size_t b = 0; b < values.size(); ++b) {
    largest = std::max(largest, exact[b].cwiseAbs().maxCoeff());
    for (Eigen::Index i = 0; i < values[b].size(); ++i) {
      const double at = values[b](i);
      values[b](i) = at + kStep;
      cost.Evaluate(blocks.data(), plus.data(), nullptr);
      values[b](i) = at - kStep;
      cost.Evaluate(blocks.data(), minus.data(), nullptr);
      values[b](i) = at;
      worst = std::max(worst, (exact[b].col(i) - (plus - minus) / (2 * kStep)).cwiseAbs().maxCoeff());
    }
  }
  return worst / largest;
}

Eigen::Matrix3d someCovariance() {
  Eigen::Matrix3d root;
  root << 0.01, 0.002, 0.0, 0.0, 0.02, 0.001, 0.0, 0.0, 0.03;
  return root * root.transpose();
}

View viewOf(const testing::Prism& prism, const Pose2& map_from_base, const Eigen::Vector2d& foot,
            double camera_height) {
  Track track;
  const Eigen::Vector2d c = map_from_base * foot;
  const double s = camera_height / (camera_height - prism.height_m);
  for (int k = 0; k < 96; ++k) {
    const double psi = 2.0 * M_PI * k / 96 + map_from_base.theta_rad;
    const Eigen::Vector2d n(std::cos(psi), std::sin(psi));
    const double g = prism.support(n) - n.dot(c);
    // Hull of the floor polygon and the scaled top.
    track.supports.b_m.push_back(static_cast<float>(std::max(g, s * g)));
    track.supports.sigma_m.push_back(0.004F);
  }
  return View::from(track, foot, camera_height, 1.0, {});
}

testing::Prism box(double x, double y, double turn, double height) {
  testing::Prism prism;
  const Pose2 at{x, y, turn};
  prism.outline_m = {at * Eigen::Vector2d(-0.15, -0.1), at * Eigen::Vector2d(0.15, -0.1),
                     at * Eigen::Vector2d(0.15, 0.1), at * Eigen::Vector2d(-0.15, 0.1)};
  prism.centre_m = {x, y};
  prism.height_m = height;
  return prism;
}

constexpr double kRounding = 1e-5;  // of differences over 1e-7 with residuals of some hundreds

TEST(Factors, DerivativesAgreeWithNumericDifferences) {
  const Pose2 measured{0.3, -0.1, 0.4}, offset{0.05, 0.02, -0.1};
  const Eigen::Vector3d a(1.0, 2.0, 3.0), b(1.4, 1.9, 3.3);
  const Eigen::Matrix2d small = someCovariance().topLeftCorner<2, 2>();
  EXPECT_LT(derivativeError(*absolutePoseFactor(measured, someCovariance(), offset), {a}), kRounding);
  EXPECT_LT(derivativeError(*absolutePositionFactor({0.2, 0.3}, small, offset), {a}), kRounding);
  EXPECT_LT(derivativeError(*relativePoseFactor(measured, someCovariance(), offset, measured), {a, b}),
            kRounding);
  WheelJacobian by_model;
  by_model << arcBiasJacobian(0.1, 0.14, 0.26), Eigen::Vector3d(0.01, 0.1, 0.15),
      Eigen::Vector3d(0.1, 0.0, -0.2), Eigen::Vector3d(-0.05, 0.1, 0.0);
  WheelModel model;
  model << 0.01, -0.02, 0.03, 0.1, 0.02;
  EXPECT_LT(derivativeError(*motionFactor(measured, someCovariance(), by_model, WheelModel::Constant(0.01)),
                            {a, b, model}),
            kRounding);
  DetectorModel detector;
  detector << 0.02, 0.03, -0.04, 0.9, 0.05, 0.08, 0.06, -0.02;
  const RangeBearingSight sight{{0.5, 0.2}, small, offset, {0.2, 0.01, -0.5}};
  EXPECT_LT(derivativeError(*rangeBearingPoseFactor(sight, measured), {a, b, detector}), kRounding);
  EXPECT_LT(derivativeError(*rangeBearingPointFactor(sight), {a, Eigen::Vector2d(1.5, 2.5), detector}),
            kRounding);
}

// The measurement of a detector with all errors of the model, computed by poses; seenAt() inverts it.
TEST(Factors, RangeBearingResidualVanishesForTheDetectorModel) {
  DetectorModel detector;
  detector << 0.02, 0.03, -0.04, 0.9, 0.05, 0.08, 0.06, -0.02;
  const Pose2 at{1.0, 2.0, 0.6};
  const Eigen::Vector3d twist(0.2, 0.0, -0.5);
  const Eigen::Vector2d target(3.1, 3.0);
  const double turned = twist.z() * detector(5);
  const Pose2 then =
      at *
      arc(twist.x() * detector(5) - 0.13 * turned, twist.x() * detector(5) + 0.13 * turned, 0.26).inverse();
  const Eigen::Vector2d d = then.inverse() * target - detector.tail<2>();
  const double range = d.norm(), beta = std::atan2(d.y(), d.x());
  const Eigen::Vector2d measured(range * (1.0 - 0.04 - 0.9 * (1.0 - std::cos(beta - 0.05))),
                                 beta + 0.02 + 0.015 * std::sin(2.0 * beta));
  const auto factor = rangeBearingPointFactor({measured, Eigen::Matrix2d::Identity(), {}, twist});
  const Eigen::Vector3d pose = at.vector();
  const double* parameters[] = {pose.data(), target.data(), detector.data()};
  Eigen::Vector2d residual;
  ASSERT_TRUE(factor->Evaluate(parameters, residual.data(), nullptr));
  EXPECT_LT(residual.norm(), 5e-4);  // first order in the lag: ½·0.08²·0.2·0.5 m and the turn
  EXPECT_LT((then * seenAt(measured, detector) - target).norm(), 1e-9);
  EXPECT_LT((at * seenAt(measured, detector, twist) - target).norm(), 2e-3);  // likewise, ½·(0.08·0.5)²·2 m
}

TEST(Factors, PrismDerivativesAgreeWithNumericDifferences) {
  const Pose2 viewpoint{0.1, 0.2, 0.7}, other{1.9, 0.1, 2.0};
  const auto prism = box(1.0, 0.4, 0.3, 0.2);
  const auto view = std::make_shared<const View>(viewOf(prism, viewpoint, {0.03, 0.01}, 0.5));
  auto shape = std::make_shared<Shape>();
  const Pose2 landmark_from_map = Pose2{1.01, 0.38, 0.05}.inverse();
  shape->begin(1.0);
  shape->add(*view, landmark_from_map * viewpoint, 0.2);
  shape->add(viewOf(prism, other, {0.0, 0.0}, 0.5), landmark_from_map * other, 0.2);
  shape->finish();
  CameraError camera;
  camera << 0.003, -0.006, 0.004, -0.002, 0.001;
  const Eigen::VectorXd size = Eigen::VectorXd::Constant(1, 1.013);
  const LandmarkViewFactor mark(view, shape, 48);
  // This pose is away from kinks (contact to far side, corner to corner).
  EXPECT_LT(derivativeError(mark, {Eigen::Vector3d(0.105, 0.203, 0.7012),
                                   Eigen::Vector4d(1.012, 0.383, 0.21, 0.057), camera, size}),
            kRounding);
  RobotBody body;
  body.footprint_m = {{-0.2, -0.1}, {0.2, -0.12}, {0.18, 0.1}, {-0.2, 0.11}};
  body.height_m = 0.2;
  const PeerViewFactor peer(view, std::make_shared<const Body>(body), Pose2{0.02, 0.01, 0.05}, 48);
  EXPECT_LT(derivativeError(peer, {Eigen::Vector3d(0.105, 0.203, 0.7012), Eigen::Vector3d(1.0, 0.41, 0.31),
                                   camera, size}),
            kRounding);
}

TEST(Factors, PrismResidualsVanishAtTheTruthFromEverySide) {
  const auto prism = box(1.0, 0.4, 0.3, 0.2);
  const Pose2 map_from_landmark{1.0, 0.4, 0.3};
  auto shape = std::make_shared<Shape>();
  shape->begin(1.0);
  for (int i = 0; i < 12; ++i) {  // views from all sides, so that A and Q combine several views
    const double a = i * M_PI / 6;
    const Pose2 at{1.0 + 0.9 * std::cos(a), 0.4 + 0.9 * std::sin(a), 0.4 * i};
    shape->add(viewOf(prism, at, {0, 0}, 0.5), map_from_landmark.inverse() * at, 0.2);
  }
  shape->finish();
  const Pose2 new_view{0.2, 1.1, -0.3};
  LandmarkViewFactor factor(std::make_shared<const View>(viewOf(prism, new_view, {0.0, 0.0}, 0.5)), shape,
                            96);
  const Eigen::Vector3d pose = new_view.vector();
  const Eigen::Vector4d mark(1.0, 0.4, 0.2, 0.3);
  const CameraError camera = CameraError::Zero();
  const double size = 1.0;
  const double* values[] = {pose.data(), mark.data(), camera.data(), &size};
  // Interpolated supports lie outside by up to edge/2 · tan(step/2) = 5 mm, only next to the four edge
  // normals.
  EXPECT_LT(factor.reweight(values), 0.002);
}

/// The residuals of a view of a box from 0.9 m: of a landmark, or of a robot whose body is not the box.
/// @param scale of all lengths, camera height included
Eigen::VectorXd residualsAtScale(double scale, bool of_robot) {
  const Pose2 at{0.2, 1.1, -0.3}, other{1.9, 0.1, 2.0}, map_from_landmark{1.0, 0.4, 0.3};
  const auto prism = box(1.0, 0.4, 0.3, 0.2);
  const auto view = std::make_shared<const View>(viewOf(prism, at, {0.0, 0.0}, 0.5));
  auto shape = std::make_shared<Shape>();
  shape->begin(1.0);
  shape->add(viewOf(prism, other, {0.0, 0.0}, 0.5), map_from_landmark.inverse() * other, 0.2);
  shape->finish();
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.22;
  const Eigen::Vector3d pose(scale * at.x_m, scale * at.y_m, at.theta_rad);
  const Eigen::Vector4d mark(scale * 1.0, scale * 0.4, scale * 0.2, 0.3);
  const Eigen::Vector3d peer(scale * 1.0, scale * 0.4, 0.3);
  CameraError camera = CameraError::Zero();
  camera(1) = 1.0 - scale;
  const double* values[] = {pose.data(), of_robot ? peer.data() : mark.data(), camera.data(), &scale};
  Eigen::VectorXd residuals(48);
  if (of_robot) {
    PeerViewFactor(view, std::make_shared<const Body>(body), {}, 48)
        .Evaluate(values, residuals.data(), nullptr);
  } else {
    LandmarkViewFactor(view, shape, 48).Evaluate(values, residuals.data(), nullptr);
  }
  return residuals;
}

TEST(Factors, ViewResidualsAreInvariantToScale) {
  // Views do not determine the scale: a lower camera with a smaller world gives the same residuals.
  for (const bool of_robot : {false, true}) {
    const Eigen::VectorXd whole = residualsAtScale(1.0, of_robot), smaller = residualsAtScale(0.97, of_robot);
    EXPECT_GT(whole.norm(), 0.1) << "residuals that the scale could reduce";
    EXPECT_LT((whole - smaller).norm(), 1e-9 * whole.norm());
  }
}

TEST(Factors, LaserViewsDoNotDependOnCameraErrors) {
  const Pose2 at{0.2, 1.1, -0.3}, nearby{0.22, 1.09, -0.29};
  const auto view = std::make_shared<const View>(viewOf(box(1.0, 0.4, 0.3, 0.2), at, {0.0, 0.0}, 0.0));
  auto shape = std::make_shared<Shape>();
  shape->begin(1.0);
  shape->add(*view, Pose2{1.0, 0.4, 0.3}.inverse() * nearby, 0.2);
  shape->finish();
  const LandmarkViewFactor factor(view, shape, 48);
  const auto rows = factor.num_residuals();
  const Eigen::Vector3d pose(at.x_m, at.y_m, at.theta_rad);
  const Eigen::Vector4d mark(1.0, 0.4, 0.2, 0.3);
  const double size = 1.0;
  const auto evaluate = [&](const CameraError& camera, Eigen::VectorXd& residuals) {
    const double* values[] = {pose.data(), mark.data(), camera.data(), &size};
    Eigen::MatrixXd derivatives = Eigen::MatrixXd::Zero(kCameraErrors, rows);  // columns: row-major rows
    double* outputs[] = {nullptr, nullptr, derivatives.data(), nullptr};
    factor.Evaluate(values, residuals.data(), outputs);
    return derivatives;
  };
  Eigen::VectorXd exact(rows), miscalibrated(rows);
  EXPECT_EQ(evaluate(CameraError::Zero(), exact).norm(), 0.0);
  evaluate(CameraError::Constant(0.1), miscalibrated);
  EXPECT_GT(exact.norm(), 0.1) << "residuals that the scale could reduce";
  EXPECT_EQ((exact - miscalibrated).norm(), 0.0);
}

TEST(Factors, WheelResidualsAreInvariantToScale) {
  const Pose2 measured{0.1, 0.0, 0.0};
  WheelJacobian by_model = WheelJacobian::Zero();
  by_model.leftCols<2>() = arcBiasJacobian(0.1, 0.1, 0.26);
  const auto factor = motionFactor(measured, someCovariance(), by_model);
  const auto residual = [&](double scale) {
    const Eigen::Vector3d from = Eigen::Vector3d::Zero(), to(scale * 0.11, scale * 0.004, 0.0);
    const WheelModel model(scale - 1.0, scale - 1.0, 0.0, 0.0, 0.0);
    const double* values[] = {from.data(), to.data(), model.data()};
    Eigen::Vector3d r;
    factor->Evaluate(values, r.data(), nullptr);
    return r;
  };
  EXPECT_GT(residual(1.0).norm(), 0.1);
  EXPECT_LT((residual(1.0) - residual(0.97)).norm(), 1e-9);
}

TEST(Factors, FrozenViewsScaleWithTheShape) {
  // Frozen at scale 1 and formed at scale 1.02: all support values are larger.
  const auto prism = box(1.0, 0.4, 0.3, 0.2);
  const Pose2 landmark_from_base = Pose2{1.0, 0.4, 0.0}.inverse() * Pose2{0.2, 1.1, -0.3};
  const View view = viewOf(prism, {0.2, 1.1, -0.3}, {0.0, 0.0}, 0.5);
  Shape shape;
  shape.begin(1.0);
  shape.freeze(view, landmark_from_base, 0.2, 1.0);
  shape.begin(1.0);
  shape.finish();
  const double before = shape.a(10);
  shape.begin(1.02);
  shape.finish();
  EXPECT_NEAR(shape.a(10), 1.02 * before, 1e-12);
  shape.freeze(view, landmark_from_base, 0.2, 1.02);  // the same outline at a larger scale:
  shape.begin(1.0);                                   // at the first scale it is smaller
  shape.finish();
  EXPECT_LT(shape.a(10), before);
  EXPECT_GT(shape.a(10), before / 1.02);
}

TEST(Factors, ArcsComposeAndFollowWheelBias) {
  const Pose2 whole = arc(0.3, 0.4, 0.26), half = arc(0.15, 0.2, 0.26);
  const Pose2 twice = half * half;  // constant curvature: two halves are the whole, exactly
  EXPECT_NEAR(whole.x_m, twice.x_m, 1e-12);
  EXPECT_NEAR(whole.y_m, twice.y_m, 1e-12);
  EXPECT_NEAR(whole.theta_rad, 0.1 / 0.26, 1e-12);
  const Eigen::Matrix<double, 3, 2> j = arcBiasJacobian(0.3, 0.4, 0.26);
  const Pose2 biased = arc(0.3 * 1.001, 0.4 * 0.998, 0.26);
  const Eigen::Vector3d e = j * Eigen::Vector2d(0.001, -0.002);
  const Pose2 first_order = whole * Pose2{e.x(), e.y(), e.z()};
  EXPECT_NEAR(biased.x_m, first_order.x_m, 5e-6);  // second order: (2e-3)² of 0.4 m
  EXPECT_NEAR(biased.y_m, first_order.y_m, 5e-6);
  EXPECT_NEAR(biased.theta_rad, first_order.theta_rad, 5e-6);
}

/// The support value of a point p is n·p, and so is that interpolated on a turned grid.
TEST(View, TurnedGridInterpolatesThePointExactly) {
  const Eigen::Vector2d p(0.3, -0.7);
  for (const auto& [from, to] : {std::pair(96, 96), std::pair(48, 96), std::pair(96, 36), std::pair(7, 96)}) {
    for (const double turn : {-9.1, -0.02, 0.0, 0.4, 3.3, 7.0}) {
      const TurnedGrid grid(turn, from, to);
      for (int i = 0; i < from; ++i) {
        const Corner c = grid.at(i);
        const auto support = [&, to = to](int k) {
          return p.dot(Eigen::Rotation2Dd(2.0 * M_PI * k / to) * Eigen::Vector2d::UnitX());
        };
        const double psi = turn + 2.0 * M_PI * i / from;
        const Eigen::Vector2d n(std::cos(psi), std::sin(psi)), along(-n.y(), n.x());
        ASSERT_NEAR(c.wi * support(c.i) + c.wj * support(c.j), n.dot(p), 1e-12) << turn << " " << i;
        ASSERT_NEAR(c.di * support(c.i) + c.dj * support(c.j), along.dot(p), 1e-12) << turn << " " << i;
        ASSERT_GE(c.wi, -1e-9) << "not between its neighbours: " << turn << " " << i;
        ASSERT_GE(c.wj, -1e-9) << "not between its neighbours: " << turn << " " << i;
      }
    }
  }
}

TEST(View, BodyIsFittedToItsSilhouette) {
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  testing::Prism peer;
  peer.centre_m = {0.9, -0.5};
  peer.radius_m = 0.15;
  peer.height_m = 0.3;
  const View view = viewOf(peer, Pose2{}, {0.0, 0.0}, 0.5);
  const BodyFit fit = fitBody(view, Body(body), 0.0, {1.05, -0.4});
  EXPECT_NEAR((fit.position_m - peer.centre_m).norm(), 0.0,
              1e-4);  // closed form: only the weights' rounding is left
  EXPECT_LT(fit.rms_m, 1e-4);
  const View other = viewOf(box(0.9, -0.5, 0.2, 0.1), Pose2{}, {0.0, 0.0}, 0.5);
  EXPECT_GT(fitBody(other, Body(body), 0.0, {0.9, -0.5}).rms_m, 0.05);  // below 5 cm is a robot
}

TEST(View, FootprintOfOneViewIsExactAtTheCorrectHeight) {
  const auto prism = box(0.8, 0.6, 0.5, 0.25);
  const Footprint footprint(viewOf(prism, Pose2{}, {0.0, 0.0}, 0.5));
  ASSERT_TRUE(footprint.whole);
  EXPECT_LT((footprint.centre(0.25) - prism.centre_m).norm(),
            1e-3);                                                   // 96 directions sum the integral to 1 mm
  EXPECT_GT((footprint.centre(0.10) - prism.centre_m).norm(), 0.1);  // error by a wrong height
}

}  // namespace
}  // namespace omnifleet::estimation
