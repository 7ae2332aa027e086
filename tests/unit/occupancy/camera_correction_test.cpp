// Contributions of a wrongly calibrated camera, compared with those of a correctly calibrated one. Each point
// is projected to a pixel with the real lens and back to the floor with the calibrated one.
#include "occupancy/camera_correction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lens/camera.h"
#include "occupancy/contribution_store.h"
#include "occupancy/occupancy_map.h"

namespace omnifleet::occupancy {
namespace {

constexpr double kHeight_m = 0.5;
const Eigen::Vector2d kFoot_m(0.05, -0.02);
const CameraErrorPpm kError{3000, -2000, -3500, 2500};

lens::CameraModel calibrated(const CameraErrorPpm& error, lens::Projection projection) {
  lens::CameraModel model;
  model.projection = projection;
  model.image_width_px = model.image_height_px = 480;
  model.focal_px = Eigen::Vector2d::Constant(150.0 * (1.0 + 1e-6 * error[0]));
  model.principal_point_px = {239.5, 239.5};
  model.fov_deg = 170.0;
  model.position_m = {kFoot_m.x(), kFoot_m.y(), kHeight_m * (1.0 + 1e-6 * error[1])};
  model.rotation_rpy_deg.x() += 1e-6 * error[2] * 180.0 / M_PI;
  model.rotation_rpy_deg.y() += 1e-6 * error[3] * 180.0 / M_PI;
  return model;
}

/// Floor position that a camera with that error computes for a floor point.
Eigen::Vector2d seen(const Eigen::Vector2d& floor_m, const CameraErrorPpm& error,
                     lens::Projection projection = lens::Projection::kEquidistant) {
  const lens::Camera real(calibrated({}, projection)), wrong(calibrated(error, projection));
  return wrong.floorFromPixel(*real.pixelFromPoint({floor_m.x(), floor_m.y(), 0.0})).value();
}

/// Silhouette of an upright cylinder: its foot, and its top projected onto the floor behind.
Polygon silhouette() {
  const double height_m = 0.2, shadow = kHeight_m / (kHeight_m - height_m);
  Polygon points;
  for (int i = 0; i < 720; ++i) {
    const double a = i * M_PI / 360.0;
    const Eigen::Vector2d p(0.75 + 0.15 * std::cos(a), 0.3 + 0.15 * std::sin(a));
    points.push_back(p);
    points.push_back(kFoot_m + shadow * (p - kFoot_m));
  }
  return points;
}

/// Contribution of a camera with that error.
Contribution contribution(const CameraErrorPpm& error,
                          lens::Projection projection = lens::Projection::kEquidistant) {
  Objects objects;
  objects.robot = "r1";
  objects.acquired_ns = 5;
  objects.camera_height_m = kHeight_m * (1.0 + 1e-6 * error[1]);
  Track track;
  track.visible = true;
  track.id = 3;
  Polygon points = silhouette();
  for (auto& p : points) p = seen(p, error, projection);
  track.supports = SupportFunction::of(points, kFoot_m, 0.002);
  track.supports.sigma_m[7] = 0.0F;
  track.position_m = seen({0.75, 0.3}, error, projection);
  track.contact_m = seen({0.6, 0.2}, error, projection);
  objects.tracks.push_back(track);
  objects.scan.origin_m = kFoot_m;
  for (int i = 0; i < 360; ++i) {  // a round wall; rays around the foot
    const double a = i * M_PI / 180.0;
    const Eigen::Vector2d along(std::cos(a), std::sin(a));
    objects.scan.range_m.push_back(
        static_cast<float>(along.dot(seen(kFoot_m + 0.9 * along, error, projection) - kFoot_m)));
    objects.scan.label.push_back(i == 9 ? RayLabel::kInvalid : RayLabel::kObstacle);
  }
  return makeContribution(objects);
}

double rms(const std::vector<std::int32_t>& a, const std::vector<std::int32_t>& b) {
  double squares = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += std::pow(1e-4 * (a[i] - b[i]), 2);
  return std::sqrt(squares / static_cast<double>(a.size()));
}

TEST(CameraCorrection, RecoversContributionOfCalibratedCamera) {
  for (const auto projection :
       {lens::Projection::kEquidistant, lens::Projection::kOrthographic, lens::Projection::kStereographic}) {
    SCOPED_TRACE(static_cast<int>(projection));
    const Contribution exact = contribution({}, projection), wrong = contribution(kError, projection);
    Contribution right =
        withoutCameraError(wrong, kError, lens::Spread::of(lens::Camera(calibrated({}, projection))));
    EXPECT_EQ(right.views[0].b_dmm[7], wrong.views[0].b_dmm[7]);  // unusable direction
    right.views[0].b_dmm[7] = exact.views[0].b_dmm[7];
    EXPECT_NEAR(right.camera_height_dmm, exact.camera_height_dmm, 1);
    // Second order in the error; larger near the rim of an orthographic lens.
    const double second = projection == lens::Projection::kOrthographic ? 0.06 : 0.05;
    const double before_m = rms(wrong.views[0].b_dmm, exact.views[0].b_dmm);
    EXPECT_GT(before_m, 0.015);
    EXPECT_LT(rms(right.views[0].b_dmm, exact.views[0].b_dmm), second * before_m);
    EXPECT_EQ(right.views[0].sigma_dmm, exact.views[0].sigma_dmm);
    EXPECT_GT(rms(wrong.range_dmm, exact.range_dmm), 0.006);
    EXPECT_LT(rms(right.range_dmm, exact.range_dmm), 0.0005);
    EXPECT_EQ(right.label, exact.label);
    EXPECT_EQ(right.range_dmm[9], 0);
    for (const auto part : {&SupportView::position, &SupportView::contact}) {
      EXPECT_GT(std::abs((wrong.views[0].*part).x_dmm - (exact.views[0].*part).x_dmm), 15);
      EXPECT_NEAR((right.views[0].*part).x_dmm, (exact.views[0].*part).x_dmm, 3);
      EXPECT_NEAR((right.views[0].*part).y_dmm, (exact.views[0].*part).y_dmm, 3);
    }
  }
}

TEST(CameraCorrection, KeepsPointDistanceBelowTheCamera) {
  const Eigen::Vector3d point(0.7, 0.4, 0.15);
  const double below_m = kHeight_m - point.z(), taken_for_m = kHeight_m * (1.0 + 1e-6 * kError[1]);
  const Eigen::Vector2d on_floor = kFoot_m + (point.head<2>() - kFoot_m) * (kHeight_m / below_m);
  const Eigen::Vector2d wrong = kFoot_m + (seen(on_floor, kError) - kFoot_m) * (below_m / taken_for_m);
  Contribution c = contribution(kError);
  const auto dmm = [](double m) { return static_cast<std::int16_t>(std::lround(1e4 * m)); };
  c.points = {{3, dmm(wrong.x()), dmm(wrong.y()), dmm(taken_for_m - below_m), 20}};
  const Contribution right = withoutCameraError(c, kError, {});
  ASSERT_EQ(right.points.size(), 1U);
  EXPECT_GT((wrong - point.head<2>()).norm(), 0.004);
  EXPECT_NEAR(right.points[0].x_dmm, dmm(point.x()), 3);
  EXPECT_NEAR(right.points[0].y_dmm, dmm(point.y()), 3);
  EXPECT_NEAR(right.points[0].z_dmm, dmm(point.z()), 1);
  EXPECT_EQ(right.points[0].sigma_dmm, 20);
}

TEST(CameraCorrection, LeavesContributionWithoutErrorUnchanged) {
  Contribution c = contribution(kError);
  EXPECT_EQ(canonicalBytes(withoutCameraError(c, {}, {})), canonicalBytes(c));
  c.camera_height_dmm = 0;  // a laser
  EXPECT_EQ(canonicalBytes(withoutCameraError(c, kError, {})), canonicalBytes(c));
}

TEST(CameraCorrection, InvalidatesValuesNearTheHorizon) {
  Contribution c = contribution({});
  c.range_dmm[0] = 10'000'000;  // one kilometre: u = 2000
  c.views[0].b_dmm[0] = 10'000'000;
  c.views[0].position = {10'000'000, 0};
  const Contribution right = withoutCameraError(c, kError, {});
  EXPECT_EQ(right.range_dmm[0], 0);
  EXPECT_EQ(right.label[0], RayLabel::kInvalid);
  EXPECT_EQ(right.views[0].sigma_dmm[0], 0);
  EXPECT_EQ(right.views[0].position, c.views[0].position);
}

KeyframePose poseAt(TimeNs time_ns, const CameraErrorPpm& error) {
  KeyframePose pose;
  pose.robot = "r1";
  pose.acquired_ns = time_ns;
  pose.valid = true;
  pose.camera_error = error;
  return pose;
}

TEST(CameraCorrection, AppliesErrorOfLatestPoseInAnyOrder) {
  const Contribution early = contribution(kError);
  const auto expected = canonicalBytes(withoutCameraError(early, kError, {}));
  KeyframePose settled = poseAt(5, kError), invalid = poseAt(11, {1, 1, 1, 1});
  settled.revision = 1;
  invalid.valid = false;
  const std::vector<KeyframePose> poses{poseAt(5, {}), poseAt(9, kError), poseAt(7, {900, 0, 0, 0}), settled,
                                        invalid};
  std::vector<std::size_t> order{0, 1, 2, 3, 4, 5};
  do {
    ContributionStore store;
    for (const std::size_t i : order) {
      i < poses.size() ? store.add(poses[i]) : store.add(early);
    }
    store.correctNext(10);
    ASSERT_EQ(canonicalBytes(*store.find("r1", 5)->corrected), expected);
    ASSERT_EQ(store.cameraError("r1"), kError);
    // Peers receive the contribution as observed; they know the camera error as well.
    ASSERT_EQ(canonicalBytes(*store.find("r1", 5)->contribution), canonicalBytes(early));
  } while (std::next_permutation(order.begin(), order.end()));
}

/// A map that defers its corrections becomes the same map, whatever the errors were in between. It never
/// corrects more at once than requested.
TEST(CameraCorrection, GivesSameMapWhenCorrectionsAreDeferred) {
  constexpr int kContributions = 20;
  constexpr std::size_t kAtOnce = 3;
  OccupancyMap at_once({}, {}), slowly({}, {});
  slowly.correctLater();
  ContributionStore store;
  for (int i = 0; i < kContributions; ++i) {
    Contribution c = contribution(kError);
    c.acquired_ns = 5 + i * 1'000'000'000LL;
    const KeyframePose pose = poseAt(c.acquired_ns, i < 15   ? CameraErrorPpm{}
                                                    : i < 17 ? CameraErrorPpm{900, 0, 0, 0}
                                                             : kError);
    for (OccupancyMap* map : {&at_once, &slowly}) {
      map->add(c);
      map->add(pose);
    }
    store.add(c);
    store.add(pose);
  }
  EXPECT_NE(slowly.hash(), at_once.hash());
  int calls = 0;
  while (slowly.correctSome(kAtOnce)) ++calls;
  EXPECT_GE(calls, 2);
  EXPECT_EQ(slowly.hash(), at_once.hash());
  EXPECT_FALSE(at_once.correctSome(kAtOnce));
  EXPECT_EQ(store.correctNext(kAtOnce).size(), kAtOnce);
}

}  // namespace
}  // namespace omnifleet::occupancy
