#include "flow/point_tracks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace omnifleet::flow {
namespace {

constexpr double kSigma_px = 0.15;

lens::CameraModel model(lens::Projection projection, double fov_deg) {
  lens::CameraModel m;
  m.projection = projection;
  m.image_width_px = 640;
  m.image_height_px = 480;
  m.focal_px = {148.66, 148.66};
  m.principal_point_px = {319.5, 239.5};
  m.fov_deg = fov_deg;
  m.position_m = {0.04, -0.02, 0.5};  // off the axle, so that rotation moves the camera too
  return m;
}

/// A robot on a random path among points, and the pixels where its camera sees them.
class Drive {
 public:
  Drive(const lens::Camera& camera, const PointOptions& options, unsigned seed)
      : camera_(&camera), tracks_(camera, options, kSigma_px), random_(seed) {}

  struct Seen {
    Eigen::Vector3d world;
    Eigen::Vector2f pixel = Eigen::Vector2f::Zero(), last = Eigen::Vector2f::Zero();
    ScenePoint point;
  };
  std::vector<Seen> points;

  double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  void add(const Eigen::Vector3d& world) {
    points.emplace_back();
    points.back().world = world;
  }
  const Pose2& pose() const { return world_from_base_; }
  Eigen::Vector3d inBase(const Eigen::Vector3d& world) const {
    const Eigen::Vector2d p = world_from_base_.inverse() * world.head<2>();
    return {p.x(), p.y(), world.z()};
  }

  /// Advances one frame. `measured` is the motion from the wheels. Points outside the field of view are
  /// removed.
  void step(const Pose2& moved, Motion measured, double noise_px) {
    std::normal_distribution<double> normal;
    world_from_base_ = world_from_base_ * moved;
    const auto hidden = [&](Seen& seen) {
      const auto pixel = camera_->pixelFromPoint(inBase(seen.world));
      if (!pixel) return true;
      seen.last = seen.pixel;
      seen.pixel = (*pixel + noise_px * Eigen::Vector2d(normal(random_), normal(random_))).cast<float>();
      return false;
    };
    points.erase(std::remove_if(points.begin(), points.end(), hidden), points.end());
    tracks_.advance(measured);
    std::vector<Seen*> followed;
    for (Seen& seen : points)
      if (!seen.last.isZero()) followed.push_back(&seen);
    for (const Seen* seen : followed) tracks_.follow(seen->last, seen->pixel);
    const auto& found = tracks_.points();
    for (std::size_t i = 0; i < followed.size(); ++i) followed[i]->point = found[i];
  }
  void begin(double noise_px = 0.0) { step({}, Motion{}, noise_px); }

  static Motion motion(const Pose2& moved) {
    Motion m;
    m.valid = true;
    m.previous_from_current = moved;
    m.covariance = Eigen::Vector3d(1e-8, 1e-8, 1e-8).asDiagonal();
    m.left_m = moved.x_m - 0.13 * moved.theta_rad;
    m.right_m = moved.x_m + 0.13 * moved.theta_rad;
    return m;
  }

