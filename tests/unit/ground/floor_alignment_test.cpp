#include "ground/floor_alignment.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <random>
#include <utility>
#include <vector>

#include "tests/unit/ground/textured_floor.h"

namespace omnifleet::ground {
namespace {

constexpr TimeNs kFrame_ns = 200'000'000;

using testing::FloorLook;
using testing::FloorTexture;
using testing::texturedFloor;

FloorAlignment makeAlignment() {
  return {texturedFloor().camera, texturedFloor().view, FloorAlignmentOptions{}};
}

Pose2 errorOf(const FloorAlignment::Result& result, const Pose2& truth) {
  return truth.inverse() * result.reference_from_current;
}

double neesOf(const FloorAlignment::Result& result, const Pose2& truth) {
  const Eigen::Vector3d error = errorOf(result, truth).vector();
  return error.dot(result.covariance.inverse() * error);
}

const Pose2 kAlignmentMotion{0.11, -0.04, 0.12};
constexpr double kDegree = M_PI / 180.0;

TEST(FloorAlignment, RecoversMotionOnTexturedFloor) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 1);
  FloorAlignment alignment = makeAlignment();
  EXPECT_FALSE(alignment.add(0, scene.image(texture, {}, {}, 1), {}, std::nullopt).valid);
  const auto& result = alignment.add(kFrame_ns, scene.image(texture, kAlignmentMotion, {}, 2), {},
                                     Pose2{0.105, -0.042, 0.125});
  ASSERT_TRUE(result.valid);
  EXPECT_EQ(result.since_ns, 0);
  const Pose2 error = errorOf(result, kAlignmentMotion);
  EXPECT_LT(error.translation().norm(), 5e-4);
  EXPECT_LT(std::abs(error.theta_rad), 0.03 * kDegree);
  EXPECT_GT(result.correlation, 0.8);
  EXPECT_GT(result.cells, 5000);
}

TEST(FloorAlignment, GivesTheSameResultForColourImages) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 2);
  const cv::Mat1b before = scene.image(texture, {}, {}, 1),
                  after = scene.image(texture, kAlignmentMotion, {}, 2);
  const auto coloured = [](const cv::Mat1b& green) {
    cv::Mat3b image;
    const cv::Mat1b other(green.size(), std::uint8_t{77});
    cv::merge(std::vector<cv::Mat1b>{other, green, other}, image);
    return image;
  };
  FloorAlignment grey = makeAlignment(), colour = makeAlignment();
  grey.add(0, before, {}, std::nullopt);
  colour.add(0, coloured(before), {}, std::nullopt);
  const auto& expected = grey.add(kFrame_ns, after, {}, kAlignmentMotion);
  const auto& result = colour.add(kFrame_ns, coloured(after), {}, kAlignmentMotion);
  ASSERT_TRUE(result.valid);
  EXPECT_EQ(result.reference_from_current.vector(), expected.reference_from_current.vector());
}

/// The frames chain: each reference is a frame whose pose is known from the one before.
TEST(FloorAlignment, AccumulatesLittleErrorOverTwoMetres) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 3);
  FloorAlignment alignment = makeAlignment();
  std::map<TimeNs, Pose2> estimates{{0, {}}};
  const Pose2 step{0.05, 0.0, 0.09};
  Pose2 pose;
  alignment.add(0, scene.image(texture, pose, {}, 1), {}, std::nullopt);
  TimeNs time = 0;
  for (unsigned k = 1; k <= 40; ++k) {
    pose = pose * step;
    time += kFrame_ns;
    const auto& result =
        alignment.add(time, scene.image(texture, pose, {}, k + 1), {}, Pose2{0.049, 0.001, 0.092});
    // Within 5 cm of the first frame a fixed pattern is possible.
    ASSERT_TRUE(result.valid || k == 1) << k;
    estimates[time] = result.valid ? estimates.at(result.since_ns) * result.reference_from_current
                                   : estimates.at(time - kFrame_ns) * step;
    EXPECT_LE(result.reference_from_current.translation().norm(), 0.22 + 0.06);
  }
  const Pose2 error = pose.inverse() * estimates.at(time);
  EXPECT_LT(error.translation().norm(), 2e-3);  // about ten references, 0.2 mm each
  EXPECT_LT(std::abs(error.theta_rad), 0.1 * kDegree);
}

