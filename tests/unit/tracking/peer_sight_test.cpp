#include "tracking/peer_sight.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tracking/outline_split.h"

namespace omnifleet::tracking {
namespace {

constexpr double kRadius_m = 0.15, kHeight_m = 0.3, kCamera_m = 0.5, kMargin_m = 0.05;
constexpr std::size_t kRays = 360;

RobotBody bodyOf() {
  RobotBody body;
  body.radius_m = kRadius_m;
  body.height_m = kHeight_m;
  return body;
}

/// A peer 1 m ahead of the camera.
class PeerSightTest : public testing::Test {
 protected:
  PeerSightTest()
      : peer_{"r2", BodyModel(bodyOf())}, eye_(viewOf(silhouette())), sight_(peerAt(1.0), eye_, kMargin_m) {}

  const Peer& peerAt(double x_m) {
    peer_.known = true;
    peer_.centre_m = {x_m, 0.0};
    return peer_;
  }
  static Polygon disc(double x_m, double radius_m, int first = 0, int last = 96) {
    Polygon points;
    for (int k = first; k < last; ++k)
      points.emplace_back(x_m + radius_m * std::cos(M_PI * k / 48), radius_m * std::sin(M_PI * k / 48));
    return points;
  }
  /// Its top, seen on the floor.
  static Polygon top() {
    const double scale = kCamera_m / (kCamera_m - kHeight_m);
    return disc(scale, scale * kRadius_m);
  }
  static Polygon silhouette() {
    Polygon all = disc(1.0, kRadius_m);
    for (const auto& point : top()) all.push_back(point);
    return all;
  }
  static View viewOf(const Polygon& points, int directions = SupportFunction::kDirections) {
    View view;
    view.supports = SupportFunction::of(points, Eigen::Vector2d::Zero(), 0.01, directions);
    view.camera_height_m = kCamera_m;
    return view;
  }
  /// Floor all around, undecided on bearings up to this far to both sides.
  static Scan scanWith(double range_m, int beside_deg) {
    Scan scan;
    scan.range_m.assign(kRays, 2.5F);
    scan.label.assign(kRays, RayLabel::kFloorEnd);
    for (int k = -beside_deg; k <= beside_deg; ++k) {
      const auto ray = static_cast<std::size_t>((k + 360) % 360);
      scan.range_m[ray] = static_cast<float>(range_m);
      scan.label[ray] = RayLabel::kUndecided;
    }
    return scan;
  }

