#include <gtest/gtest.h>

#include <optional>

#include "flow/feature_flow.h"
#include "tests/unit/flow/cells.h"
#include "tests/unit/flow/texture.h"

namespace omnifleet::flow {
namespace {

lens::CameraModel fisheye() {
  lens::CameraModel model;
  model.image_width_px = 640;
  model.image_height_px = 480;
  model.focal_px = {148.66, 148.66};
  model.principal_point_px = {319.5, 239.5};
  model.fov_deg = 185.0;
  model.position_m = {0.04, -0.02, 0.5};  // off the axle, so that rotation moves the camera too
  return model;
}

/// Image of a textured plane at one height, fixed in the world.
cv::Mat1b planeSeen(const lens::Camera& camera, const Pose2& world_from_base, double height_m,
                    const testing::Texture& texture) {
  cv::Mat1b image(camera.model().image_height_px, camera.model().image_width_px, std::uint8_t{128});
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto p = camera.planeFromPixel({u, v}, height_m);
      if (!p || p->norm() > 3.0) continue;
      const Eigen::Vector2d w = world_from_base * *p;
      image(v, u) = cv::saturate_cast<std::uint8_t>(texture(w.x(), w.y()));
    }
  }
  return image;
}

ground::Blob region(int x, int y, int width, int height) {
  ground::Blob blob;
  blob.rect = {x, y, width, height};
  for (int row = y; row < y + height; ++row) blob.runs.push_back({row, x, x + width});
  return blob;
}

class FeatureFlowTest : public ::testing::Test {
 protected:
  FeatureFlowTest() : camera_(fisheye()), texture_(0.08, 11) {}

  std::vector<ObjectObservation> track(double height_m, const Motion& motion, bool forget = false) {
    FeatureFlow flow(camera_, {});
    const Pose2 before{0.3, -0.2, 0.4}, after = before * moved_;
    const std::vector<ground::Blob> regions{region(0, 0, 1, 1), region(380, 150, 60, 60),
                                            region(180, 280, 70, 50)};
    push(flow, planeSeen(camera_, before, height_m, texture_), first_regions_.value_or(regions));
    if (forget) flow.forget();
    push(flow, planeSeen(camera_, after, height_m, texture_), regions);
    std::vector<ObjectObservation> objects(2);
    flow.track(regions, {1, 2}, motion, objects);
    return objects;
  }
  static void push(FeatureFlow& flow, const cv::Mat1b& image, const std::vector<ground::Blob>& regions) {
    const testing::Cells cells(image);
    flow.push(image, cells.colours(), regions);
  }
  Motion truth() const {
    Motion motion;
    motion.valid = true;
    motion.previous_from_current = moved_;
    return motion;
  }

  lens::Camera camera_;
  testing::Texture texture_;
  Pose2 moved_{0.045, 0.004, 0.06};
  std::optional<std::vector<ground::Blob>> first_regions_;  ///< regions of the previous frame, if different
};

TEST_F(FeatureFlowTest, LeavesNoResidualOnFloor) {
  for (const auto& object : track(0.0, truth())) {
    ASSERT_GE(object.vectors.size(), 8U);
    for (const auto& v : object.vectors) {
      EXPECT_LT(v.residual_m.norm(), 0.003f);  // half a pixel of the coarsest part of the image
      EXPECT_GT((v.to_m - v.from_m).norm(), 0.005f);
      EXPECT_LT(
          (v.to_m.cast<double>() - moved_.inverse() * v.from_m.cast<double>() - v.residual_m.cast<double>())
              .norm(),
          1e-5);
    }
    EXPECT_NEAR(object.height_m, 0.0, 0.02);
    EXPECT_GT(object.height_sigma_m, 0.0);
  }
}

TEST_F(FeatureFlowTest, EstimatesHeightOfStaticObject) {
  for (const double height_m : {0.1, 0.2}) {
    const double s = camera_.height() / (camera_.height() - height_m);
    const Eigen::Vector2d u = moved_.inverse() * camera_.foot() - camera_.foot();
    for (const auto& object : track(height_m, truth())) {
      ASSERT_GE(object.vectors.size(), 5U);
      EXPECT_NEAR(object.height_m, height_m, 0.012);
      for (const auto& v : object.vectors)
        EXPECT_LT((v.residual_m.cast<double>() - (s - 1.0) * u).norm(), 0.006);
    }
  }
}

TEST_F(FeatureFlowTest, ReturnsVectorsWithoutHeightWithoutOdometry) {
  for (const auto& object : track(0.0, Motion{})) {
    EXPECT_GE(object.vectors.size(), 8U);
    EXPECT_EQ(object.height_sigma_m, 0.0);
    for (const auto& v : object.vectors) EXPECT_LT((v.residual_m - (v.to_m - v.from_m)).norm(), 1e-5f);
  }
}

TEST_F(FeatureFlowTest, ReturnsNoVectorsAfterGap) {
  for (const auto& object : track(0.0, truth(), true)) EXPECT_TRUE(object.vectors.empty());
}

TEST_F(FeatureFlowTest, SkipsObjectWithoutPreviousRegion) {
  first_regions_ = {region(180, 280, 70, 50)};
  const auto objects = track(0.0, truth());
  EXPECT_TRUE(objects[0].vectors.empty());
  EXPECT_GE(objects[1].vectors.size(), 8U);
}

TEST_F(FeatureFlowTest, KeepsVectorsWhenRegionsOverlap) {
  const auto expected = track(0.1, truth());
  first_regions_ =
      std::vector<ground::Blob>(40, region(100, 100, 400, 300));  // more area than the whole frame
  const auto objects = track(0.1, truth());
  for (std::size_t i = 0; i < objects.size(); ++i) {
    ASSERT_EQ(objects[i].vectors.size(), expected[i].vectors.size());
    for (std::size_t k = 0; k < objects[i].vectors.size(); ++k)
      EXPECT_EQ(objects[i].vectors[k].from_px, expected[i].vectors[k].from_px);
  }
}

TEST(FeatureFlowOptions, ReadsNestedKeys) {
  const auto o = FeatureFlowOptions::read(
      options::Section::parse("{harris: {m: 0.3, per_label: false}, sigma_px: 0.2}", "t.yaml"));
  EXPECT_EQ(o.harris.m, 0.3);
  EXPECT_FALSE(o.harris.per_label);
  EXPECT_THROW(FeatureFlowOptions::read(options::Section::parse("{harris: {n: 0.3}}", "t.yaml")),
               options::Error);
}

}  // namespace
}  // namespace omnifleet::flow