/// On a plain floor only noise remains. A wrong but valid result would harm the estimator.
TEST(FloorAlignment, IsNeverValidOnPlainFloor) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 4);
  FloorLook plain;
  plain.contrast = 0.0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    plain.noise = 1.0 + 0.05 * seed;
    FloorAlignment alignment = makeAlignment();
    alignment.add(0, scene.image(texture, {}, plain, 2 * seed), {}, std::nullopt);
    const auto& result =
        alignment.add(kFrame_ns, scene.image(texture, {}, plain, 2 * seed + 1), {}, kAlignmentMotion);
    EXPECT_FALSE(result.valid) << seed << ": correlation " << result.correlation << ", "
                               << result.significance << " σ";
  }
}

/// The errors are as large as the covariance states: NEES has mean 3 for three degrees of freedom. The
/// standard deviation of its mean over 25 seeds is 0.5.
TEST(FloorAlignment, StatesItsCovariance) {
  const auto& scene = texturedFloor();
  for (const double contrast : {0.006, 0.012}) {
    FloorLook look;
    look.contrast = contrast;
    double sum = 0.0;
    int valid = 0;
    for (unsigned seed = 0; seed < 25; ++seed) {
      const FloorTexture texture(0.008, 100 + seed);
      FloorAlignment alignment = makeAlignment();
      alignment.add(0, scene.image(texture, {}, look, 2 * seed), {}, std::nullopt);
      const auto& result =
          alignment.add(kFrame_ns, scene.image(texture, kAlignmentMotion, look, 2 * seed + 1), {},
                        Pose2{0.108, -0.041, 0.123});
      if (!result.valid) continue;
      ++valid;
      sum += neesOf(result, kAlignmentMotion);
    }
    EXPECT_GE(valid, 22) << contrast;
    EXPECT_GT(sum / valid, 1.5) << contrast;
    EXPECT_LT(sum / valid, 5.0) << contrast;
  }
}

TEST(FloorAlignment, ToleratesChangeOfGain) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 5);
  FloorLook darker;
  darker.gain = 0.6;
  FloorAlignment alignment = makeAlignment();
  alignment.add(0, scene.image(texture, {}, {}, 1), {}, std::nullopt);
  const auto& result =
      alignment.add(kFrame_ns, scene.image(texture, kAlignmentMotion, darker, 2), {}, kAlignmentMotion);
  ASSERT_TRUE(result.valid);
  EXPECT_LT(errorOf(result, kAlignmentMotion).translation().norm(), 5e-4);
}

TEST(FloorAlignment, CorrectsWrongPredictionOrIsInvalid) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 6);
  const cv::Mat1b before = scene.image(texture, {}, {}, 1),
                  after = scene.image(texture, kAlignmentMotion, {}, 2);
  int valid = 0;
  for (int k = 0; k < 12; ++k) {
    const double wrong_m = k < 6 ? 0.01 : 0.03, angle = M_PI / 3.0 * k;
    FloorAlignment alignment = makeAlignment();
    alignment.add(0, before, {}, std::nullopt);
    const auto& result =
        alignment.add(kFrame_ns, after, {},
                      Pose2{kAlignmentMotion.x_m + wrong_m * std::cos(angle),
                            kAlignmentMotion.y_m + wrong_m * std::sin(angle), kAlignmentMotion.theta_rad});
    EXPECT_TRUE(result.valid || k >= 6) << k;  // 1 cm: ordinary wheel errors
    if (!result.valid) continue;
    ++valid;
    EXPECT_LT(errorOf(result, kAlignmentMotion).translation().norm(), 5e-4) << k;
  }
  EXPECT_GE(valid, 6);
}

/// Half of the annulus shows a textured surface that moves with the robot.
TEST(FloorAlignment, IgnoresMaskedObjects) {
  const auto& scene = texturedFloor();
  const FloorTexture floor(0.008, 7), object(0.008, 8);
  const cv::Rect half(320, 0, 320, 480);
  cv::Mat1b before = scene.image(floor, {}, {}, 1), after = scene.image(floor, kAlignmentMotion, {}, 2);
  FloorLook strong;
  strong.contrast = 0.2;
  scene.image(object, {}, strong, 3)(half).copyTo(before(half));
  scene.image(object, {0.13, -0.03, 0.14}, strong, 4)(half).copyTo(after(half));
  cv::Mat1b objects(before.size(), std::uint8_t{0});
  objects(half).setTo(255);
  FloorAlignment masked = makeAlignment(), unmasked = makeAlignment();
  masked.add(0, before, objects, std::nullopt);
  unmasked.add(0, before, {}, std::nullopt);
  const Pose2 predicted{0.12, -0.035, 0.13};
  const auto& result = masked.add(kFrame_ns, after, objects, predicted);
  ASSERT_TRUE(result.valid);
  EXPECT_LT(errorOf(result, kAlignmentMotion).translation().norm(), 8e-4);
  const auto& other = unmasked.add(kFrame_ns, after, {}, predicted);
  EXPECT_TRUE(!other.valid || errorOf(other, kAlignmentMotion).translation().norm() > 2e-3);
}

