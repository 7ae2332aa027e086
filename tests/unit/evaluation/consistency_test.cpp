// Normalised errors of samples drawn from a known distribution, and quantiles against tables of χ².

#include "evaluation/consistency.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace omnifleet::evaluation {
namespace {

using dataset::StampedCovariance;
using dataset::StampedPose;

/// Poses on a circle. Their errors in base_link are drawn from root · rootᵀ times factor². `memory` is the
/// correlation of successive errors.
struct Drawn {
  std::vector<StampedPose> truth, estimate;
  std::vector<StampedCovariance> covariances;

  Drawn(unsigned seed, int count, double factor, double memory) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Eigen::Matrix3d root;
    root << 0.03, 0.0, 0.0, 0.01, 0.02, 0.0, -0.004, 0.006, 0.01;
    Eigen::Vector3d e = Eigen::Vector3d::Zero();
    for (int i = 0; i < count; ++i) {
      const TimeNs time_ns = 100'000'000LL * i;
      const double angle = 0.05 * i;
      const Pose2 exact{std::cos(angle), std::sin(angle), wrapAngle(angle + M_PI_2)};
      Eigen::Vector3d fresh;
      for (double& value : fresh) value = normal(random);
      e = i == 0 ? fresh : Eigen::Vector3d(memory * e + std::sqrt(1.0 - memory * memory) * fresh);
      truth.push_back({time_ns, exact});
      estimate.push_back({time_ns, exact * Pose2::fromVector(factor * root * e).inverse()});
      covariances.push_back({time_ns, root * root.transpose()});
    }
  }
  EstimatedPath path() const { return {truth, estimate, covariances}; }
  Consistency check() const { return checkConsistency(path()); }

  /// From pose `from` on, covariances have another reference, which has another pose in the truth.
  void move(std::size_t from, std::uint32_t datum, const Pose2& map_from_truth) {
    for (std::size_t i = from; i < estimate.size(); ++i) {
      estimate[i].map_from_base = map_from_truth * estimate[i].map_from_base;
      covariances[i].datum = datum;
    }
  }
};

bool within(double value, const Consistency::Bounds& bounds) {
  return value >= bounds.lower && value <= bounds.upper;
}

TEST(ChiSquare, MatchesTabulatedQuantiles) {
  EXPECT_NEAR(chiSquareQuantile(3, 1.6449), 7.815, 0.08);
  EXPECT_NEAR(chiSquareQuantile(10, 1.9600), 20.483, 0.1);
  EXPECT_NEAR(chiSquareQuantile(10, -1.9600), 3.247, 0.05);
  EXPECT_NEAR(chiSquareQuantile(300, 1.9600), 349.87, 0.2);
  EXPECT_NEAR(chiSquareQuantile(300, -1.9600), 253.91, 0.2);
}

TEST(Consistency, AcceptsTrueCovariancesInNineteenOfTwentyRuns) {
  int consistent = 0, strictly = 0;
  double mean = 0.0, inside = 0.0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const Consistency c = Drawn(seed, 400, 1.0, 0.0).check();
    ASSERT_EQ(c.samples, 400);
    consistent += c.consistent() ? 1 : 0;
    strictly += within(c.mean, c.strict) ? 1 : 0;
    mean += c.mean / 100;
    inside += c.inside / 100;
  }
  EXPECT_NEAR(mean, 3.0, 0.05);  // 40000 samples: σ 0.012
  EXPECT_NEAR(inside, 0.95, 0.005);
  EXPECT_GE(strictly, 88);  // 95 expected; binomial σ 2.2
  EXPECT_GE(consistent, strictly);
}

TEST(Consistency, DetectsOverconfidentAndConservativeCovariances) {
  const Consistency large = Drawn(1, 400, 2.0, 0.0).check(), small = Drawn(1, 400, 0.5, 0.0).check();
  EXPECT_NEAR(large.mean, 12.0, 1.0);
  EXPECT_GT(large.mean, large.bounds.upper);
  EXPECT_LT(small.mean, small.bounds.lower);
}

