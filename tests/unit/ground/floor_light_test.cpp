#include "ground/floor_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "ground/ground_segmenter.h"
#include "tests/unit/ground/lamp_floor.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

using testing::floorUnder;
using testing::kAmbient;
using testing::kLinear;
using testing::Lamp;
using testing::lampLightAt;

constexpr int kCell = FloorView::kCell;

/// Region growing over a floor whose cells follow a brightness law, and the light that is fitted to its
/// result.
class FloorLightTest : public ::testing::Test {
 protected:
  FloorLightTest()
      : camera_(testing::fisheye()),
        view_(camera_, ViewOptions{}),
        growing_(view_.coverage(), view_.seeds(), {0.06, 0.022, 3.0}, 0.004),
        light_(camera_, view_.cells(), kCell, 1) {}

  std::optional<Eigen::Vector2d> floorOf(int y, int x) const {
    return camera_.floorFromPixel((Eigen::Vector2d(x, y) + Eigen::Vector2d(0.5, 0.5)) * kCell -
                                  Eigen::Vector2d(0.5, 0.5));
  }
  template <typename Law>
  bool fit(Law law) {
    cv::Mat3f& means = growing_.means();
    for (int y = 0; y < means.rows; ++y) {
      for (int x = 0; x < means.cols; ++x) {
        const auto at = floorOf(y, x);
        const auto level = static_cast<float>(at ? 160.0 * law(*at) : 40.0);
        means(y, x) = {0.9f * level, level, 1.1f * level};
      }
    }
    EXPECT_TRUE(growing_.grow({}));
    EXPECT_TRUE(light_.fit(growing_));
    return light_.darkest() < 0.65;
  }
  /// Illumination relative to the point beneath the lamp.
  static double lit(const Lamp& lamp, const Eigen::Vector2d& at) {
    return kAmbient + (1.0 - kAmbient) * lampLightAt(lamp, at);
  }

  lens::Camera camera_;
  FloorView view_;
  RegionGrowing growing_;
  FloorLight light_;
};

TEST_F(FloorLightTest, PredictsLightBeyondRegionGrowing) {
  const Lamp lamp{2.6, 1.2};
  ASSERT_TRUE(fit([&](const Eigen::Vector2d& at) { return lit(lamp, at); }));
  const cv::Mat1f& light = light_.ofBlocks();
  double worst = 0.0;
  for (int y = 0; y < light.rows; ++y) {
    for (int x = 0; x < light.cols; ++x) {
      const auto at = floorOf(y, x);
      if (!at || at->norm() > 8.0) continue;
      worst = std::max(worst, std::abs(light(y, x) * lit(lamp, camera_.foot()) / lit(lamp, *at) - 1.0));
    }
  }
  EXPECT_LT(worst, 0.1);
}

TEST_F(FloorLightTest, EstimatesAmbientShare) {
  const Lamp lamp{2.6, 1.2};
  ASSERT_TRUE(fit([&](const Eigen::Vector2d& at) { return lit(lamp, at); }));
  light_.ofBlocks();
  const cv::Mat1f& beside = light_.ambientShareOfCells();
  for (int y = 0; y < beside.rows; y += 5) {
    for (int x = 0; x < beside.cols; x += 5) {
      const auto at = floorOf(y, x);
      if (!at || at->norm() > 4.0) continue;
      const double expected = kAmbient / lit(lamp, *at);
      EXPECT_NEAR(beside(y, x), expected, 0.2 * expected) << at->transpose();
    }
  }
}

