#include "evaluation/trajectory_metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "evaluation/shape.h"

namespace omnifleet::evaluation {
namespace {

std::vector<StampedPose> curve(int n) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < n; ++i) {
    const double t = 0.1 * i;
    poses.push_back({i * 200000000LL, Pose2{std::cos(t) + 0.3 * t, std::sin(1.3 * t), wrapAngle(1.7 * t)}});
  }
  return poses;
}

std::vector<StampedPose> moved(const Pose2& by, std::vector<StampedPose> poses) {
  for (StampedPose& pose : poses) pose.map_from_base = by * pose.map_from_base;
  return poses;
}

TEST(StatisticsOf, MatchesClosedFormsForSmallSamples) {
  const Statistics s = Statistics::of({3.0, 1.0, 2.0, 6.0});
  EXPECT_EQ(s.count, 4);
  EXPECT_EQ(s.mean, 3.0);
  EXPECT_EQ(s.median, 2.5);
  EXPECT_NEAR(s.rmse, std::sqrt(50.0 / 4), 1e-15);
  EXPECT_NEAR(s.std, std::sqrt(14.0 / 4), 1e-15);
  EXPECT_EQ(s.min, 1.0);
  EXPECT_EQ(s.max, 6.0);
  EXPECT_TRUE(std::isnan(Statistics::of({}).mean));
}

