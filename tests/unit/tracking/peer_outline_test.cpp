#include "tracking/peer_outline.h"

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
class PeerOutlineTest : public testing::Test {
 protected:
  PeerOutlineTest()
      : peer_{"r2", BodyModel(bodyOf())},
        eye_(viewOf(silhouette())),
        expected_(peerAt(1.0), eye_, kMargin_m) {}

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
  /// The top, projected on the floor.
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
  /// Floor in all directions. The scan is undecided at `range_m` on bearings up to ±`beside_deg`.
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
  PeerOutline expected_;
};

TEST_F(PeerOutlineTest, RecognizesTheWholePeer) {
  EXPECT_TRUE(expected_.isWhole(viewOf(silhouette())));
  EXPECT_TRUE(expected_.encloses(viewOf(silhouette())));
  EXPECT_EQ(expected_.sharedDirections(viewOf(silhouette())), SupportFunction::kDirections);
}

TEST_F(PeerOutlineTest, RecognizesItsTopAsAPiece) {
  View view = viewOf(top());
  EXPECT_FALSE(expected_.isWhole(view));
  EXPECT_TRUE(expected_.encloses(view));
  EXPECT_GT(expected_.sharedDirections(view), 20);
  expected_.keepOwn(view);
  EXPECT_EQ(usableDirections(view), expected_.sharedDirections(view));
  EXPECT_FALSE(view.usable(48)) << "on the near side the top does not show the contact";
  EXPECT_TRUE(view.usable(0));
}

TEST_F(PeerOutlineTest, RejectsObjectInFrontOfThePeer) {
  EXPECT_FALSE(expected_.encloses(viewOf(disc(0.75, 0.06))));
  Polygon both = top();
  for (const auto& point : disc(0.75, 0.06)) both.push_back(point);
  EXPECT_FALSE(expected_.encloses(viewOf(both)));
}

// The right half of the peer is in shadow. A 15 cm wide shadow lies on the floor beside it.
TEST_F(PeerOutlineTest, AcceptsPieceWithShadowBesideThePeer) {
  Polygon shaded = disc(1.0, kRadius_m, 48);
  for (const auto& point : disc(1.08, 0.05)) shaded.emplace_back(point.x(), point.y() - 0.25);
  const View view = viewOf(shaded);
  double most_m = 0.0;
  for (std::size_t k = 0; k < view.size(); ++k)
    most_m = std::max(most_m, static_cast<double>(view.supports.b_m[k] - eye_.supports.b_m[k]));
  EXPECT_GT(most_m, 2.5 * kMargin_m) << "otherwise the piece would contain no shadow";
  EXPECT_FALSE(expected_.isWhole(view));
  EXPECT_TRUE(expected_.encloses(view));
}

TEST_F(PeerOutlineTest, RejectsObjectBesideThePeer) {
  for (const double aside_m : {-0.25, 0.25}) {
    Polygon beside = disc(1.08, 0.05);
    for (auto& point : beside) point.y() += aside_m;
    EXPECT_FALSE(expected_.encloses(viewOf(beside))) << aside_m;
  }
}

TEST_F(PeerOutlineTest, RejectsOutlineWithOtherNumberOfDirections) {
  EXPECT_FALSE(expected_.encloses(viewOf(top(), 48)));
  EXPECT_FALSE(expected_.isWhole(viewOf(silhouette(), 48)));
}

TEST_F(PeerOutlineTest, JoinsPiecesToOneOutline) {
  View one = viewOf(disc(1.0, kRadius_m));
  joinOutlines(viewOf(top()), one);
  EXPECT_TRUE(expected_.isWhole(one));
}

/// The whole outline is cut, by the image edge or by other objects.
TEST_F(PeerOutlineTest, RejectsOutlineWithoutUsableDirections) {
  View cut = viewOf(silhouette());
  cut.supports.sigma_m.assign(cut.size(), -1.0F);
  EXPECT_FALSE(expected_.isWhole(cut));
  cut.supports.sigma_m[0] = 0.01F;
  EXPECT_FALSE(expected_.isWhole(cut));
}

/// The peer occupies ±9°. So does the image of its top, which begins at 2.1 m.
TEST_F(PeerOutlineTest, DetectsUndecidedScanAtThePeer) {
  EXPECT_TRUE(expected_.isUndecided(scanWith(0.9, 12)));
  EXPECT_FALSE(expected_.isUndecided(scanWith(0.9, 2))) << "floor on most bearings";
  EXPECT_TRUE(expected_.isUndecided(scanWith(2.0, 12))) << "the scan ends at its top";
  EXPECT_FALSE(expected_.isUndecided(scanWith(2.3, 12))) << "floor up to behind the beginning of its top";
  EXPECT_FALSE(expected_.isUndecided(scanWith(0.6, 12))) << "an object in front of it";
  Scan hidden = scanWith(0.9, 12);
  for (std::size_t i = 0; i < kRays; ++i)
    if (i > 2 && i < 358) hidden.range_m[i] = 0.4F;
  EXPECT_FALSE(expected_.isUndecided(hidden)) << "nearly the whole peer is hidden";
  Scan none;
  EXPECT_FALSE(expected_.isUndecided(none));
}

/// The peer occupies ranges from 0.85 to 1.15 m.
TEST_F(PeerOutlineTest, MayBePresentUnlessScanSeesPast) {
  EXPECT_FALSE(expected_.mayBeThere(scanWith(2.5, 0))) << "floor everywhere";
  EXPECT_TRUE(expected_.mayBeThere(scanWith(0.9, 12))) << "an object at its place";
  EXPECT_TRUE(expected_.mayBeThere(scanWith(0.4, 12))) << "hidden";
  EXPECT_TRUE(expected_.mayBeThere(scanWith(0.4, 7))) << "mostly hidden";
  EXPECT_FALSE(expected_.mayBeThere(scanWith(0.4, 3))) << "half of it would be visible";
  EXPECT_FALSE(expected_.mayBeThere(scanWith(1.4, 12))) << "an object behind it";
}

}  // namespace
}  // namespace omnifleet::tracking
