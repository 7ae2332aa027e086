#include "ground/far_floor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

struct Lamp {
  double height_m = 2.0, aside_m = 0.0;
};

/// A bare floor under a lamp (Lambert: the cube of the cosine over the squared height), a twelfth of its
/// light all over; 160 grey levels at the camera's foot. @param curve exponent of the camera's tone curve
cv::Mat3b floorUnder(const Lamp& lamp, const lens::Camera& camera, double curve) {
  const auto& model = camera.model();
  cv::Mat3b image(model.image_height_px, model.image_width_px, cv::Vec3b(60, 70, 80));
  std::mt19937 random(1);
  std::normal_distribution<double> gauss(0.0, 1.5);
  const auto lightAt = [&](const Eigen::Vector2d& p) {
    const double tangent = (p - Eigen::Vector2d(lamp.aside_m, 0.0)).norm() / lamp.height_m;
    return std::pow(1.0 + tangent * tangent, -1.5);
  };
  const double at_foot = lightAt(camera.foot());
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto point = camera.floorFromPixel(Eigen::Vector2d(u, v));
      if (!point) continue;
      const double light = std::pow(0.92 * lightAt(*point) / at_foot + 0.08, curve);
      for (int c = 0; c < 3; ++c)
        image(v, u)[c] = cv::saturate_cast<std::uint8_t>((150.0 + 12.0 * c) * light + gauss(random));
    }
  }
  return image;
}

/// Of the view, what is taken for objects.
double shareOfObjects(const Lamp& lamp, const lens::CameraModel& model, double curve) {
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  GroundSegmenter segmenter(camera, view, SegmenterOptions{});
  EXPECT_TRUE(segmenter.segment(floorUnder(lamp, camera, curve)));
  return static_cast<double>(cv::countNonZero(segmenter.objects())) / cv::countNonZero(view.mask());
}

constexpr double kLinear = 1.0, kDisplay = 1.0 / 2.2;

TEST(FarFloor, UnderALowLampIsFloorToTheHorizon) {
  for (const int width : {640, 1280})
    EXPECT_LT(shareOfObjects({1.6}, testing::fisheye(width, width * 3 / 4), kLinear), 0.001) << width;
}

TEST(FarFloor, UnderLampsOfRoomsIsFloorAsCamerasShowIt) {
  for (const double height : {2.0, 2.6, 3.5})
    for (const double aside : {0.0, 1.0})
      EXPECT_LT(shareOfObjects({height, aside}, testing::fisheye(), kDisplay), 0.001)
          << height << " " << aside;
}

// No tone curve: all that a lamp loses by distance is in the picture.
TEST(FarFloor, UnderLampsOfRoomsIsFloorToALinearCamera) {
  for (const double height : {1.6, 2.0, 2.6, 3.5})
    for (const double aside : {0.0, 1.0})
      EXPECT_LT(shareOfObjects({height, aside}, testing::fisheye(), kLinear), 0.005)
          << height << " " << aside;
}

TEST(FarFloor, AwayFromALampIsFloorWhereItDarkens) {
  for (const double height : {1.6, 2.0, 2.6, 3.5}) {
    EXPECT_LT(shareOfObjects({height, 2.5}, testing::fisheye(), kDisplay), 0.02) << height;
    EXPECT_LT(shareOfObjects({height, 2.5}, testing::fisheye(), kLinear), 0.07) << height;
  }
}

/// Objects within a disc in the dark far off, and around it.
struct Found {
  int within = 0, beyond = 0;
};

Found foundAround(const Lamp& lamp, const cv::Vec3d& gains) {
  const auto model = testing::fisheye();
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  cv::Mat3b image = floorUnder(lamp, camera, kLinear);
  const cv::Point2d middle(model.principal_point_px.x() + 186.0, model.principal_point_px.y());
  const auto isWithin = [&](int v, int u) { return std::hypot(u - middle.x, v - middle.y) < 15.0; };
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      for (int c = 0; c < 3 && isWithin(v, u); ++c)
        image(v, u)[c] = cv::saturate_cast<std::uint8_t>(gains[c] * image(v, u)[c]);
  GroundSegmenter segmenter(camera, view, SegmenterOptions{});
  EXPECT_TRUE(segmenter.segment(image));
  Found found;
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      if (segmenter.objects()(v, u) != 0) ++(isWithin(v, u) ? found.within : found.beyond);
  return found;
}

// Growth ends before its edge: what is known of the light behind it is that of floor as far away.
TEST(FarFloor, AThingInTheDarkIsWholeAndNoMore) {
  const double area_px = M_PI * 15.0 * 15.0, rim_px = 2.0 * M_PI * 15.0;
  const Found red = foundAround({2.6, 0.0}, {0.4, 0.6, 1.2});
  EXPECT_GT(red.within, 0.9 * area_px);
  EXPECT_LT(red.beyond, 2.0 * rim_px);
  const Found dark = foundAround({2.6, 0.0}, {0.3, 0.3, 0.3});
  EXPECT_GT(dark.within, 0.9 * area_px);
  EXPECT_LT(dark.beyond, 2.0 * rim_px);
}

// Equidistant: a block shows h·Δθ/cos²θ of floor outward.
TEST(FarFloor, SteepensAsTheFloorOfABlockGrows) {
  const auto model = testing::fisheye();
  const lens::Camera camera(model);
  const int block = 4;
  const FarFloor far(camera, {model.image_width_px / block, model.image_height_px / block}, block);
  const auto angleAt = [&](double x, double y) {
    return std::hypot((x + 0.5) * block - 0.5 - model.principal_point_px.x(),
                      (y + 0.5) * block - 0.5 - model.principal_point_px.y()) /
           model.focal_px.x();
  };
  const int row = model.image_height_px / block / 2, columns = model.image_width_px / block;
  int compared = 0;
  for (int x = columns / 2 + 8; x < columns; ++x) {
    const double here = angleAt(x, row), next = angleAt(x + 1, row), after = angleAt(x + 2, row);
    if (after > 85.0 * M_PI / 180.0) break;
    const auto& to = far[row * columns + x];
    const double expected = std::sqrt((std::tan(after) - std::tan(next)) / (std::tan(next) - std::tan(here)));
    EXPECT_NEAR(to.steepening, expected, 0.01) << x;
    EXPECT_EQ(to.outward & 1u, 1u) << "to the right";
    EXPECT_EQ(to.outward >> 2 & 1u, 0u) << "back";
    ++compared;
  }
  EXPECT_GT(compared, 15);
}

TEST(FarFloor, GoesOnNowhereBeyondTheHorizon) {
  const auto model = testing::fisheye();
  const lens::Camera camera(model);
  const int columns = model.image_width_px / 4;
  const FarFloor far(camera, {columns, model.image_height_px / 4}, 4);
  EXPECT_EQ(far[0].outward, 0);
  EXPECT_EQ(far[0].steepening, 1.0f);
}

}  // namespace
}  // namespace omnifleet::ground
