#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tests/unit/distance_vector/measure.h"

namespace omnifleet::test {
namespace {

using distance_vector::DistanceVector;
using Fault = DistanceVector::Fault;

class DistanceVectorFault : public testing::Test {
 protected:
  static cv::Mat plain(const cv::Scalar& bgr, double noise = 2.0) {
    cv::Mat image(240, 320, CV_8UC3), deviations(240, 320, CV_16SC3);
    cv::RNG random(3);
    random.fill(deviations, cv::RNG::NORMAL, 0.0, noise);
    image.setTo(bgr);
    cv::add(image, deviations, image, cv::noArray(), CV_8U);
    return image;
  }
  static int claims(const DistanceVector& vector) {
    const auto& label = vector.scan().label;
    const auto invalid = std::count(label.begin(), label.end(), RayLabel::kInvalid);
    const auto& edges = vector.boundary().sigma;
    return static_cast<int>(label.size()) - static_cast<int>(invalid) +
           static_cast<int>(std::count_if(edges.begin(), edges.end(), [](float s) { return s != 0.0f; }));
  }
  /// A wall across the view, in front of the camera.
  static World wallAt(double distance_m) {
    World world;
    world.blocks.push_back({{0.04 + distance_m + 0.05, 0.0}, {0.05, 2.0}, 0.0, 0.4, {60, 60, 170}});
    return world;
  }