  Peer peer_;
  View eye_;
  PeerSight sight_;
};

TEST_F(PeerSightTest, AllOfItIsNoPiece) {
  EXPECT_TRUE(sight_.isWhole(viewOf(silhouette())));
  EXPECT_TRUE(sight_.encloses(viewOf(silhouette())));
  EXPECT_EQ(sight_.sharedDirections(viewOf(silhouette())), SupportFunction::kDirections);
}

TEST_F(PeerSightTest, ItsTopIsAPiece) {
  View view = viewOf(top());
  EXPECT_FALSE(sight_.isWhole(view));
  EXPECT_TRUE(sight_.encloses(view));
  EXPECT_GT(sight_.sharedDirections(view), 20);
  sight_.keepOwn(view);
  EXPECT_EQ(usableDirections(view), sight_.sharedDirections(view));
  EXPECT_FALSE(view.usable(48)) << "towards the camera a top does not show where its robot stands";
  EXPECT_TRUE(view.usable(0));
}

TEST_F(PeerSightTest, WhatStandsBeforeItIsNone) {
  EXPECT_FALSE(sight_.encloses(viewOf(disc(0.75, 0.06))));
  Polygon both = top();
  for (const auto& point : disc(0.75, 0.06)) both.push_back(point);
  EXPECT_FALSE(sight_.encloses(viewOf(both)));
}

// Its right half in shade, and a shadow on the floor beside it, 15 cm wide.
TEST_F(PeerSightTest, ItsShadeBesideItIsInThePiece) {
  Polygon shaded = disc(1.0, kRadius_m, 48);
  for (const auto& point : disc(1.08, 0.05)) shaded.emplace_back(point.x(), point.y() - 0.25);
  const View view = viewOf(shaded);
  double most_m = 0.0;
  for (std::size_t k = 0; k < view.size(); ++k)
    most_m = std::max(most_m, static_cast<double>(view.supports.b_m[k] - eye_.supports.b_m[k]));
  EXPECT_GT(most_m, 2.5 * kMargin_m) << "else it is a piece without any shade";
  EXPECT_FALSE(sight_.isWhole(view));
  EXPECT_TRUE(sight_.encloses(view));
}

TEST_F(PeerSightTest, WhatOnlyStandsBesideItIsNone) {
  for (const double aside_m : {-0.25, 0.25}) {
    Polygon beside = disc(1.08, 0.05);
    for (auto& point : beside) point.y() += aside_m;
    EXPECT_FALSE(sight_.encloses(viewOf(beside))) << aside_m;
  }
}

TEST_F(PeerSightTest, OutlinesOfOtherKindsAreNotCompared) {
  EXPECT_FALSE(sight_.encloses(viewOf(top(), 48)));
  EXPECT_FALSE(sight_.isWhole(viewOf(silhouette(), 48)));
}

TEST_F(PeerSightTest, PiecesMakeOneOutline) {
  View one = viewOf(disc(1.0, kRadius_m));
  joinOutlines(viewOf(top()), one);
  EXPECT_TRUE(sight_.isWhole(one));
}

/// All of its outline is cut, by the edge of the view or by others: it shows nothing.
TEST_F(PeerSightTest, AnOutlineWithoutDirectionsIsNotWhole) {
  View cut = viewOf(silhouette());
  cut.supports.sigma_m.assign(cut.size(), -1.0F);
  EXPECT_FALSE(sight_.isWhole(cut));
  cut.supports.sigma_m[0] = 0.01F;
  EXPECT_FALSE(sight_.isWhole(cut));
}

/// It takes up ±9°, and so does its top, which begins at 2.1 m.
TEST_F(PeerSightTest, SomethingIsThereWhereMostOfItsBearingsEnd) {
  EXPECT_TRUE(sight_.isUndecided(scanWith(0.9, 12)));
  EXPECT_FALSE(sight_.isUndecided(scanWith(0.9, 2))) << "floor beside";
  EXPECT_TRUE(sight_.isUndecided(scanWith(2.0, 12))) << "its top alone";
  EXPECT_FALSE(sight_.isUndecided(scanWith(2.3, 12))) << "floor up to behind where its top begins";
  EXPECT_FALSE(sight_.isUndecided(scanWith(0.6, 12))) << "something before it";
  Scan hidden = scanWith(0.9, 12);
  for (std::size_t i = 0; i < kRays; ++i)
    if (i > 2 && i < 358) hidden.range_m[i] = 0.4F;
  EXPECT_FALSE(sight_.isUndecided(hidden)) << "nearly all of it is hidden";
  Scan none;
  EXPECT_FALSE(sight_.isUndecided(none));
}

/// It stands from 0.85 to 1.15 m.
TEST_F(PeerSightTest, ItMayBeWhereTheScanDoesNotLookThrough) {
  EXPECT_FALSE(sight_.mayBeThere(scanWith(2.5, 0))) << "floor all over";
  EXPECT_TRUE(sight_.mayBeThere(scanWith(0.9, 12))) << "something where it stands";
  EXPECT_TRUE(sight_.mayBeThere(scanWith(0.4, 12))) << "hidden";
  EXPECT_TRUE(sight_.mayBeThere(scanWith(0.4, 7))) << "most of it is";
  EXPECT_FALSE(sight_.mayBeThere(scanWith(0.4, 3))) << "half of it would be seen";
  EXPECT_FALSE(sight_.mayBeThere(scanWith(1.4, 12))) << "something behind it";
}

}  // namespace
}  // namespace omnifleet::tracking
