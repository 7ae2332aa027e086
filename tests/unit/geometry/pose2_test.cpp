#include "geometry/pose2.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace omnifleet {
namespace {

Eigen::Matrix3d matrix(const Pose2& p) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
  m.topLeftCorner<2, 2>() = p.rotation();
  m.topRightCorner<2, 1>() = p.translation();
  return m;
}

TEST(WrapAngle, ReturnsAngleInHalfOpenInterval) {
  EXPECT_EQ(wrapAngle(M_PI), M_PI);
  EXPECT_NEAR(wrapAngle(-M_PI), M_PI, 1e-15) << "−π wraps to π";
  EXPECT_EQ(wrapAngle(0.0), 0.0);
  for (double a = -3.1; a <= 3.1; a += 0.31) {
    for (int turns = -5; turns <= 5; ++turns) EXPECT_NEAR(wrapAngle(a + 2 * M_PI * turns), a, 1e-13);
  }
}

TEST(Pose2, ComposesLikeHomogeneousMatrices) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(-3.0, 3.0);
  for (int i = 0; i < 50; ++i) {
    const Pose2 a{number(random), number(random), number(random)},
        b{number(random), number(random), number(random)};
    EXPECT_LT((matrix(a * b) - matrix(a) * matrix(b)).norm(), 1e-13);
    EXPECT_LT((matrix(a.inverse()) - matrix(a).inverse()).norm(), 1e-13);
    const Eigen::Vector2d p(number(random), number(random));
    EXPECT_LT(((a * p).homogeneous() - matrix(a) * p.homogeneous()).norm(), 1e-13);
    EXPECT_LT((Pose2::fromVector(a.vector()).vector() - a.vector()).norm(), 1e-15);
  }
  EXPECT_FALSE((Pose2{0, std::nan(""), 0}).isFinite());
}

// Compared with the spread of 200 000 perturbed compositions, whose standard error is about 1/√(2·200 000) =
// 0.16 %.
TEST(ComposeCovariance, MatchesSampledCovariance) {
  const Pose2 ab{0.4, -0.3, 0.8}, bc{1.1, 0.6, -0.5};
  Eigen::Matrix3d cov_ab, cov_bc;
  cov_ab << 4e-4, 1e-4, 2e-5, 1e-4, 3e-4, -1e-5, 2e-5, -1e-5, 1e-4;
  cov_bc << 2e-4, -5e-5, 0, -5e-5, 1e-4, 1e-5, 0, 1e-5, 2e-4;
  const Eigen::Matrix3d la = cov_ab.llt().matrixL(), lb = cov_bc.llt().matrixL();
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  constexpr int kSamples = 200000;
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector3d ea = la * Eigen::Vector3d(normal(random), normal(random), normal(random));
    const Eigen::Vector3d eb = lb * Eigen::Vector3d(normal(random), normal(random), normal(random));
    const Pose2 sample = (ab * Pose2::fromVector(ea)) * (bc * Pose2::fromVector(eb));
    const Eigen::Vector3d e = ((ab * bc).inverse() * sample).vector();
    sum += e * e.transpose();
  }
  const Eigen::Matrix3d expected = composeCovariance(cov_ab, bc, cov_bc);
  // Four standard errors, plus the second-order terms that the first-order formula omits (variance 1e-4
  // rad²).
  EXPECT_LT((sum / kSamples - expected).norm(), 0.01 * expected.norm());
}

TEST(RotationFromRpy, AppliesRollPitchYawInDegrees) {
  EXPECT_LT((rotationFromRpyDeg({0, 0, 90}) * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(),
            1e-15);
  EXPECT_LT((rotationFromRpyDeg({0, -90, 0}) * Eigen::Vector3d(0, 0, -1) - Eigen::Vector3d::UnitX()).norm(),
            1e-15);
  EXPECT_LT((rotationFromRpyDeg({90, 0, 0}) * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitZ()).norm(),
            1e-15);
  const Eigen::Matrix3d all = rotationFromRpyDeg({10, 20, 30});
  const Eigen::Matrix3d chain =
      rotationFromRpyDeg({0, 0, 30}) * rotationFromRpyDeg({0, 20, 0}) * rotationFromRpyDeg({10, 0, 0});
  EXPECT_LT((all - chain).norm(), 1e-15);
}

}  // namespace
}  // namespace omnifleet