struct AlignmentDrive {
  int valid = 0;
  double largest_error_m = 0.0, largest_nees = 0.0;
};

/// Drives 1.1 m straight ahead, with exact wheels.
AlignmentDrive driveStraight(const FloorLook& look, unsigned seed) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, seed);
  FloorAlignment alignment = makeAlignment();
  std::map<TimeNs, Pose2> truth;
  Pose2 pose{-0.6, 0.0, 0.0};
  const Pose2 step{0.025, 0.0, 0.0};
  AlignmentDrive drive;
  for (unsigned k = 0; k <= 45; ++k, pose = pose * step) {
    truth[kFrame_ns * k] = pose;
    const auto& result = alignment.add(kFrame_ns * k, scene.image(texture, pose, look, k + 1), {}, step);
    if (!result.valid) continue;
    ++drive.valid;
    const Pose2 relative = truth.at(result.since_ns).inverse() * pose;
    const double error_m = errorOf(result, relative).translation().norm();
    drive.largest_error_m = std::max(drive.largest_error_m, error_m);
    drive.largest_nees = std::max(drive.largest_nees, neesOf(result, relative));
  }
  return drive;
}

/// The shadow of the robot itself stays in place in the image. Its edges are much stronger than the texture.
TEST(FloorAlignment, IsNotPulledByShadowThatMovesAlong) {
  FloorLook look;
  look.contrast = 0.02;
  look.has_shadow = true;
  const AlignmentDrive drive = driveStraight(look, 9);
  EXPECT_GE(drive.valid, 30);
  EXPECT_LT(drive.largest_error_m, 1e-3);
  EXPECT_LT(drive.largest_nees, 25.0);
}

/// Dirt on the lens as strong as the texture: half of the signal stays in place.
TEST(FloorAlignment, IsNotPulledByDirtOnTheLens) {
  FloorLook look;
  look.contrast = look.dirt = 0.02;
  const AlignmentDrive drive = driveStraight(look, 9);
  EXPECT_GE(drive.valid, 30);
  EXPECT_LT(drive.largest_error_m, 3e-3);
  EXPECT_LT(drive.largest_nees, 25.0);
}

/// Without texture, the dirt alone matches at zero motion.
TEST(FloorAlignment, IsNotValidWhereOnlyDirtMatches) {
  for (const double dirt : {0.005, 0.02, 0.1}) {
    FloorLook look;
    look.contrast = 0.0;
    look.dirt = dirt;
    EXPECT_EQ(driveStraight(look, 10).valid, 0) << dirt;
    look.has_shadow = true;
    EXPECT_EQ(driveStraight(look, 10).valid, 0) << dirt << " with a shadow";
  }
}

/// Contrast of a plain floor under a dirty lens, before and after twelve rasters of a textured floor.
std::pair<float, float> contrastBeforeAndAfterLearning(double dirt) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 15);
  FloorLook plain, textured;
  plain.contrast = 0.0;
  textured.contrast = 0.02;
  plain.dirt = textured.dirt = dirt;
  FloorRaster raster(scene.camera, scene.view, 0.45, 1.1, 0.01);
  raster.make(scene.image(texture, {}, plain, 1), {});
  const float before = raster.contrast();
  for (unsigned k = 0; k < 12; ++k) {
    raster.make(scene.image(texture, {0.25 * (k % 4) - 0.4, 0.25 * (k / 4) - 0.3, 0.4 * k}, textured, k + 2),
                {});
    raster.learnFixed();
  }
  raster.make(scene.image(texture, {}, plain, 20), {});
  return {before, raster.contrast()};
}

