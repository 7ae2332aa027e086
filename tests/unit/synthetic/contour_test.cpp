// Rendered contours against closed forms: the share of each pixel that a solid covers, for several lenses.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/synthetic/scenes.h"

namespace omnifleet::synthetic {
namespace {

using test::level;

std::vector<Solid> threeSolids() {
  Solid box;
  box.map_from_solid = {0.62, 0.25, 0.4};
  box.size_m = {0.30, 0.18};
  box.height_m = 0.2;
  Solid far_box;
  far_box.map_from_solid = {-1.3, 0.7, 1.1};
  far_box.size_m = {0.4, 0.1};
  far_box.height_m = 0.35;
  Solid cylinder;
  cylinder.kind = SolidKind::kCylinder;
  cylinder.map_from_solid = {-0.1, -0.75, 0.0};
  cylinder.radius_m = 0.13;
  cylinder.height_m = 0.24;
  std::vector<Solid> solids{box, far_box, cylinder};
  for (Solid& solid : solids) {
    solid.rgb = {0, 0, 0};
    solid.texture = 0.0;
  }
  return solids;
}

struct Errors {
  double mean = 0.0, rms = 0.0, worst = 0.0;
  int contour_pixels = 0, wrong_pixels = 0;
};

/// Black solids on a floor with level 200.
Errors compare(const Arena& arena, const cv::Mat& bgr, const Pose2& map_from_parent, double own_radius_px) {
  const lens::Camera camera(arena.cameras.front().model);
  const Eigen::Vector2d centre = camera.model().principal_point_px;
  Errors errors;
  for (int v = 0; v < bgr.rows; ++v) {
    for (int u = 0; u < bgr.cols; ++u) {
      const auto ray = camera.rayFromPixel({double(u), double(v)});
      if (!ray || ray->z() > -0.02 || (Eigen::Vector2d(u, v) - centre).norm() < own_radius_px) continue;
      const double coverage = 1.0 - level(bgr, u, v, 0) / 200.0;
      const double rough = test::trueCoverage(arena.solids, camera, map_from_parent, u, v, 3);
      const bool inner = rough == 0.0 || rough == 1.0;
      if (inner && std::abs(coverage - rough) < 0.01) continue;
      const double error = coverage - test::trueCoverage(arena.solids, camera, map_from_parent, u, v, 24);
      if (std::abs(error) > 0.3) ++errors.wrong_pixels;
      errors.mean += error;
      errors.rms += error * error;
      errors.worst = std::max(errors.worst, std::abs(error));
      ++errors.contour_pixels;
    }
  }
  errors.mean /= errors.contour_pixels;
  errors.rms = std::sqrt(errors.rms / errors.contour_pixels);
  return errors;
}

// A contour error of d px changes the coverage of its pixels by about d. Sixteen rays per pixel resolve 1/16,
// so a single pixel may have an error of 0.1. The mean shows a bias that would shift every contour.
void expectUnbiased(const Errors& errors) {
  EXPECT_GT(errors.contour_pixels, 100);
  EXPECT_EQ(errors.wrong_pixels, 0);
  EXPECT_LT(std::abs(errors.mean), 0.01);
  EXPECT_LT(errors.rms, 0.06);
  EXPECT_LT(errors.worst, 0.2);
}

TEST(Contours, RendersUnbiasedContoursInFisheye) {
  Arena arena = test::plainArena();
  const Pose2 pose{0.05, -0.03, 0.7};
  test::addRobot(arena, "r1", pose, test::smallFisheye());
  arena.solids = threeSolids();
  cv::Mat bgr;
  Renderer(arena, "r1/fisheye", 1).render(0, {pose}, bgr);
  expectUnbiased(compare(arena, bgr, pose, 55.0));
}

class CeilingLens : public testing::TestWithParam<const char*> {};

lens::CameraModel modelNamed(const std::string& name) {
  lens::CameraModel model = test::ceilingPinhole(2.2);
  if (name == "pinhole") return model;
  if (name == "distorted") {
    model.distortion = {-0.12, 0.03, 0.001, -0.0005, 0.0};
    model.rotation_rpy_deg = {4.0, -3.0, 30.0};
    return model;
  }
  model.kind = lens::CameraKind::kFisheye;
  model.fov_deg = 170.0;
  model.focal_px = {90.0, 90.0};
  model.rotation_rpy_deg = {2.0, 5.0, -40.0};
  if (name == "equisolid") model.projection = lens::Projection::kEquisolid;
  if (name == "stereographic") model.projection = lens::Projection::kStereographic;
  if (name == "orthographic") model.projection = lens::Projection::kOrthographic;
  if (name == "kannala_brandt") {
    model.projection = lens::Projection::kKannalaBrandt;
    model.distortion = {0.02, -0.005, 0.001, 0.0};
  }
  return model;
}

TEST_P(CeilingLens, RendersUnbiasedContours) {
  Arena arena = test::plainArena();
  test::hangCamera(arena, modelNamed(GetParam()));
  arena.solids = threeSolids();
  cv::Mat bgr;
  Renderer(arena, "ceiling/c", 1).render(0, {}, bgr);
  expectUnbiased(compare(arena, bgr, Pose2{}, 0.0));
}

INSTANTIATE_TEST_SUITE_P(All, CeilingLens,
                         testing::Values("pinhole", "distorted", "equisolid", "stereographic", "orthographic",
                                         "kannala_brandt"),
                         [](const auto& lens) { return std::string(lens.param); });

TEST(Contours, HidesFarObjectBehindNearOne) {
  // A low red box in front of a tall black one, both in one direction from the camera.
  Arena arena = test::plainArena();
  const Pose2 pose;
  test::addRobot(arena, "r1", pose, test::smallFisheye());
  arena.solids = {threeSolids()[0], threeSolids()[0]};
  arena.solids[0].map_from_solid = {0.7, 0.0, 0.0};
  arena.solids[0].rgb = {255, 0, 0};
  arena.solids[1].map_from_solid = {1.1, 0.0, 0.0};
  arena.solids[1].height_m = 0.3;
  cv::Mat bgr;
  Renderer(arena, "r1/fisheye", 1).render(0, {pose}, bgr);
  const lens::Camera camera(arena.cameras.front().model);
  for (double height_m = 0.02; height_m < 0.19; height_m += 0.02) {
    const Eigen::Vector2d pixel = *camera.pixelFromPoint({0.55, 0.0, height_m});
    EXPECT_GT(level(bgr, std::lround(pixel.x()), std::lround(pixel.y()), 2), 200) << height_m;
  }
  const Eigen::Vector2d top = *camera.pixelFromPoint({0.95, 0.0, 0.28});
  EXPECT_LT(level(bgr, std::lround(top.x()), std::lround(top.y()), 2), 20);
}

TEST(Contours, RendersMarkersAtTheirHeight) {
  Arena arena = test::plainArena();
  const Pose2 pose{0.35, 0.1, 0.6};
  test::addRobot(arena, "r1", pose, test::smallFisheye());
  arena.robots[0].rgb = {0, 0, 0};
  test::hangCamera(arena, test::ceilingPinhole(2.0));
  dataset::MarkerSet markers;
  markers.height_m = 0.34;  // plates above the body
  markers.team = {0, 0, 255};
  markers.team_offset_m = {-0.06, 0.0};
  markers.individual_offset_m = {0.06, 0.0};
  markers.patch_size_m = {0.09, 0.12};
  markers.robots["r1"].individual = {255, 0, 0};
  arena.markers = markers;
  cv::Mat bgr;
  Renderer(arena, "ceiling/c", 1).render(0, {pose}, bgr);
  // Centroid of the pure blue patch, weighted by the share of each pixel that it covers. The pinhole camera
  // is far above a small plate, so centroids are accurate to some 0.01 px.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int v = 0; v < bgr.rows; ++v) {
    for (int u = 0; u < bgr.cols; ++u) {
      const double share = (level(bgr, u, v, 0) - level(bgr, u, v, 1)) / 255.0;
      if (share > 0.02) sum += share * Eigen::Vector3d(u, v, 1.0);
    }
  }
  const Eigen::Vector2d centre_m = pose * markers.team_offset_m;
  const Eigen::Vector2d expected = *lens::Camera(arena.cameras.back().model)
                                        .pixelFromPoint({centre_m.x(), centre_m.y(), markers.height_m});
  EXPECT_NEAR(sum.x() / sum.z(), expected.x(), 0.05);
  EXPECT_NEAR(sum.y() / sum.z(), expected.y(), 0.05);
}

TEST(Contours, RendersOwnBodyInSelfMask) {
  Arena arena = test::plainArena();
  test::addRobot(arena, "r1", Pose2{}, test::smallFisheye());
  arena.robots[0].rgb = {0, 0, 0};
  cv::Mat bgr;
  Renderer(arena, "r1/fisheye", 1).render(0, {Pose2{0.3, 0.2, 1.0}}, bgr);
  double covered = 0.0;
  for (int v = 40; v < 200; ++v) {
    for (int u = 80; u < 240; ++u) covered += 1.0 - level(bgr, u, v, 0) / 200.0;
  }
  // The rim of the top is 0.15 m beside and 0.2 m below the camera: a circle with radius f·θ.
  const double radius_px = arena.cameras[0].model.focal_px.x() * std::atan2(0.15, 0.20);
  EXPECT_NEAR(std::sqrt(covered / M_PI), radius_px, 0.03);
}

}  // namespace
}  // namespace omnifleet::synthetic