// With a memory of 0.9 the correlation of successive ε is 0.81: n samples equal n·(1 − 0.81)/(1 + 0.81)
// independent ones.
TEST(Consistency, CountsCorrelatedErrorsAsFewerSamples) {
  int consistent = 0, strictly = 0;
  double independent = 0.0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const Consistency c = Drawn(seed, 400, 1.0, 0.9).check();
    independent += c.independent / 100;
    consistent += c.consistent() ? 1 : 0;
    strictly += within(c.mean, c.strict) ? 1 : 0;
  }
  EXPECT_NEAR(independent, 400.0 * 0.19 / 1.81, 10.0);
  EXPECT_GE(consistent, 85);
  EXPECT_LT(strictly, 70) << "bounds for independent samples are too narrow here";
}

TEST(Consistency, IgnoresPosesWithoutTruthOrCovariance) {
  Drawn drawn(3, 50, 1.0, 0.0);
  drawn.covariances.erase(drawn.covariances.begin() + 10, drawn.covariances.begin() + 15);
  drawn.truth.resize(40);
  EXPECT_EQ(drawn.check().samples, 35);
  drawn.truth.clear();
  EXPECT_EQ(drawn.check().samples, 0);
  EXPECT_TRUE(std::isnan(drawn.check().mean));
  EXPECT_FALSE(drawn.check().consistent());
}

TEST(Consistency, GivesPositionsTwoDegreesOfFreedom) {
  double position = 0.0;
  for (unsigned seed = 0; seed < 100; ++seed) position += Drawn(seed, 400, 1.0, 0.0).check().position / 100;
  EXPECT_NEAR(position, 2.0, 0.04);  // 40000 samples: σ 0.01
  Drawn turned(1, 400, 1.0, 0.0);
  const double before = turned.check().position;
  for (StampedPose& pose : turned.truth) pose.map_from_base.theta_rad += 0.5;
  EXPECT_NEAR(turned.check().position, before, 1e-9);
  EXPECT_GT(turned.check().mean, 100.0);
}

const Pose2 kInitialPose{0.4, -1.0, 2.0}, kPoints{-0.3, 0.2, 1.2};

TEST(Consistency, LocatesEachDatumExactlyForExactPoses) {
  Drawn first(1, 60, 0.0, 0.0), second(2, 40, 0.0, 0.0);
  for (Drawn* drawn : {&first, &second}) {
    drawn->move(0, 1, kInitialPose);
    drawn->move(20, 2, kPoints * kInitialPose.inverse());
  }
  const DatumPlaces places = placeData({first.path(), second.path()});
  ASSERT_EQ(places.size(), 2u);
  EXPECT_LT((places.at(1) * kInitialPose).vector().norm(), 1e-9);
  EXPECT_LT((places.at(2) * kPoints).vector().norm(), 1e-9);
  EXPECT_LT(checkConsistency(first.path(), places).mean, 1e-12);
}

// Errors against two references, each as large as reported. They are consistent if each datum is aligned with
// the truth by itself, not by one common motion.
TEST(Consistency, AlignsEachDatumByItself) {
  std::vector<Consistency> apart, together;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Drawn drawn(seed, 200, 1.0, 0.0);
    drawn.move(0, 1, kInitialPose);
    drawn.move(80, 2, kPoints * kInitialPose.inverse());
    apart.push_back(checkConsistency(drawn.path(), placeData({drawn.path()})));
    EstimatedPath one = drawn.path();
    for (StampedCovariance& row : one.covariances) row.datum = 0;
    together.push_back(checkConsistency(one, placeData({one})));
  }
  // Each datum takes 3 of the 3·200 degrees of freedom, so 2.97 is correct; σ of 4000 samples is 0.04.
  EXPECT_NEAR(pooled(apart).mean, 2.97, 0.11);
  EXPECT_GT(pooled(together).mean, 100.0);
}