  lens::Camera camera_{forwardCamera()};
  RayCaster caster_{camera_};
  DistanceVector vector_{camera_, {}};
};

TEST_F(DistanceVectorFault, ClaimsNothingInSkyDarknessAndSaturation) {
  const cv::Scalar scenes[] = {{230, 200, 170}, {0, 0, 0}, {6, 6, 6}, {255, 255, 255}, {120, 120, 120}};
  for (const cv::Scalar& bgr : scenes) {
    DistanceVector vector(camera_, {});
    vector.process(plain(bgr));
    EXPECT_NE(vector.fault(), Fault::kNone) << bgr;
    EXPECT_EQ(claims(vector), 0) << bgr;
  }
}

TEST_F(DistanceVectorFault, ClaimsNothingInFrontOfAWall) {
  vector_.process(caster_.render(wallAt(0.05), {}));
  EXPECT_NE(vector_.fault(), Fault::kNone);
  EXPECT_EQ(claims(vector_), 0);
}

// No pixel of the wall differs from the floor by itself, and no earlier image has shown the floor.
TEST_F(DistanceVectorFault, FindsAWallOfNearlyTheFloorsColourInItsFirstImage) {
  World world = wallAt(0.5);
  world.blocks[0].bgr = {128, 128, 128};  // the floor: 118, 122, 126
  vector_.process(caster_.render(world, {}));
  ASSERT_EQ(vector_.fault(), Fault::kNone);
  const Boundary& boundary = vector_.boundary();
  int found = 0, right = 0;
  for (std::size_t i = 0; i < boundary.sigma.size(); ++i) {
    if (!(boundary.sigma[i] > 0.0f)) continue;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(boundary.sigma.size());
    const auto truth = caster_.truth(world, {}, bearing);
    ++found;
    right += truth && std::abs(1.0 / boundary.inverse_m[i] - *truth) < 0.03 ? 1 : 0;
  }
  EXPECT_GT(found, 120) << "of some 180 bearings";
  EXPECT_GT(right, 0.85 * found);
}

TEST_F(DistanceVectorFault, ReportsTooNearWhereItHasSeenTheFloorBefore) {
  vector_.process(caster_.render(wallAt(0.5), {}));
  ASSERT_EQ(vector_.fault(), Fault::kNone);
  vector_.process(caster_.render(wallAt(0.05), {}));
  EXPECT_EQ(vector_.fault(), Fault::kTooNear);
  EXPECT_EQ(claims(vector_), 0);
  vector_.process(caster_.render(wallAt(0.5), {}));
  EXPECT_EQ(vector_.fault(), Fault::kNone);
  EXPECT_GT(claims(vector_), 300);
}

// A block stands at the bottom of the left columns: no free ray there, while the right half stays usable.
TEST_F(DistanceVectorFault, ClaimsNoFreeRayWhereAnObjectHidesTheFloor) {
  World world = wallAt(0.6);
  world.blocks.push_back({{0.09, 0.16}, {0.04, 0.1}, 0.0, 0.3, {160, 90, 40}});
  vector_.process(caster_.render(world, {}));
  ASSERT_EQ(vector_.fault(), Fault::kNone);
  const Scan& scan = vector_.scan();
  int right = 0;
  for (std::size_t i = 0; i < scan.label.size(); ++i) {
    const double bearing = std::remainder(
        2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.label.size()), 2.0 * M_PI);
    if (bearing > 0.5 && bearing < 0.75) {
      EXPECT_NE(scan.label[i], RayLabel::kFloorEnd) << bearing;
      const double near =
          caster_.truth(world, {}, bearing).value_or(0.1);  // its foot may lie below the image
      if (scan.label[i] == RayLabel::kObstacle) {
        EXPECT_LT(scan.range_m[i], near + 0.02) << bearing;
      }
    }
    if (bearing > -0.7 && bearing < -0.1 && scan.label[i] == RayLabel::kObstacle) ++right;
  }
  EXPECT_GT(right, 60);
}

TEST_F(DistanceVectorFault, AcceptsANewFloorAfterAFewFrames) {
  World red = wallAt(0.5), blue = wallAt(0.5);
  blue.floor_bgr = {190, 120, 60};
  vector_.process(caster_.render(red, {}));
  const cv::Mat other = caster_.render(blue, {});
  int frames = 0;
  do {
    vector_.process(other);
    ++frames;
  } while (vector_.fault() != Fault::kNone && frames < 20);
  EXPECT_EQ(frames, distance_vector::WalkOptions{}.new_floor_frames);
}

TEST_F(DistanceVectorFault, RejectsImagesOfAnotherSizeOrType) {
  EXPECT_THROW(vector_.process(cv::Mat(120, 160, CV_8UC3)), std::invalid_argument);
  EXPECT_THROW(vector_.process(cv::Mat(240, 320, CV_8UC1)), std::invalid_argument);
  EXPECT_THROW(vector_.process(cv::Mat()), std::invalid_argument);
}

TEST_F(DistanceVectorFault, IsAFunctionOfTheImagesSoFar) {
  DistanceVector other(camera_, {});
  for (const double distance : {0.4, 0.05, 0.7}) {
    const cv::Mat image = caster_.render(wallAt(distance), {});
    vector_.process(image);
    other.process(image.clone());
    EXPECT_EQ(vector_.boundary().inverse_m, other.boundary().inverse_m);
    EXPECT_EQ(vector_.boundary().sigma, other.boundary().sigma);
    EXPECT_EQ(vector_.scan().label, other.scan().label);
  }
}

// Random pixels must never crash, and give finite numbers.
TEST_F(DistanceVectorFault, SurvivesRandomImages) {
  cv::RNG random(11);
  for (int i = 0; i < 20; ++i) {
    cv::Mat image(240, 320, CV_8UC3);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    if (i % 2) image(cv::Rect(0, 100 + 6 * i, 320, 20)).setTo(cv::Scalar(90, 100, 110));
    vector_.process(image);
    for (std::size_t k = 0; k < vector_.scan().range_m.size(); ++k) {
      EXPECT_TRUE(std::isfinite(vector_.scan().range_m[k]) && std::isfinite(vector_.scan().sigma_m[k]));
      EXPECT_TRUE(std::isfinite(vector_.boundary().inverse_m[k]) && vector_.boundary().sigma[k] >= 0.0f);
    }
  }
}

}  // namespace
}  // namespace omnifleet::test
