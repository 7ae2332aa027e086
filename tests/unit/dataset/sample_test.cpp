// An externally rendered recording. With frames, lens and extrinsics of this project, every true obstacle
// projects to its pixels.
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

/// Silhouette of a prism: the hull of its projected bottom and top vertices.
cv::Mat silhouette(const lens::Camera& camera, const Pose2& map_from_base, const MapObject& object) {
  std::vector<cv::Point2f> points;
  for (const Eigen::Vector2d& vertex : object.outline_m) {
    const Eigen::Vector2d p = map_from_base.inverse() * vertex;
    for (const double z : {0.0, object.height_m}) {
      const auto pixel = camera.pixelFromPoint({p.x(), p.y(), z});
      if (!pixel) return {};
      points.emplace_back(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()));
    }
  }
  std::vector<cv::Point2f> hull;
  cv::convexHull(points, hull);
  const std::vector<cv::Point> rounded(hull.begin(), hull.end());
  cv::Mat mask = cv::Mat::zeros(camera.model().image_height_px, camera.model().image_width_px, CV_8U);
  cv::fillConvexPoly(mask, rounded, 255);
  return mask;
}

struct Fractions {
  double inside_is_object, around_is_floor;
};

/// A pixel counts as "object" if its channel ratio or brightness differs from that of the floor (grey, R ≈ G
/// ≈ B > 110 in this scene).
Fractions compare(const cv::Mat& image, const cv::Mat& mask) {
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {5, 5});
  cv::Mat inner, near, far;
  cv::erode(mask, inner, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
  cv::dilate(mask, near, square);
  cv::dilate(near, far, square);
  std::vector<cv::Mat> bgr;
  cv::split(image, bgr);
  cv::Mat high, low, floor;
  cv::max(bgr[0], cv::max(bgr[1], bgr[2]), high);
  cv::min(bgr[0], cv::min(bgr[1], bgr[2]), low);
  floor = (high - low < 45) & (low > 110);
  const cv::Mat ring = far & ~near;
  return {1.0 - static_cast<double>(cv::countNonZero(floor & inner)) / cv::countNonZero(inner),
          static_cast<double>(cv::countNonZero(floor & ring)) / cv::countNonZero(ring)};
}

TEST(RenderedSample, ProjectsObstaclesOntoTheirPixels) {
  OMNIFLEET_NEEDS_DATA(folder, "rendered_sample");
  const Dataset d = Dataset::open(folder);
  const GroundTruth truth = GroundTruth::load(folder);
  const RobotRecording& r1 = *d.findRobot("r1");
  const lens::Camera camera(r1.fisheye->camera);
  cv::Mat image;
  FrameInfo info;
  ASSERT_TRUE(openStream(*r1.fisheye, Colour::kBgr)->next(image, info));
  const StampedPose& pose = truth.trajectories.at("r1").front();
  ASSERT_EQ(pose.time_ns, info.time_ns);
  ASSERT_EQ(truth.scene.size(), 5u);
  for (const MapObject& object : truth.scene) {
    const cv::Mat mask = silhouette(camera, pose.map_from_base, object);
    ASSERT_FALSE(mask.empty());
    const Fractions f = compare(image, mask);
    // JPEG halves the resolution of chroma, so borders blur by one pixel. A shift by 3 px (0.3°) or a
    // mirrored axis fails clearly.
    EXPECT_GT(f.inside_is_object, 0.95) << "object " << object.id;
    EXPECT_GT(f.around_is_floor, 0.90) << "object " << object.id;
  }
}

TEST(RenderedSample, ReadsCompleteRecordingWithoutWarnings) {
  OMNIFLEET_NEEDS_DATA(folder, "rendered_sample");
  const Dataset d = Dataset::open(folder);
  EXPECT_TRUE(d.warnings.empty());
  ASSERT_EQ(d.robots.size(), 3u);
  ASSERT_EQ(d.ceiling.size(), 2u);
  EXPECT_EQ(d.markers->robots.size(), 3u);
  for (const RobotRecording& robot : d.robots) {
    EXPECT_EQ(robot.fisheye->rows.size(), 17u);
    EXPECT_FALSE(robot.wheels.empty());
  }
  EXPECT_EQ(d.ceiling[0].camera.kind, lens::CameraKind::kPinhole);
}

}  // namespace
}  // namespace omnifleet::dataset