 private:
  const lens::Camera* camera_;
  PointTracks tracks_;
  std::mt19937 random_;
  Pose2 world_from_base_{0.3, -0.2, 0.4};
};

Pose2 arc(double length_m, double turn_rad) {
  return {length_m * std::cos(0.5 * turn_rad), length_m * std::sin(0.5 * turn_rad), turn_rad};
}

struct LensCase {
  lens::Projection projection;
  double fov_deg, highest_m;
};

class PointTracksOfLens : public ::testing::TestWithParam<LensCase> {};

TEST_P(PointTracksOfLens, LocatesPointsAtAnyHeight) {
  const lens::Camera camera(model(GetParam().projection, GetParam().fov_deg));
  Drive drive(camera, {}, 3);
  for (int i = 0; i < 60; ++i) {
    const double phi = drive.in(-M_PI, M_PI), r = drive.in(0.4, 1.2);
    drive.add({0.3 + r * std::cos(phi), -0.2 + r * std::sin(phi), drive.in(0.0, GetParam().highest_m)});
  }
  drive.begin();
  for (int i = 0; i < 8; ++i) {
    const Pose2 moved = arc(drive.in(0.02, 0.05), drive.in(-0.1, 0.1));
    drive.step(moved, Drive::motion(moved), 0.0);
  }
  int found = 0, above_camera = 0;
  for (const auto& seen : drive.points) {
    if (!(seen.point.sigma_m > 0)) continue;
    ++found;
    above_camera += seen.world.z() > camera.height();
    // Pixels are floats: 3e-5 px, which the minimum parallax of 2° magnifies 30 times.
    EXPECT_LT((seen.point.point_m.cast<double>() - drive.inBase(seen.world)).norm(), 1e-4);
    EXPECT_LE(seen.point.sigma_m, 0.05f);
  }
  EXPECT_GE(found, 20);
  EXPECT_EQ(above_camera > 0, GetParam().highest_m > camera.height());
}

INSTANTIATE_TEST_SUITE_P(Lenses, PointTracksOfLens,
                         ::testing::Values(LensCase{lens::Projection::kEquidistant, 185.0, 0.4},
                                           LensCase{lens::Projection::kEquidistant, 240.0,
                                                    1.0},  // sees points above it
                                           LensCase{lens::Projection::kOrthographic, 178.0, 0.4},
                                           LensCase{lens::Projection::kEquisolid, 200.0, 0.4},
                                           LensCase{lens::Projection::kStereographic, 185.0, 0.4}));

TEST(PointTracks, MatchesHeightFromFloorDisplacement) {
  // Without a turn, the displacement projected to the floor is −t·H/(H − h).
  const lens::Camera camera(model(lens::Projection::kEquidistant, 185.0));
  Drive drive(camera, {}, 4);
  for (int i = 0; i < 9; ++i) drive.add({0.9 + 0.05 * i, -0.8 + 0.15 * i, 0.04 * i});
  drive.begin();
  const Pose2 moved{0.12, 0.0, 0.0};
  drive.step(moved, Drive::motion(moved), 0.0);
  int found = 0;
  for (const auto& seen : drive.points) {
    if (!(seen.point.sigma_m > 0)) continue;
    ++found;
    const Eigen::Vector2d d =
        *camera.floorFromPixel(seen.pixel.cast<double>()) - *camera.floorFromPixel(seen.last.cast<double>());
    EXPECT_NEAR(d.y(), 0.0, 1e-4);
    EXPECT_NEAR(seen.point.point_m.z(), camera.height() * (1.0 + moved.x_m / d.x()), 1e-3);
  }
  EXPECT_GE(found, 3);
}

TEST(PointTracks, ReportsConsistentSigmaThatShrinksWithBaseline) {
  const lens::Camera camera(model(lens::Projection::kEquidistant, 185.0));
  PointOptions options;
  options.max_sigma_m = 1.0;
  options.drift_px = options.baseline_sigma = options.turn_sigma_radpm =
      0.0;  // this test has no systematic errors
  double squares = 0.0, first = 0.0, last = 0.0;
  int n = 0, n_first = 0, n_last = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Drive drive(camera, options, seed);
    for (int i = 0; i < 40; ++i) {
      const double phi = drive.in(-M_PI, M_PI), r = drive.in(0.6, 1.2);
      drive.add({0.3 + r * std::cos(phi), -0.2 + r * std::sin(phi), drive.in(0.0, 0.3)});
    }
    drive.begin(kSigma_px);
    for (int i = 0; i < 10; ++i) {
      const Pose2 moved = arc(0.03, drive.in(-0.05, 0.05));
      drive.step(moved, Drive::motion(moved), kSigma_px);
      for (const auto& seen : drive.points) {
        if (!(seen.point.sigma_m > 0) || i < 4) continue;
        (i == 9 ? last : first) += i == 9 || i == 4 ? seen.point.sigma_m : 0.0;
        n_first += i == 4;
        n_last += i == 9;
        if (i < 9) continue;
        const Eigen::Vector3d off = seen.point.point_m.cast<double>() - drive.inBase(seen.world);
        squares += std::pow(off.norm() / seen.point.sigma_m, 2);
        ++n;
      }
    }
  }
  ASSERT_GT(n, 300);
  // The larger angle of a pixel is used for both directions, and part of the error is across the line of
  // sight. So the tolerance is 0.3.
  EXPECT_NEAR(std::sqrt(squares / n), 0.9, 0.3);
  EXPECT_LT(last / n_last, 0.7 * first / n_first);
}