TEST_F(FloorLightTest, PointsTowardsTheLamp) {
  const Lamp lamp{2.6, 1.2};
  ASSERT_TRUE(fit([&](const Eigen::Vector2d& at) { return lit(lamp, at); }));
  light_.ofBlocks();
  const cv::Mat2f& towards = light_.towardsLampOfCells();
  int compared = 0;
  for (int y = 5; y < towards.rows; y += 7) {
    for (int x = 5; x < towards.cols; x += 7) {
      const auto at = floorOf(y, x);
      if (!at || at->norm() > 4.0 || (*at - lamp.foot()).norm() < 0.5) continue;
      const Eigen::Vector2d step = *at + 0.01 * (lamp.foot() - *at).normalized();
      const Eigen::Vector2d way = (*camera_.pixelFromPoint({step.x(), step.y(), 0.0}) -
                                   *camera_.pixelFromPoint({at->x(), at->y(), 0.0}))
                                      .normalized();
      EXPECT_GT(way.dot(Eigen::Vector2d(towards(y, x)[0], towards(y, x)[1])), 0.97) << at->transpose();
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
}

TEST_F(FloorLightTest, RejectsEvenLight) {
  EXPECT_FALSE(fit([](const Eigen::Vector2d&) { return 1.0; }));
}

// A lens with vignetting of a third at its rim, under even light.
TEST_F(FloorLightTest, RejectsVignetting) {
  const double rim_m = 4.0;
  EXPECT_FALSE(fit([&](const Eigen::Vector2d& at) {
    const double angle = std::atan2(at.norm(), 0.5), rim = std::atan2(rim_m, 0.5);
    return 1.0 - 0.3 * (angle / rim) * (angle / rim);
  }));
}

/// A cylinder of plain colour on the floor under a lamp, with its shadow.
class UnderLampTest : public ::testing::Test {
 protected:
  UnderLampTest() : camera_(testing::fisheye()), view_(camera_, ViewOptions{}) {
    image_ = floorUnder(lamp_, camera_, kLinear);
    is_object_ = cv::Mat1b(image_.size(), std::uint8_t{0});
    is_shadow_ = is_object_.clone();
  }

  /// @param gains brightness of the cylinder per channel, relative to the light at its foot
  /// @param depth light in the shadow, as a share of the ambient light
  void addCylinder(const Eigen::Vector2d& at_m, const cv::Vec3d& gains, double depth = 1.0) {
    constexpr double kRadius_m = 0.15, kHeight_m = 0.3;
    const auto isWithin = [&](const std::optional<Eigen::Vector2d>& point) {
      return point && (*point - at_m).norm() < kRadius_m;
    };
    const double light = lightAt(at_m), shadow = depth * kAmbient / light;
    std::mt19937 random(2);
    std::normal_distribution<double> gauss(0.0, 1.5);
    for (int v = 0; v < image_.rows; ++v) {
      for (int u = 0; u < image_.cols; ++u) {
        const Eigen::Vector2d pixel(u, v);
        for (double z = 0.0; z <= kHeight_m && is_object_(v, u) == 0; z += 0.01)
          is_object_(v, u) = isWithin(camera_.planeFromPixel(pixel, z)) ? 1 : 0;
        const auto floor = camera_.floorFromPixel(pixel);
        for (double z = 0.0; floor && z <= kHeight_m && is_shadow_(v, u) == 0; z += 0.01)
          is_shadow_(v, u) = isWithin(*floor + z / lamp_.height_m * (lamp_.foot() - *floor)) ? 1 : 0;
        if (is_object_(v, u) != 0) is_shadow_(v, u) = 0;
        for (int c = 0; c < 3; ++c) {
          auto& level = image_(v, u)[c];
          if (is_shadow_(v, u) != 0) level = cv::saturate_cast<std::uint8_t>(shadow * level);
          if (is_object_(v, u) != 0)
            level = cv::saturate_cast<std::uint8_t>(gains[c] * (150.0 + 12.0 * c) * light + gauss(random));
        }
      }
    }
  }
  /// Adds a flat patch of the floor's hue.
  void addPatch(const Eigen::Vector2d& at_m, double gain) {
    constexpr double kRadius_m = 0.2;
    for (int v = 0; v < image_.rows; ++v) {
      for (int u = 0; u < image_.cols; ++u) {
        const auto floor = camera_.floorFromPixel(Eigen::Vector2d(u, v));
        if (!floor || (*floor - at_m).norm() > kRadius_m) continue;
        is_object_(v, u) = 1;
        is_shadow_(v, u) = 0;
        for (int c = 0; c < 3; ++c) image_(v, u)[c] = cv::saturate_cast<std::uint8_t>(gain * image_(v, u)[c]);
      }
    }
  }
  double lightAt(const Eigen::Vector2d& at_m) const {
    return kAmbient + (1.0 - kAmbient) * lampLightAt(lamp_, at_m) / lampLightAt(lamp_, camera_.foot());
  }
  /// Shares of the object's pixels and of its shadow's pixels that are segmented as objects.
  std::pair<double, double> found() {
    GroundSegmenter segmenter(camera_, view_, SegmenterOptions{});
    EXPECT_TRUE(segmenter.segment(image_));
    const cv::Mat1b objects = segmenter.objects() != 0;
    return {
        cv::countNonZero(objects & (is_object_ != 0)) / static_cast<double>(cv::countNonZero(is_object_)),
        cv::countNonZero(objects & (is_shadow_ != 0)) / static_cast<double>(cv::countNonZero(is_shadow_))};
  }

  const Lamp lamp_{2.6, -1.5};
  lens::Camera camera_;
  FloorView view_;
  cv::Mat3b image_;
  cv::Mat1b is_object_, is_shadow_;
};

TEST_F(UnderLampTest, TreatsShadowOfColouredObjectAsFloor) {
  addCylinder({0.5, 0.8}, {0.2, 0.3, 1.1});
  const auto [object, shadow] = found();
  EXPECT_GT(object, 0.95);
  EXPECT_LT(shadow, 0.15);
}

TEST_F(UnderLampTest, SegmentsBlackObjectAsAWhole) {
  addCylinder({0.5, 0.8}, {0.04, 0.04, 0.04});
  EXPECT_GT(found().first, 0.95);
}

// Darker than the limit between grey objects and shadow, brighter than the lamp's shadow.
TEST_F(UnderLampTest, SegmentsGreyObjectAsAWhole) {
  addCylinder({0.5, 0.8}, {0.33, 0.33, 0.33});
  EXPECT_GT(found().first, 0.95);
}

// An object also occludes some ambient light from its shadow, so the shadow is darker than ambient light
// alone.
TEST_F(UnderLampTest, TreatsDeepShadowOfAnObjectAsFloor) {
  addCylinder({0.5, 0.8}, {0.2, 0.3, 1.1}, 0.7);
  const auto [object, shadow] = found();
  EXPECT_GT(object, 0.95);
  EXPECT_LT(shadow, 0.15);
}

// A shadow falls away from the lamp. A patch that is equally dark, but lies before an object and merges with
// it, is no shadow.
TEST_F(UnderLampTest, SegmentsDarkPatchBeforeObject) {
  const Eigen::Vector2d object_m(0.5, 0.8);
  constexpr double kDepth = 0.65;
  addCylinder(object_m, {0.2, 0.3, 1.1}, kDepth);
  is_object_ = std::uint8_t{0};
  addPatch(object_m + 0.3 * (lamp_.foot() - object_m).normalized(), kDepth * kAmbient / lightAt(object_m));
  EXPECT_GT(found().first, 0.9);
}

// The lamp is switched off, and other lamps all over the room are switched on.
TEST(FloorLight, DropsLampThatGoesOutAndFindsNextInSameFrame) {
  const lens::Camera camera(testing::fisheye());
  const FloorView view(camera, ViewOptions{});
  GroundSegmenter segmenter(camera, view, SegmenterOptions{});
  const auto shareOfObjects = [&](const Lamp& lamp) {
    EXPECT_TRUE(segmenter.segment(floorUnder(lamp, camera, kLinear)));
    return static_cast<double>(cv::countNonZero(segmenter.objects())) / cv::countNonZero(view.mask());
  };
  constexpr double kEven_m = 100.0;
  for (int frame = 0; frame < 3; ++frame) EXPECT_LT(shareOfObjects({2.0, 1.0}), 0.005);
  for (int frame = 0; frame < 3; ++frame) EXPECT_LT(shareOfObjects({kEven_m, 0.0}), 0.001) << frame;
  EXPECT_LT(shareOfObjects({2.0, -1.0}), 0.005);
}

// No frame loses much floor. The search for a lamp, spread over frames, finds it within two times ten frames.
TEST(FloorLight, FindsLampThatBrightensSlowly) {
  constexpr int kSlowly = 20;  // frames
  const lens::Camera camera(testing::fisheye());
  const FloorView view(camera, ViewOptions{});
  FloorReference reference(camera, view, ReferenceOptions{});
  CellMeans means(view);
  NoiseMeter meter(view);
  const cv::Mat3b even = floorUnder({100.0, 0.0}, camera, kLinear),
                  lit = floorUnder({2.0, 0.0}, camera, kLinear);
  const auto shareOfFloor = [&](double of_lit) {
    const cv::Mat image = (1.0 - of_lit) * even + of_lit * lit;
    means.read(image);
    EXPECT_TRUE(
        reference.learn({means.means(), meter.measure(image, means.means()) / FloorView::kCell, false}));
    int cells = 0, floor = 0;
    for (int y = 0; y < means.means().rows; ++y) {
      for (int x = 0; x < means.means().cols; ++x) {
        cells += view.coverage()(y, x) == 2 ? 1 : 0;
        floor += reference.isGrown(y, x) ? 1 : 0;
      }
    }
    return static_cast<double>(floor) / cells;
  };
  const double all = shareOfFloor(0.0);
  for (int frame = 1; frame <= kSlowly; ++frame)
    EXPECT_GT(shareOfFloor(frame / static_cast<double>(kSlowly)), 0.95 * all) << frame;
  EXPECT_NE(reference.lampLight(), nullptr);
  EXPECT_EQ(shareOfFloor(1.0), all);
}

/// Number of object pixels inside a disc in the dark far away, and outside it.
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

// Region growing ends before the disc's edge. The light behind it is predicted from floor at the same
// distance.
TEST(FloorLight, SegmentsObjectInTheDarkAsAWhole) {
  const double area_px = M_PI * 15.0 * 15.0, rim_px = 2.0 * M_PI * 15.0;
  const Found red = foundAround({2.6, 0.0}, {0.4, 0.6, 1.2});
  EXPECT_GT(red.within, 0.9 * area_px);
  EXPECT_LT(red.beyond, 2.0 * rim_px);
  const Found dark = foundAround({2.6, 0.0}, {0.3, 0.3, 0.3});
  EXPECT_GT(dark.within, 0.9 * area_px);
  EXPECT_LT(dark.beyond, 2.0 * rim_px);
}

}  // namespace
}  // namespace omnifleet::ground