TEST(ComparePaths, MeasuresUnalignedErrorsAtEstimateTimes) {
  const std::vector<StampedPose> truth = curve(30);
  std::vector<StampedPose> estimate(truth.begin() + 5, truth.begin() + 15);
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    estimate[i].map_from_base.x_m += i % 2 ? 0.03 : -0.03;
    estimate[i].map_from_base.y_m += 0.04;
    estimate[i].map_from_base.theta_rad = wrapAngle(estimate[i].map_from_base.theta_rad + 0.1);
  }
  estimate.push_back({999'000'000'000, Pose2{}});
  const PathMetrics m = comparePaths(truth, estimate);
  EXPECT_EQ(m.poses, 10);
  EXPECT_EQ(m.outside, 1);
  EXPECT_EQ(m.truths, 30);
  EXPECT_NEAR(m.x_m, 0.03, 1e-12);
  EXPECT_NEAR(m.y_m, 0.04, 1e-12);
  EXPECT_NEAR(m.distance_m, 0.05, 1e-12);
  EXPECT_NEAR(m.rmse_m, 0.05, 1e-12);
  EXPECT_NEAR(m.heading_rad, 0.1, 1e-12);
}

TEST(PoseAt, InterpolatesOnlyOverShortGaps) {
  const std::vector<StampedPose> truth{{0, {0, 0, 3.1}}, {100, {1, 2, -3.1}}, {5'000'000'000, {5, 5, 0}}};
  Pose2 pose;
  ASSERT_TRUE(poseAt(truth, 25, 1'000'000'000, pose));
  EXPECT_NEAR(pose.x_m, 0.25, 1e-15);
  EXPECT_NEAR(pose.y_m, 0.5, 1e-15);
  EXPECT_NEAR(pose.theta_rad, 3.1 + 0.25 * (2 * M_PI - 6.2), 1e-12)
      << "interpolates along the shorter rotation";
  EXPECT_TRUE(poseAt(truth, 100, 0, pose));
  EXPECT_EQ(pose.x_m, 1.0);
  EXPECT_FALSE(poseAt(truth, 200, 1'000'000'000, pose)) << "a gap of five seconds is not interpolated";
  EXPECT_FALSE(poseAt(truth, -1, 1'000'000'000, pose));
  EXPECT_FALSE(poseAt(truth, 6'000'000'000, 1'000'000'000, pose));
  EXPECT_FALSE(poseAt({}, 0, 1, pose));
}

TEST(Ate, RemovesRigidMotionByAlignment) {
  const std::vector<StampedPose3> truth = lift(curve(40)),
                                  estimate = lift(moved({0.4, -0.7, 0.9}, curve(40)));
  const PosePairs pairs = associate(truth, estimate);
  ASSERT_EQ(pairs.truth.size(), 40u);
  EXPECT_GT(absoluteTrajectoryError(pairs, Alignment::kNone).rmse, 0.3);
  EXPECT_LT(absoluteTrajectoryError(pairs, Alignment::kSe2).max, 1e-12);
  EXPECT_LT(absoluteTrajectoryError(pairs, Alignment::kSe3).max, 1e-12);
  const RelativeError rpe = relativePoseError(pairs);
  EXPECT_LT(rpe.translation_m.max, 1e-12);
  EXPECT_LT(rpe.rotation_rad.max, 1e-7);
}

TEST(Ate, RemovesScaleAndSpatialRotationOnRequest) {
  const std::vector<StampedPose3> truth = lift(curve(40));
  std::vector<StampedPose3> estimate = truth;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  for (StampedPose3& pose : estimate)
    pose.position_m = 0.4 * (turn * pose.position_m) + Eigen::Vector3d(1, 2, 3);
  const PosePairs pairs = associate(truth, estimate);
  EXPECT_GT(absoluteTrajectoryError(pairs, Alignment::kSe3).rmse, 0.1);
  EXPECT_LT(absoluteTrajectoryError(pairs, Alignment::kSe3, true).max, 1e-12);
  EXPECT_NEAR(align(pairs.estimate, pairs.truth, Alignment::kSe3, true).scale, 2.5, 1e-12);
  EXPECT_GT(absoluteTrajectoryError(pairs, Alignment::kSe2, true).rmse, 0.1) << "SE2 has no tilt";
}

// The alignment is a least-squares solution: every small motion increases the error.
TEST(Ate, FindsOptimalAlignment) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 0.05);
  std::vector<StampedPose> bent = moved({0.4, -0.7, 0.9}, curve(40));
  for (StampedPose& pose : bent) pose.map_from_base.x_m += noise(random);
  const PosePairs pairs = associate(lift(curve(40)), lift(bent));
  const double best = absoluteTrajectoryError(pairs, Alignment::kSe2).rmse;
  const Similarity s = align(pairs.estimate, pairs.truth, Alignment::kSe2, false);
  for (const Pose2& nudge :
       {Pose2{1e-3, 0, 0}, Pose2{-1e-3, 0, 0}, Pose2{0, 1e-3, 0}, Pose2{0, 0, 1e-3}, Pose2{0, 0, -1e-3}}) {
    double squares = 0.0;
    for (std::size_t i = 0; i < pairs.truth.size(); ++i) {
      const Eigen::Vector3d p = s.rotation * pairs.estimate[i].position_m + s.translation;
      squares += (nudge * Eigen::Vector2d(p.head<2>()) - pairs.truth[i].position_m.head<2>()).squaredNorm();
    }
    EXPECT_GT(std::sqrt(squares / 40.0), best);
  }
}

TEST(Rpe, MeasuresConstantDriftPerStep) {
  std::vector<StampedPose> truth, estimate;
  for (int i = 0; i < 20; ++i) {
    truth.push_back({i, Pose2{0.1 * i, 0, 0}});
    estimate.push_back({i, Pose2{0.11 * i, 0, 0}});
  }
  const PosePairs pairs = associate(lift(truth), lift(estimate));
  EXPECT_NEAR(relativePoseError(pairs).translation_m.mean, 0.01, 1e-12);
  EXPECT_NEAR(relativePoseError(pairs, 4).translation_m.mean, 0.04, 1e-12);
  EXPECT_EQ(relativePoseError(pairs, 4).translation_m.count, 4);
}

TEST(Associate, MatchesNearestWithinLimit) {
  const auto at = [](TimeNs t) {
    return StampedPose3{t, Eigen::Vector3d(static_cast<double>(t), 0, 0), Eigen::Quaterniond::Identity()};
  };
  const PosePairs pairs = associate({at(0), at(10), at(20), at(30)}, {at(4), at(26), at(50)}, 5);
  ASSERT_EQ(pairs.truth.size(), 2u);
  EXPECT_EQ(pairs.truth[0].time_ns, 0);
  EXPECT_EQ(pairs.truth[1].time_ns, 30);
  EXPECT_TRUE(associate({}, {at(0)}).truth.empty());
}

TEST(ShapeDifference, IgnoresSimilarityAndReflection) {
  std::vector<Eigen::Vector2d> a, b;
  for (const StampedPose& pose : curve(25)) {
    a.push_back(pose.map_from_base.translation());
    const Eigen::Vector2d mirrored(-a.back().x(), a.back().y());
    b.push_back(3.7 * (Eigen::Rotation2Dd(1.1) * mirrored) + Eigen::Vector2d(5, -2));
  }
  EXPECT_NEAR(shapeDifference(a, b), 0.0, 1e-12);
}

/// Fernández et al. 2011 §IV.B word by word: the translation, scaling b, rotation and reflection of C with
/// the least squares to A, found without singular values: the best translation joins the centroids, the best
/// b is that of a line through the origin, and the angle is searched. μ is the rest, divided by that of b =
/// 0.
double searchedShapeDifference(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& c) {
  const auto meanOf = [](const std::vector<Eigen::Vector2d>& points) {
    Eigen::Vector2d sum(0, 0);
    for (const auto& p : points) sum += p;
    return Eigen::Vector2d(sum / static_cast<double>(points.size()));
  };
  const Eigen::Vector2d mean_a = meanOf(a), mean_c = meanOf(c);
  const auto restAt = [&](double angle, bool reflect) {
    double aa = 0.0, ac = 0.0, cc = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const Eigen::Vector2d p = a[i] - mean_a;
      Eigen::Vector2d q = c[i] - mean_c;
      if (reflect) q.x() = -q.x();
      q = Eigen::Vector2d(std::cos(angle) * q.x() - std::sin(angle) * q.y(),
                          std::sin(angle) * q.x() + std::cos(angle) * q.y());
      aa += p.squaredNorm(), ac += p.dot(q), cc += q.squaredNorm();
    }
    const double b = std::max(0.0, ac / cc);
    return (aa - 2.0 * b * ac + b * b * cc) / aa;
  };
  double best = 1.0;
  for (const bool reflect : {false, true}) {
    double centre = 0.0, half_width = M_PI;
    while (half_width > 1e-9) {  // the rest has one minimum per turn
      double least = 2.0, at = centre;
      for (int k = -10; k <= 10; ++k) {
        const double angle = centre + 0.1 * k * half_width, rest = restAt(angle, reflect);
        if (rest < least) least = rest, at = angle;
      }
      best = std::min(best, least);
      centre = at;
      half_width *= 0.2;
    }
  }
  return best;
}

TEST(ShapeDifference, MatchesSearchOfTheBestTransformation) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 20; ++trial) {
    const double noise = trial % 4 == 0 ? 2.0 : 0.05, mirror = trial % 2 == 0 ? 1.0 : -1.0;
    const Eigen::Rotation2Dd turn(0.3 * trial);
    std::vector<Eigen::Vector2d> a, c;
    for (int i = 0; i < 30; ++i) {
      a.emplace_back(normal(random), 0.4 * normal(random));
      const Eigen::Vector2d turned = turn * Eigen::Vector2d(mirror * a.back().x(), a.back().y());
      c.emplace_back((0.2 + trial) * turned +
                     (0.2 + trial) * noise * Eigen::Vector2d(normal(random), normal(random)) +
                     Eigen::Vector2d(4.0, -9.0));
    }
    // The search ends at an angle within 1e-9 of the minimum, where the rest changes by its square.
    EXPECT_NEAR(shapeDifference(a, c), searchedShapeDifference(a, c), 1e-12) << trial;
    EXPECT_NEAR(shapeDifference(c, a), shapeDifference(a, c), 1e-12) << "symmetric";
  }
}

// Axis-aligned crosses with arms (1, 1) and (1, s): AᵀC = diag(2, 2s), ‖A‖² = 4, ‖C‖² = 2 + 2s²: μ = 1 − (2 +
// 2s)² / (4 (2 + 2s²)).
TEST(ShapeDifference, MatchesClosedForm) {
  for (const double s : {1.0, 0.5, 0.1, 0.0}) {
    const std::vector<Eigen::Vector2d> a{{1, 0}, {-1, 0}, {0, 1}, {0, -1}},
        c{{1, 0}, {-1, 0}, {0, s}, {0, -s}};
    EXPECT_NEAR(shapeDifference(a, c), 1.0 - std::pow(2 + 2 * s, 2) / (4 * (2 + 2 * s * s)), 1e-14);
  }
  EXPECT_TRUE(std::isnan(shapeDifference({{1, 1}}, {{1, 1}})));
  EXPECT_TRUE(std::isnan(shapeDifference({{1, 1}, {1, 1}}, {{0, 0}, {1, 1}})));
  EXPECT_THROW(shapeDifference({{1, 1}}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace omnifleet::evaluation
