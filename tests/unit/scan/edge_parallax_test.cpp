// Upper edges in a rectangular room, in closed form: an edge at height h appears farther away by H/(H − h).
#include "scan/edge_parallax.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace omnifleet::scan {
namespace {

constexpr double kEdgeSigma = 0.002;  // 1/m

class EdgeRoom {
 public:
  /// @param magnification H/(H − h) of the edges
  explicit EdgeRoom(double magnification, std::array<double, 4> walls_m = {3.0, 2.0, 2.5, 2.2})
      : magnification_(magnification), walls_m_(walls_m) {}

  Boundary scanFrom(const Pose2& pose) {
    Boundary boundary;
    boundary.inverse_m.resize(720);
    boundary.sigma.assign(720, static_cast<float>(kEdgeSigma));
    for (std::size_t i = 0; i < 720; ++i) {
      const double angle = pose.theta_rad + 2.0 * M_PI * static_cast<double>(i) / 720.0;
      double inverse = 0.0;
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d normal(std::cos(0.5 * M_PI * static_cast<double>(k)),
                                     std::sin(0.5 * M_PI * static_cast<double>(k)));
        inverse = std::max(inverse, normal.dot(Eigen::Vector2d(std::cos(angle), std::sin(angle))) /
                                        (walls_m_[k] - normal.dot(pose.translation())));
      }
      boundary.inverse_m[i] = static_cast<float>(inverse / magnification_ + noise_(random_));
    }
    return boundary;
  }

 private:
  double magnification_;
  std::array<double, 4> walls_m_;
  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0.0, kEdgeSigma};
};

/// Drives along an arc. @param error of the odometry's turn per step, rad
void driveArc(EdgeRoom& room, EdgeParallax& parallax, int steps, double turn_error_rad = 0.0) {
  Pose2 pose{-0.8, -0.3, 0.1};
  parallax.add(room.scanFrom(pose), {});
  for (int i = 0; i < steps; ++i) {
    const Pose2 step{0.08, 0.0, 0.03};
    pose = pose * step;
    parallax.move({step.x_m, step.y_m, step.theta_rad + turn_error_rad});
    parallax.add(room.scanFrom(pose), {});
  }
}

TEST(EdgeParallax, MeasuresTheMagnificationOfUpperEdges) {
  for (const double magnification : {1.0, 1.1, 1.2}) {
    EdgeRoom room(magnification);
    EdgeParallax parallax;
    driveArc(room, parallax, 16);
    EXPECT_GE(parallax.comparisons(), 3);
    EXPECT_NEAR(parallax.excess(), magnification - 1.0, 0.02);
    EXPECT_LT(parallax.sigma(), 0.05);
    EXPECT_LT(std::abs(parallax.excess() - magnification + 1.0), 2.0 * parallax.sigma());
  }
}

// σ allows for the error of the wheels' turn: it moves far walls sideways.
TEST(EdgeParallax, IsNotBiasedByTurnsThatTheWheelsMeasureBadly) {
  for (const double error_rad : {-0.005, 0.005}) {
    EdgeRoom room(1.2);
    EdgeParallax parallax;
    driveArc(room, parallax, 16, error_rad);
    EXPECT_NEAR(parallax.excess(), 0.2, 0.03) << error_rad;
  }
}

// Two walls along the motion say nothing about its length: boards are neither confirmed nor rejected.
TEST(EdgeParallax, DistinguishesNothingInACorridor) {
  EdgeRoom room(1.2, {1e3, 1.0, 1e3, 1.0});
  EdgeParallax parallax;
  Pose2 pose;
  parallax.add(room.scanFrom(pose), {});
  for (int i = 0; i < 16; ++i) {
    pose.x_m += 0.08;
    parallax.move({0.08, 0.0, 0.0});
    parallax.add(room.scanFrom(pose), {});
  }
  const double variance = parallax.sigma() * parallax.sigma();
  EXPECT_LT(std::abs(0.5 * 0.2 * (2.0 * parallax.excess() - 0.2) / variance), 2.0);  // nats
}

TEST(EdgeParallax, ComparesNoScansAcrossAGap) {
  EdgeRoom room(1.2);
  EdgeParallax parallax;
  parallax.add(room.scanFrom({}), {});
  parallax.forget();
  parallax.move({0.4, 0.0, 0.0});
  parallax.add(room.scanFrom({0.9, 0.0, 0.0}), {});
  EXPECT_EQ(parallax.comparisons(), 0);
  EXPECT_TRUE(std::isinf(parallax.sigma()));
}

TEST(EdgeParallax, BeginsAnewWithOtherEdges) {
  EdgeRoom room(1.2);
  EdgeParallax parallax;
  driveArc(room, parallax, 16);
  parallax.restart();
  EXPECT_EQ(parallax.comparisons(), 0);
  EXPECT_EQ(parallax.excess(), 0.0);
}

}  // namespace
}  // namespace omnifleet::scan