TEST(Consistency, KeepsErrorOfOneRobotAfterAlignment) {
  Drawn right(1, 200, 1.0, 0.0), off(2, 200, 1.0, 0.0);
  for (StampedPose& pose : off.estimate) pose.map_from_base = Pose2{0.3, 0.0, 0.0} * pose.map_from_base;
  const DatumPlaces places = placeData({right.path(), off.path()});
  const Consistency all =
      pooled({checkConsistency(right.path(), places), checkConsistency(off.path(), places)});
  EXPECT_GT(all.mean, 10.0);  // at best 15 cm each, with 2 to 3 cm reported
}

// A constant bias in map counts as one sample, even if the robot turns. Here a robot drives on a circle with
// constant errors.
TEST(Consistency, CountsBiasInMapAsOneSample) {
  Drawn drawn(6, 400, 0.0, 0.0);
  for (StampedPose& pose : drawn.estimate) pose.map_from_base = Pose2{0.03, -0.02, 0.0} * pose.map_from_base;
  for (StampedCovariance& row : drawn.covariances)
    row.covariance = Eigen::Vector3d(1e-3, 1e-3, 1e-4).asDiagonal();
  EXPECT_LT(drawn.check().independent, 2.0);
}

// Robots with equal errors count as one robot, robots with independent errors as many.
TEST(Consistency, CountsRobotsWithEqualErrorsAsOne) {
  const Drawn one(7, 300, 1.0, 0.5), other(8, 300, 1.0, 0.5);
  const double single = one.check().independent, two = other.check().independent;
  const Consistency alike = checkFleet({one.path(), one.path(), one.path()});
  EXPECT_NEAR(alike.independent, single, 1e-6 * single);
  EXPECT_EQ(alike.samples, 900);
  EXPECT_NEAR(alike.mean, one.check().mean, 1e-9);
  // ρ of 300 independent samples is 0.06; its square is negligible.
  EXPECT_NEAR(checkFleet({one.path(), other.path()}).independent, single + two, 0.1 * (single + two));
  EXPECT_LT(alike.bounds.lower, pooled({one.check(), one.check(), one.check()}).bounds.lower);
}

// The covariances are correct: all robots share one initial pose, whose error is as large as reported and
// constant. Nineteen of twenty runs are called consistent, although each counts as little more than one
// sample.
TEST(Consistency, WidensBoundsForSharedInitialPose) {
  int consistent = 0, by_robot = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const double x = 0.03 * normal(random), y = 0.03 * normal(random), turn = 0.01 * normal(random);
    std::vector<EstimatedPath> fleet;
    std::vector<Consistency> singles;
    for (unsigned robot = 0; robot < 3; ++robot) {
      Drawn drawn(3 * seed + robot, 60, 0.0, 0.0);
      for (std::size_t i = 0; i < drawn.estimate.size(); ++i) {
        // About the position of the robot, so that the error is the same for all.
        StampedPose& pose = drawn.estimate[i];
        const Pose2 exact = pose.map_from_base;
        pose.map_from_base = {exact.x_m + x, exact.y_m + y, exact.theta_rad + turn};
        drawn.covariances[i].covariance = Eigen::Vector3d(9e-4, 9e-4, 1e-4).asDiagonal();
      }
      fleet.push_back(drawn.path());
      singles.push_back(drawn.check());
    }
    consistent += checkFleet(fleet).consistent() ? 1 : 0;
    by_robot += pooled(singles).consistent() ? 1 : 0;
  }
  EXPECT_GE(consistent, 170);  // 190 expected with exact counts
  EXPECT_LT(by_robot, 140);
}

TEST(Consistency, PoolsRobotsBySamples) {
  const Consistency a = Drawn(4, 100, 1.0, 0.0).check(), b = Drawn(5, 300, 2.0, 0.0).check();
  const Consistency all = pooled({a, {}, b});
  EXPECT_EQ(all.samples, 400);
  EXPECT_NEAR(all.mean, (100 * a.mean + 300 * b.mean) / 400, 1e-9);
  EXPECT_LT(all.strict.upper - all.strict.lower, b.strict.upper - b.strict.lower);
}

}  // namespace
}  // namespace omnifleet::evaluation