TEST(PointTracks, RejectsMovingPoints) {
  const lens::Camera camera(model(lens::Projection::kEquidistant, 185.0));
  Drive drive(camera, {}, 5);
  for (int i = 0; i < 12; ++i) drive.add({0.9 + 0.04 * i, -0.8 + 0.1 * i, 0.2});  // static
  for (int i = 0; i < 6; ++i) drive.add({1.0, 0.1 * i, 0.1});                     // moves with the robot
  for (int i = 0; i < 6; ++i) drive.add({0.2, 0.6 + 0.05 * i, 0.1});              // crosses the path
  drive.begin();
  int standing = 0;
  for (int k = 0; k < 8; ++k) {
    const Pose2 moved = arc(0.04, 0.01), before = drive.pose();
    const Pose2 after = before * moved;
    for (std::size_t i = 12; i < drive.points.size(); ++i) {
      Eigen::Vector3d& world = drive.points[i].world;
      const Eigen::Vector2d along = after * (before.inverse() * world.head<2>());
      const Eigen::Vector2d across = world.head<2>() + 0.04 * Eigen::Vector2d(0.9, 0.5);
      world.head<2>() = i < 18 ? along : across;
    }
    drive.step(moved, Drive::motion(moved), 0.02);
    ASSERT_EQ(drive.points.size(), 24U);
    for (std::size_t i = 0; i < 12; ++i) standing += drive.points[i].point.sigma_m > 0;
    for (std::size_t i = 12; i < 24; ++i) EXPECT_LE(drive.points[i].point.sigma_m, 0.0f) << i;
  }
  EXPECT_GE(standing, 20);
}

/// Median error (metres) of reported points in the last 20 of 160 frames. One wheel measures 2 % too much.
double medianError(double turn_sigma_radpm) {
  const lens::Camera camera(model(lens::Projection::kEquidistant, 185.0));
  PointOptions options;
  options.turn_sigma_radpm = turn_sigma_radpm;
  Drive drive(camera, options, 6);
  std::vector<double> errors;
  for (int k = 0; k < 160; ++k) {
    if (k % 8 == 0) {  // all tracks are lost, other points appear
      drive.points.clear();
      for (int i = 0; i < 20; ++i) {
        const double phi = drive.in(-M_PI, M_PI), r = drive.in(0.5, 1.3);
        const Eigen::Vector2d p = drive.pose() * Eigen::Vector2d(r * std::cos(phi), r * std::sin(phi));
        drive.add({p.x(), p.y(), drive.in(0.0, 0.3)});
      }
    }
    const Pose2 moved = arc(0.04, 0.02 * std::sin(0.2 * k));
    Motion measured = Drive::motion(moved);
    measured.right_m *= 1.02;
    measured.previous_from_current =
        arc(0.5 * (measured.left_m + measured.right_m), (measured.right_m - measured.left_m) / 0.26);
    drive.step(moved, measured, 0.1);
    for (const auto& seen : drive.points) {
      if (seen.point.sigma_m > 0 && k >= 140)
        errors.push_back((seen.point.point_m.cast<double>() - drive.inBase(seen.world)).norm());
    }
  }
  if (errors.empty()) return 1e9;
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

TEST(PointTracks, EstimatesSystematicWheelError) {
  const double learned = medianError(0.1), believed = medianError(0.0);
  // The distance is 1 % too long, and so are the ranges of 1 m.
  EXPECT_LT(learned, 0.02);
  EXPECT_GT(believed, 2.0 * learned);
}

TEST(PointTracks, RestartsTracksAfterGap) {
  const lens::Camera camera(model(lens::Projection::kEquidistant, 185.0));
  Drive drive(camera, {}, 7);
  for (int i = 0; i < 10; ++i) drive.add({0.9, -0.8 + 0.15 * i, 0.2});
  drive.begin();
  const Pose2 moved = arc(0.04, 0.0);
  const auto reported = [&] {
    return std::count_if(drive.points.begin(), drive.points.end(),
                         [](auto& p) { return p.point.sigma_m > 0; });
  };
  for (int k = 0; k < 6; ++k) drive.step(moved, Drive::motion(moved), 0.0);
  EXPECT_GE(reported(), 5);
  drive.step(moved, Motion{}, 0.0);
  const Pose2 little = arc(0.01, 0.0);
  drive.step(little, Drive::motion(little), 0.0);
  EXPECT_EQ(reported(), 0);  // the parallax of 1 cm is too small
  for (int k = 0; k < 6; ++k) drive.step(moved, Drive::motion(moved), 0.0);
  EXPECT_GE(reported(), 5);
}

TEST(PointOptions, ReadsKeysWithinBounds) {
  const auto o = PointOptions::read(options::Section::parse("{max_sigma_m: 0.02, max_frames: 9}", "t.yaml"));
  EXPECT_EQ(o.max_sigma_m, 0.02);
  EXPECT_EQ(o.max_frames, 9);
  EXPECT_THROW(PointOptions::read(options::Section::parse("{max_frames: 1}", "t.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::flow
