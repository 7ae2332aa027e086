// Tests of the filter, the body fit and the displacement with closed-form silhouettes. For a convex footprint
// P seen from c the silhouette's support is g where g < 0 and s·g elsewhere, with g the support of P about c
// and s = H/(H − h).

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tracking/body_fit.h"
#include "tracking/outline_split.h"
#include "tracking/prism_filter.h"
#include "tracking/remembered_outline.h"
#include "tracking/view.h"

namespace omnifleet::tracking {
namespace {

constexpr double kCameraHeight_m = 0.5;

View viewOf(const Polygon& footprint_in_odom, double height_m, const Pose2& odom_from_base,
            double sigma_m = 0.003) {
  View view;
  view.foot_m = odom_from_base.translation();
  view.heading_rad = odom_from_base.theta_rad;
  view.camera_height_m = kCameraHeight_m;
  Polygon points;
  const double s = kCameraHeight_m / (kCameraHeight_m - height_m);
  for (const auto& p : footprint_in_odom) {
    const Eigen::Vector2d in_base = odom_from_base.inverse() * p;
    points.push_back(in_base);
    points.push_back(s * in_base);
  }
  view.supports = SupportFunction::of(points, Eigen::Vector2d::Zero(), sigma_m);
  return view;
}

Polygon boxAt(const Eigen::Vector2d& centre, double length_m, double width_m, double heading_rad) {
  const Pose2 pose{centre.x(), centre.y(), heading_rad};
  const double a = 0.5 * length_m, b = 0.5 * width_m;
  return {pose * Eigen::Vector2d(-a, -b), pose * Eigen::Vector2d(a, -b), pose * Eigen::Vector2d(a, b),
          pose * Eigen::Vector2d(-a, b)};
}

TEST(PrismFilter, PredictsTheObservedSupports) {
  const Eigen::Vector2d centre(0.8, 0.3);
  PrismFilter filter({}, centre, kCameraHeight_m);
  filter.assumeBody(0.15, 0.3, true);
  const Polygon circle = circlePolygon(centre, 0.15, 720);
  for (const Pose2& pose : {Pose2{0, 0, 0}, Pose2{-0.4, 0.5, 1.1}, Pose2{0.5, -1.0, -2.5}}) {
    const View view = viewOf(circle, 0.3, pose);
    for (std::size_t k = 0; k < view.size(); ++k) {
      EXPECT_NEAR(filter.predictedSupport(view, k), view.supports.b_m[k],
                  1e-5);  // 720-gon and float rounding
    }
  }
}

TEST(PrismFilter, EstimatesHeightFromParallax) {
  const Eigen::Vector2d centre(1.0, 0.4);
  for (const double height : {0.1, 0.2, 0.35}) {
    PrismFilter filter({}, {0.9, 0.35}, kCameraHeight_m);
    for (int i = 0; i < 12; ++i) {
      const Pose2 pose{0.05 * i, -0.03 * i, 0.1 * i};
      if (i > 0) filter.predict(0.1, false, true, Eigen::Matrix2d::Zero());
      filter.update(viewOf(boxAt(centre, 0.24, 0.16, 0.5), height, pose));
    }
    EXPECT_NEAR(filter.height(), height, 0.01);  // corners beyond the fourth harmonic: 5 mm
    EXPECT_LT((filter.position() - centre).norm(), 0.01);
    EXPECT_LT(filter.velocity().norm(), 0.02);
  }
}

TEST(PrismFilter, KeepsDistanceWhenOnlyTheFarSideIsVisible) {
  // The far side alone does not determine distance and height. Noise must not count as information on them.
  std::mt19937 rng(3);
  std::normal_distribution<double> noise(0.0, 0.02);
  const Eigen::Vector2d centre(1.9, 0.0);
  PrismFilter filter({}, centre, kCameraHeight_m);
  filter.placeAt(centre, Eigen::Vector2d::Zero(), 0.16 * Eigen::Matrix2d::Identity());
  const View clean = viewOf(circlePolygon(centre, 0.12, 96), 0.25, {}, 0.02);
  for (int i = 0; i < 100; ++i) {
    View view = clean;
    for (std::size_t k = 0; k < view.size(); ++k) {
      view.supports.b_m[k] += static_cast<float>(noise(rng));
      if (clean.supports.b_m[k] < 0.2F) view.supports.sigma_m[k] = -1.0F;
    }
    if (i > 0) filter.predict(0.1, false, true, Eigen::Matrix2d::Zero());
    filter.update(view);
  }
  EXPECT_LT((filter.position() - centre).norm(), 0.3);  // the prior's own uncertainty is 0.4 m
}

TEST(PrismFilter, TracksMovingObject) {
  PrismFilter filter({}, {1.0, 0.0}, kCameraHeight_m);
  filter.assumeBody(0.15, 0.3, true);
  const Eigen::Vector2d velocity(0.2, -0.25);
  for (int i = 0; i < 20; ++i) {
    if (i > 0) filter.predict(0.1, true, true, Eigen::Matrix2d::Zero());
    filter.update(viewOf(circlePolygon(Eigen::Vector2d(1.0, 0.0) + 0.1 * i * velocity, 0.15, 96), 0.3,
                         {0.02 * i, 0.0, 0.0}));
  }
  EXPECT_LT((filter.velocity() - velocity).norm(), 0.02);
  EXPECT_LT((filter.position() - Eigen::Vector2d(1.0, 0.0) - 1.9 * velocity).norm(), 0.005);
}

TEST(PrismFilter, IgnoresUnusableDirections) {
  PrismFilter filter({}, {0.9, 0.0}, kCameraHeight_m);
  View view = viewOf(circlePolygon({1.0, 0.0}, 0.15, 96), 0.2, {});
  for (std::size_t k = 0; k < view.size(); k += 2) {
    view.supports.b_m[k] = 50.0F;
    view.supports.sigma_m[k] = k % 4 == 0 ? -1.0F : std::nanf("");
  }
  for (int i = 0; i < 3; ++i) filter.update(view);
  EXPECT_NEAR(filter.position().x(), 1.0, 0.1);
  EXPECT_NEAR(filter.position().y(), 0.0, 0.02);
}

TEST(PrismFilter, ReturnsItsFootprint) {
  const Eigen::Vector2d centre(1.0, 0.2);
  PrismFilter filter({}, centre, kCameraHeight_m);
  for (int i = 0; i < 10; ++i)
    filter.update(viewOf(boxAt(centre, 0.3, 0.2, 0.3), 0.2, {0.08 * i, -0.05 * i, 0.0}));
  const Polygon footprint = filter.footprint(48);
  EXPECT_NEAR(signedArea(footprint), 0.06, 0.008);  // four harmonics round the corners off
  EXPECT_LT((centroid(footprint) - centre).norm(), 0.01);
}

TEST(BodyModel, FitsCircleInClosedForm) {
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  const BodyModel model(body);
  for (const Eigen::Vector2d& centre : {Eigen::Vector2d(0.5, 0.2), Eigen::Vector2d(-1.2, 0.9)}) {
    const BodyFit fit = model.fit(viewOf(circlePolygon(centre, 0.15, 720), 0.3, {0.1, -0.2, 0.7}));
    ASSERT_TRUE(fit.valid);
    EXPECT_LT((fit.centre_m - centre).norm(), 1e-4);  // 720-gon and float rounding
    EXPECT_LT(fit.rms_m, 1e-4);
  }
}

TEST(BodyModel, RejectsOtherHeightOrSize) {
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  const BodyModel model(body);
  const Eigen::Vector2d centre(1.0, 0.3);
  EXPECT_GT(model.fit(viewOf(circlePolygon(centre, 0.15, 96), 0.15, {})).rms_m, 0.05);
  EXPECT_GT(model.fit(viewOf(circlePolygon(centre, 0.06, 96), 0.3, {})).rms_m, 0.05);
  EXPECT_GT(model.fit(viewOf(boxAt(centre, 0.5, 0.2, 0.0), 0.3, {})).rms_m, 0.03);
}

TEST(BodyModel, FitsHeadingOfFootprint) {
  RobotBody body;
  body.footprint_m = {{-0.1, -0.12}, {0.25, -0.12}, {0.25, 0.12}, {-0.1, 0.12}};
  body.height_m = 0.2;
  const BodyModel model(body);
  const Pose2 pose{0.9, -0.4, 0.6};
  Polygon placed;
  for (const auto& p : body.footprint_m) placed.push_back(pose * p);
  const BodyFit fit = model.fit(viewOf(placed, 0.2, {0.0, 0.0, 0.3}));
  ASSERT_TRUE(fit.valid);
  const double off =
      std::abs(std::remainder(fit.heading_rad - 0.6, M_PI));  // a rectangle looks the same from behind
  EXPECT_LT(off, 2.0 * M_PI / 96);                            // the grid of headings
  EXPECT_LT((fit.centre_m - pose * Eigen::Vector2d(0.075, 0.0)).norm(), 0.01);
  EXPECT_LT((model.offset() - Eigen::Vector2d(0.075, 0.0)).norm(),
            1e-3);  // Steiner point of a rectangle: its middle
}

TEST(BodyModel, IsInvalidWithTooFewDirections) {
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.3;
  View view = viewOf(circlePolygon({1.0, 0.0}, 0.15, 96), 0.3, {});
  for (std::size_t k = 6; k < view.size(); ++k) view.supports.sigma_m[k] = -1.0F;
  EXPECT_FALSE(BodyModel(body).fit(view).valid);
  EXPECT_FALSE(BodyModel(body).fit(View()).valid);
}

TEST(ContactDisplacement, NeedsNoHeight) {
  const Eigen::Vector2d from(1.0, 0.5), moved(0.07, -0.12);
  for (const double height : {0.05, 0.3, 0.45}) {
    const View then = viewOf(boxAt(from, 0.2, 0.3, 0.4), height, {0.0, 0.0, 0.0});
    const View now = viewOf(boxAt(from + moved, 0.2, 0.3, 0.4), height, {0.1, 0.05, 0.8});
    const Displacement d = contactDisplacement(then, now);
    ASSERT_TRUE(d.valid);
    EXPECT_LT((d.moved_m - moved).norm(), 2e-3);  // corners between two directions
    EXPECT_LT(d.rms_m, 2e-3);
  }
}

TEST(ContactDisplacement, IsZeroForStationaryObject) {
  const View then = viewOf(boxAt({0.8, 0.1}, 0.2, 0.3, 0.4), 0.2, {0.0, 0.0, 0.0});
  const View now = viewOf(boxAt({0.8, 0.1}, 0.2, 0.3, 0.4), 0.2, {0.3, 0.1, -0.5});
  const Displacement d = contactDisplacement(then, now);
  ASSERT_TRUE(d.valid);
  EXPECT_LT(d.moved_m.norm(), 3e-3);
}

TEST(ContactDisplacement, IsInvalidWithTooFewDirections) {
  View then = viewOf(circlePolygon({0.8, 0.1}, 0.1, 96), 0.2, {});
  EXPECT_FALSE(contactDisplacement(View(), then).valid);
  for (float& sigma : then.supports.sigma_m) sigma = -1.0F;
  EXPECT_FALSE(contactDisplacement(then, then).valid);
}

class MergedOutline : public testing::Test {
 protected:
  PrismFilter knownAt(const Eigen::Vector2d& centre, double height_m) const {
    PrismFilter filter({}, centre, kCameraHeight_m);
    filter.assumeBody(0.15, height_m, true);
    return filter;
  }
  View both() const {
    const View one = viewOf(circlePolygon(near_, 0.15, 96), 0.3, {}),
               other = viewOf(circlePolygon(far_, 0.15, 96), 0.2, {});
    View view = one;
    for (std::size_t k = 0; k < view.size(); ++k) {
      view.supports.b_m[k] = std::max(one.supports.b_m[k], other.supports.b_m[k]);
    }
    return view;
  }
  const Eigen::Vector2d near_{0.7, 0.1}, far_{1.2, -0.2};
};

TEST_F(MergedOutline, GivesEachObjectItsOwnDirections) {
  const PrismFilter near = knownAt(near_, 0.3), far = knownAt(far_, 0.2);
  std::vector<View> own;
  View rest;
  EXPECT_EQ(splitOutline(both(), {{&near, nullptr}, {&far, nullptr}}, 0.02, 0.04, own, rest), 0);
  const View alone_near = viewOf(circlePolygon(near_, 0.15, 96), 0.3, {}),
             alone_far = viewOf(circlePolygon(far_, 0.15, 96), 0.2, {});
  for (std::size_t k = 0; k < own[0].size(); ++k) {
    EXPECT_FALSE(own[0].usable(k) && own[1].usable(k));
    if (own[0].usable(k)) {
      EXPECT_FLOAT_EQ(own[0].supports.b_m[k], alone_near.supports.b_m[k]);
    }
    if (own[1].usable(k)) {
      EXPECT_FLOAT_EQ(own[1].supports.b_m[k], alone_far.supports.b_m[k]);
    }
  }
  EXPECT_GT(usableDirections(own[0]), 20);
  EXPECT_GT(usableDirections(own[1]), 10);
}

TEST_F(MergedOutline, GivesNoDirectionsToAnObjectThatLeft) {
  const PrismFilter near = knownAt(near_, 0.3), gone = knownAt(far_, 0.2);
  std::vector<View> own;
  View rest;
  EXPECT_EQ(splitOutline(viewOf(circlePolygon(near_, 0.15, 96), 0.3, {}),
                         {{&near, nullptr}, {&gone, nullptr}}, 0.02, 0.04, own, rest),
            0);
  EXPECT_EQ(usableDirections(own[1]), 0);
  EXPECT_GT(usableDirections(own[0]), 20);
}

/// An object that stands out behind another one belongs to that one's remembered outline.
TEST_F(MergedOutline, KeepsRememberedOutlineFromANewObject) {
  const PrismFilter near = knownAt(near_, 0.3);
  PrismFilter behind = knownAt(far_ + Eigen::Vector2d(0.02, 0.0), 0.2);
  RememberedOutline outline;
  EXPECT_FALSE(outline.isGood(both()));
  outline.add(both(), near);
  std::vector<View> own;
  View rest;
  splitOutline(both(), {{&near, nullptr}, {&behind, nullptr}}, 0.02, 0.04, own, rest);
  EXPECT_GT(usableDirections(own[1]), 10);
  EXPECT_EQ(splitOutline(both(), {{&near, &outline}, {&behind, nullptr}}, 0.02, 0.04, own, rest), 0);
  EXPECT_EQ(usableDirections(own[1]), 0);
  EXPECT_GT(usableDirections(own[0]), 40);
}

/// The outline with the second object and the outline without it are both remembered.
TEST_F(MergedOutline, RemembersLastAndLargestOutline) {
  const PrismFilter near = knownAt(near_, 0.3);
  RememberedOutline outline;
  outline.add(both(), near);
  const View alone = viewOf(circlePolygon(near_, 0.15, 96), 0.3, {});
  outline.add(alone, near);
  for (std::size_t k = 0; k < alone.size(); ++k) {
    EXPECT_NEAR(outline.expectedSupport(alone, k, near), alone.supports.b_m[k], 1e-5);
    EXPECT_NEAR(outline.expectedSupport(both(), k, near), both().supports.b_m[k], 1e-5);
  }
  View elsewhere = alone;
  elsewhere.foot_m += Eigen::Vector2d(0.2, 0.0);
  EXPECT_FALSE(outline.isGood(elsewhere));
  outline.forget();
  EXPECT_FALSE(outline.isGood(alone));
}

TEST(PrismFilter, ReturnsReachOfItsFootprint) {
  PrismFilter filter({}, {0.9, 0.0}, kCameraHeight_m);
  const Polygon box = boxAt({0.9, 0.0}, 0.2, 0.4, 0.0);
  for (const double y : {-1.2, -0.6, 0.0, 0.6, 1.2}) {
    for (const double x : {-0.2, 2.0}) {
      View view = viewOf(box, 0.1, Pose2{x, y, 0.0});
      filter.update(view);
    }
  }
  // Four harmonics show no corners, and the prior favours round footprints.
  EXPECT_NEAR(filter.reach(0.0), 0.1, 0.03);
  EXPECT_NEAR(filter.reach(0.5 * M_PI), 0.2, 0.03);
}

TEST_F(MergedOutline, ReportsUnexplainedDirectionsAsRest) {
  const PrismFilter near = knownAt(near_, 0.3);
  std::vector<View> own;
  View rest;
  const int unexplained = splitOutline(both(), {{&near, nullptr}}, 0.02, 0.04, own, rest);
  EXPECT_GT(unexplained, 8);
  EXPECT_EQ(unexplained, usableDirections(rest));
  EXPECT_EQ(unexplainedDirections(both(), near, 0.04), unexplained);
}

TEST_F(MergedOutline, MatchesMergedBlobWithItsMembers) {
  EXPECT_LT(outlineDistance(viewOf(circlePolygon(near_, 0.15, 96), 0.3, {}), knownAt(near_, 0.3)), 1e-3);
  EXPECT_TRUE(isEnclosed(both(), knownAt(far_, 0.2), 0.02));
  EXPECT_FALSE(isEnclosed(both(), knownAt({1.0, 1.0}, 0.2), 0.02));
}

/// An object far behind makes one corner that supports half of the directions, with a large σ.
TEST_F(MergedOutline, MatchesNearSideDespiteFarCorner) {
  View view = viewOf(circlePolygon(near_, 0.15, 96), 0.3, {});
  const Eigen::Vector2d corner(6.0, 1.5);
  int pulled = 0;
  for (std::size_t k = 0; k < view.size(); ++k) {
    const double b = corner.dot(Eigen::Vector2d(std::cos(view.angle(k)), std::sin(view.angle(k))));
    if (view.supports.b_m[k] < -0.3) view.supports.sigma_m[k] = -1.0F;  // most of its contact side is hidden
    if (b <= view.supports.b_m[k]) continue;
    view.supports.b_m[k] = static_cast<float>(b);
    view.supports.sigma_m[k] = 0.2F;
    ++pulled;
  }
  EXPECT_GT(2 * pulled, usableDirections(view));
  EXPECT_LT(outlineDistance(view, knownAt(near_, 0.3)), 0.01);
}

}  // namespace
}  // namespace omnifleet::tracking