TEST(FloorRaster, SubtractsWhatIsFixedInTheImage) {
  const auto [before, after] = contrastBeforeAndAfterLearning(0.06);
  EXPECT_LT(after, 0.5f * before);
  const auto [clean_before, clean_after] = contrastBeforeAndAfterLearning(0.0);
  EXPECT_NEAR(clean_after, clean_before, 0.1f * clean_before);
}

/// Without wheels: the coarse search finds motions far beyond the reach of Gauss–Newton.
TEST(FloorAlignment, FindsLargeMotionWithoutPrediction) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.015, 11);
  const cv::Mat1b before = scene.image(texture, {}, {}, 1);
  for (const Pose2& motion : {Pose2{0.14, 0.05, 0.2}, Pose2{-0.06, 0.12, -0.25}, Pose2{0.1, 0.0, 0.0}}) {
    FloorAlignment alignment = makeAlignment();
    alignment.add(0, before, {}, std::nullopt);
    const auto& result = alignment.add(kFrame_ns, scene.image(texture, motion, {}, 2), {}, std::nullopt);
    ASSERT_TRUE(result.valid) << motion.x_m;
    EXPECT_LT(errorOf(result, motion).translation().norm(), 5e-4);
    EXPECT_LT(std::abs(errorOf(result, motion).theta_rad), 0.03 * kDegree);
  }
}

/// Without wheels, standing still cannot be distinguished from a plain floor under a dirty lens until the
/// robot has moved.
TEST(FloorAlignment, NeedsMotionBeforeItIsValidWithoutWheels) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 12);
  FloorAlignment alignment = makeAlignment();
  alignment.add(0, scene.image(texture, {}, {}, 1), {}, std::nullopt);
  EXPECT_FALSE(alignment.add(kFrame_ns, scene.image(texture, {}, {}, 2), {}, std::nullopt).valid);
  Pose2 pose;
  int valid = 0;
  for (unsigned k = 2; k < 12; ++k) {
    pose = pose * Pose2{0.02, 0.0, 0.0};
    const auto& result =
        alignment.add(kFrame_ns * k, scene.image(texture, pose, {}, k + 1), {}, std::nullopt);
    valid += result.valid ? 1 : 0;
    if (!result.valid || result.since_ns != 0) continue;
    EXPECT_LT(errorOf(result, pose).translation().norm(), 1e-3) << k;
  }
  EXPECT_GE(valid, 6);
}

TEST(FloorAlignment, StartsAnewAfterForget) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 13);
  FloorAlignment alignment = makeAlignment();
  alignment.add(0, scene.image(texture, {}, {}, 1), {}, std::nullopt);
  alignment.forget();
  const auto& first = alignment.add(kFrame_ns, scene.image(texture, kAlignmentMotion, {}, 2), {}, Pose2{});
  EXPECT_FALSE(first.valid);
  EXPECT_EQ(first.since_ns, kFrame_ns);
}

TEST(FloorAlignment, SkipsFramesThatShowTooLittleFloor) {
  const auto& scene = texturedFloor();
  const FloorTexture texture(0.008, 14);
  FloorAlignment alignment = makeAlignment();
  const cv::Mat1b everywhere(scene.view.imageSize(), std::uint8_t{255});
  const cv::Mat1b image = scene.image(texture, {}, {}, 1);
  EXPECT_FALSE(alignment.add(0, image, everywhere, std::nullopt).valid);
  EXPECT_FALSE(alignment.add(kFrame_ns, image, {}, Pose2{}).valid);  // becomes the reference
  EXPECT_FALSE(alignment.add(2 * kFrame_ns, image, everywhere, Pose2{}).valid);
  const auto& result =
      alignment.add(3 * kFrame_ns, scene.image(texture, kAlignmentMotion, {}, 2), {}, kAlignmentMotion);
  EXPECT_TRUE(result.valid);
  EXPECT_EQ(result.since_ns, kFrame_ns);
}

TEST(FloorAlignment, RejectsCamerasWithoutFloorInTheAnnulus) {
  FloorAlignmentOptions options;
  options.inner_m = 0.05;
  options.outer_m = 0.2;  // hidden by the robot
  EXPECT_THROW(FloorAlignment(texturedFloor().camera, texturedFloor().view, options), options::Error);
  EXPECT_THROW(FloorAlignmentOptions::read(options::Section::parse("inner_m: 0.9\nouter_m: 0.5", "test")),
               options::Error);
}

}  // namespace
}  // namespace omnifleet::ground
