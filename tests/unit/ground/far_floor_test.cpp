#include "ground/far_floor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/lamp_floor.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

using testing::floorUnder;
using testing::kDisplay;
using testing::kLinear;
using testing::Lamp;

/// Share of the view that is segmented as objects.
double shareOfObjects(const Lamp& lamp, const lens::CameraModel& model, double curve) {
  const lens::Camera camera(model);
  const FloorView view(camera, ViewOptions{});
  GroundSegmenter segmenter(camera, view, SegmenterOptions{});
  EXPECT_TRUE(segmenter.segment(floorUnder(lamp, camera, curve)));
  return static_cast<double>(cv::countNonZero(segmenter.objects())) / cv::countNonZero(view.mask());
}

TEST(FarFloor, SegmentsFloorToTheHorizonUnderLowLamp) {
  for (const int width : {640, 1280})
    EXPECT_LT(shareOfObjects({1.6}, testing::fisheye(width, width * 3 / 4), kLinear), 0.001) << width;
}

TEST(FarFloor, SegmentsFloorUnderRoomLampsWithToneCurve) {
  for (const double height : {2.0, 2.6, 3.5})
    for (const double aside : {0.0, 1.0})
      EXPECT_LT(shareOfObjects({height, aside}, testing::fisheye(), kDisplay), 0.001)
          << height << " " << aside;
}

// Without a tone curve the image shows the full decrease of a lamp's light with distance.
TEST(FarFloor, SegmentsFloorUnderRoomLampsWithLinearCamera) {
  for (const double height : {1.6, 2.0, 2.6, 3.5})
    for (const double aside : {0.0, 1.0})
      EXPECT_LT(shareOfObjects({height, aside}, testing::fisheye(), kLinear), 0.005)
          << height << " " << aside;
}

TEST(FarFloor, SegmentsDarkFloorAwayFromLamp) {
  for (const double height : {1.6, 2.0, 2.6, 3.5}) {
    EXPECT_LT(shareOfObjects({height, 2.5}, testing::fisheye(), kDisplay), 0.02) << height;
    EXPECT_LT(shareOfObjects({height, 2.5}, testing::fisheye(), kLinear), 0.07) << height;
  }
}

// Equidistant lens: a block shows h·Δθ/cos²θ of floor in the outward direction.
TEST(FarFloor, SteepensWithFloorLengthPerBlock) {
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

TEST(FarFloor, HasNoOutwardStepBeyondTheHorizon) {
  const auto model = testing::fisheye();
  const lens::Camera camera(model);
  const int columns = model.image_width_px / 4;
  const FarFloor far(camera, {columns, model.image_height_px / 4}, 4);
  EXPECT_EQ(far[0].outward, 0);
  EXPECT_EQ(far[0].steepening, 1.0f);
}

}  // namespace
}  // namespace omnifleet::ground
