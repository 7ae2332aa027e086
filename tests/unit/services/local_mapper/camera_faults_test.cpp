#include "local_mapper/camera_faults.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "local_mapper/local_mapper.h"
#include "tests/unit/services/local_mapper/fisheye_scene.h"

namespace omnifleet::local_mapper {
namespace {

using testing::box;

Motion rolled(double metres, double turn_rad = 0.0) {
  Motion motion;
  motion.valid = true;
  motion.previous_from_current = {metres, 0.0, turn_rad};
  return motion;
}

class CameraFaults : public ::testing::Test {
 protected:
  CameraFaults() : camera_(testing::fisheyeModel()), mapper_(camera_, {}) {
    scene_.prisms = {{box(0.9, 0.1, 0.2, 0.15, 0.4), 0.12, {40, 40, 200}}};
  }
  cv::Mat picture(const Pose2& pose = {}) { return testing::renderScene(scene_, camera_, pose); }
  cv::Mat occluded(const cv::Vec3b& colour = {90, 85, 80}) {
    testing::Scene occluder;
    occluder.floor = colour;
    occluder.seed = sequence_;
    return testing::renderScene(occluder, camera_, {});
  }
  FrameState see(const cv::Mat& image, const Motion& wheels) {
    return mapper_.process(testing::frameOf(image, sequence_++), wheels).state;
  }

  lens::Camera camera_;
  testing::Scene scene_;
  LocalMapper mapper_;
  std::uint32_t sequence_ = 0;
};

TEST_F(CameraFaults, RejectsFrozenImageWhileWheelsTurn) {
  const cv::Mat image = picture();
  EXPECT_EQ(see(image, {}), FrameState::kOk);
  EXPECT_EQ(see(image, rolled(0.02)), FrameState::kOk) << "too little motion for a decision";
  EXPECT_EQ(see(image, rolled(0.02)), FrameState::kOutOfOrder);
  EXPECT_EQ(mapper_.fault().code, ErrorCode::kImageFrozen);
  EXPECT_EQ(see(image, rolled(0.0)), FrameState::kOutOfOrder) << "standing still does not make the image new";
  EXPECT_EQ(see(picture({0.05, 0.0, 0.0}), rolled(0.01)), FrameState::kOk);
  EXPECT_EQ(mapper_.fault().code, ErrorCode::kNone);
  const cv::Mat turned = picture({0.05, 0.0, 0.1});
  EXPECT_EQ(see(turned, rolled(0.0, 0.1)), FrameState::kOk);
  EXPECT_EQ(see(turned, rolled(0.0, 0.1)), FrameState::kOutOfOrder);
}

TEST_F(CameraFaults, AcceptsUnchangedImageAtRest) {
  const cv::Mat image = picture();
  for (int i = 0; i < 20; ++i) EXPECT_EQ(see(image, rolled(0.0)), FrameState::kOk);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(see(image, {}), FrameState::kOk) << "the motion is unknown";
}

TEST_F(CameraFaults, AcceptsUnchangedBareFloorWhileDriving) {
  scene_.prisms.clear();
  const cv::Mat image = picture();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(see(image, rolled(0.1)), FrameState::kOk);
}

TEST_F(CameraFaults, RejectsOccluderOfOneColour) {
  EXPECT_EQ(see(picture(), {}), FrameState::kOk);
  EXPECT_EQ(see(occluded(), rolled(0.02)), FrameState::kDark);
  EXPECT_EQ(mapper_.fault().code, ErrorCode::kLensOccluded);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(see(occluded(), rolled(0.02)), FrameState::kDark);
    const LocalMap& map = mapper_.process(testing::frameOf(occluded(), sequence_++), rolled(0.0));
    EXPECT_TRUE(map.scan.range_m.empty());
  }
  EXPECT_EQ(see(picture({0.1, 0.0, 0.0}), rolled(0.02)), FrameState::kOk) << "the object is back";
  EXPECT_EQ(mapper_.process(testing::frameOf(picture({0.1, 0.0, 0.0}), sequence_++), {}).objects.size(), 1U);
}

TEST_F(CameraFaults, EndsOcclusionWhenFloorOrObjectIsBack) {
  scene_.prisms[0].footprint_m = box(1.6, 0.1, 0.2, 0.15, 0.4);
  EXPECT_EQ(see(picture(), {}), FrameState::kOk);
  EXPECT_EQ(see(occluded(), {}), FrameState::kDark);
  EXPECT_EQ(see(occluded(scene_.floor), rolled(0.1)), FrameState::kOk) << "bare floor of the former colour";
  EXPECT_EQ(see(picture(), {}), FrameState::kOk);
  EXPECT_EQ(see(occluded(), {}), FrameState::kDark);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(see(occluded(), rolled(0.11)), FrameState::kDark);
  EXPECT_EQ(see(picture(), {}), FrameState::kOk);
}

TEST_F(CameraFaults, AcceptsLightChangeAndRemovedObject) {
  EXPECT_EQ(see(picture(), {}), FrameState::kOk);
  EXPECT_EQ(see(picture() * 0.7, {}), FrameState::kOk) << "the light changed, the object stayed";
  EXPECT_EQ(see(occluded({105, 112, 119}), {}), FrameState::kOk)
      << "the object was removed, the floor stayed";
  EXPECT_EQ(see(occluded({60, 65, 70}), {}), FrameState::kOk) << "no object was there before";
}

/// One colour wherever the lens has an image, brighter to the right by the share `uneven` from edge to edge.
cv::Mat plain(const lens::Camera& camera, const cv::Vec3b& colour, double uneven, unsigned seed) {
  cv::Mat3b image(camera.model().image_height_px, camera.model().image_width_px, cv::Vec3b(0, 0, 0));
  cv::RNG rng(seed);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      if (!camera.rayFromPixel({u, v})) continue;
      const double light = 1.0 + uneven * (static_cast<double>(u) / image.cols - 0.5);
      for (int c = 0; c < 3; ++c)
        image(v, u)[c] = cv::saturate_cast<std::uint8_t>(light * colour[c] + rng.gaussian(3.0));
    }
  }
  return image;
}

TEST_F(CameraFaults, RejectsOcclusionFromFirstFrameOn) {
  for (const double uneven : {0.0, 0.5}) {
    mapper_ = LocalMapper(camera_, {});
    for (unsigned i = 0; i < 5; ++i) {
      const cv::Mat image = plain(camera_, {40, 75, 110}, uneven, i);
      const LocalMap& map = mapper_.process(testing::frameOf(image, sequence_++), rolled(0.3));
      EXPECT_EQ(map.state, FrameState::kDark);
      EXPECT_TRUE(map.scan.range_m.empty());
      EXPECT_EQ(mapper_.fault().code, ErrorCode::kLensOccluded);
    }
    EXPECT_EQ(see(picture(), rolled(0.3)), FrameState::kOk) << "the occluder was removed";
    EXPECT_EQ(mapper_.bare_m(), 0.0);
  }
}

TEST_F(CameraFaults, AcceptsBareFloorWithHorizon) {
  scene_.prisms.clear();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(see(picture(), rolled(0.3)), FrameState::kOk);
  EXPECT_EQ(mapper_.bare_m(), 0.0);
}

TEST_F(CameraFaults, RejectsOcclusionThatHidesHorizon) {
  EXPECT_EQ(see(picture(), rolled(0.1)), FrameState::kOk);
  scene_.prisms.clear();
  EXPECT_EQ(see(picture(), rolled(0.1)), FrameState::kOk) << "the robot drove away from all objects";
  for (unsigned i = 0; i < 3; ++i)
    EXPECT_EQ(see(plain(camera_, {40, 75, 110}, 0.2, i), rolled(0.1)), FrameState::kDark);
  EXPECT_EQ(see(picture(), rolled(0.1)), FrameState::kOk) << "the occluder was removed";
  EXPECT_EQ(see(plain(camera_, scene_.floor, 0.0, 1), rolled(0.1)), FrameState::kOk)
      << "the floor's own colour may be fog, or a room of one colour";
}

TEST_F(CameraFaults, ReportsDistanceWithOnlyFloorInView) {
  lens::CameraModel model = testing::fisheyeModel();
  model.fov_deg = 150.0;
  const lens::Camera narrow(model);
  LocalMapper mapper(narrow, {});
  for (std::uint32_t i = 0; i < 4; ++i)
    EXPECT_EQ(mapper.process(testing::frameOf(plain(narrow, {40, 75, 110}, 0.0, i), i), rolled(0.3)).state,
              FrameState::kOk);
  EXPECT_NEAR(mapper.bare_m(), 1.2, 1e-9);
  mapper.process(testing::frameOf(testing::renderScene(scene_, narrow, {}), 4), rolled(0.3));
  EXPECT_EQ(mapper.bare_m(), 0.0);
  mapper.process(testing::frameOf(plain(narrow, scene_.floor, 0.0, 5), 5), rolled(0.3));
  EXPECT_EQ(mapper.bare_m(), 0.0) << "an object was visible once";
}

/// Squares of two colours, darker towards the edge, like a cloth.
cv::Mat cloth(const lens::Camera& camera, int square_px, unsigned seed) {
  cv::Mat3b image(camera.model().image_height_px, camera.model().image_width_px, cv::Vec3b(0, 0, 0));
  cv::RNG rng(seed);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      if (!camera.rayFromPixel({u, v})) continue;
      const bool first = (u / square_px + v / square_px) % 2 == 0;
      const cv::Vec3d colour = first ? cv::Vec3d(70, 60, 160) : cv::Vec3d(150, 150, 140);
      const double away = std::hypot(u - 0.5 * image.cols, v - 0.5 * image.rows) / image.rows;
      for (int c = 0; c < 3; ++c)
        image(v, u)[c] = cv::saturate_cast<std::uint8_t>((1.1 - 0.8 * away) * colour[c] + rng.gaussian(2.0));
    }
  }
  return image;
}

TEST_F(CameraFaults, RejectsPatternedOccluder) {
  for (const int square_px : {35, 60, 100}) {
    mapper_ = LocalMapper(camera_, {});
    EXPECT_EQ(see(picture(), rolled(0.05)), FrameState::kOk);
    for (unsigned i = 0; i < 12; ++i) {
      EXPECT_EQ(see(cloth(camera_, square_px, i), rolled(0.05)), FrameState::kDark) << square_px << " " << i;
      EXPECT_EQ(mapper_.fault().code, ErrorCode::kLensOccluded);
    }
    EXPECT_EQ(see(picture({0.65, 0.5, 0.0}), rolled(0.05)), FrameState::kOk)
        << "the occluder was removed at another place";
    EXPECT_EQ(mapper_.occludedShare(), 0.0);
  }
}

TEST_F(CameraFaults, RejectsNoiseImages) {
  EXPECT_EQ(see(picture(), rolled(0.05)), FrameState::kOk);
  cv::RNG rng(1);
  cv::Mat noise(picture().size(), CV_8UC3);
  for (int i = 0; i < 8; ++i) {
    rng.fill(noise, cv::RNG::UNIFORM, 0, 256);
    EXPECT_EQ(see(noise, rolled(0.05)), FrameState::kDark) << i;
    EXPECT_THAT(mapper_.fault().text, ::testing::HasSubstr("within one frame"));
  }
  EXPECT_EQ(see(picture({0.1, 0.0, 0.0}), rolled(0.05)), FrameState::kOk);
}

/// Everything has another appearance where the robot was put down, but it moves in the image as the robot
/// drives.
TEST_F(CameraFaults, RecoversAfterKidnappingWhenRobotDrives) {
  EXPECT_EQ(see(picture(), rolled(0.05)), FrameState::kOk);
  scene_.floor = {60, 75, 95};
  scene_.prisms = {{box(0.5, 0.5, 0.3, 0.2, 0.1), 0.2, {200, 190, 180}}};
  for (int i = 0; i < 5; ++i) see(picture({0.05 * i, 0.0, 0.0}), rolled(0.05));
  EXPECT_EQ(see(picture({0.25, 0.0, 0.0}), rolled(0.05)), FrameState::kOk);
  EXPECT_EQ(
      mapper_.process(testing::frameOf(picture({0.3, 0.0, 0.0}), sequence_++), rolled(0.05)).objects.size(),
      1U);
}

TEST_F(CameraFaults, AcceptsRepeatedLightChanges) {
  EXPECT_EQ(see(picture(), rolled(0.0)), FrameState::kOk);
  for (const double light : {0.4, 1.0, 0.5, 1.4, 0.6}) {
    EXPECT_EQ(see(picture() * light, rolled(0.0)), FrameState::kOk) << light;
    EXPECT_EQ(mapper_.occludedShare(), 0.0) << light;
  }
}

TEST(FaultOptions, RejectsNegativeStepAndDisablesChecksByZero) {
  EXPECT_THROW(FaultOptions::read(options::Section::parse("{occlusion_step: -1}", "t.yaml")), options::Error);
  const auto off = FaultOptions::read(options::Section::parse("{occlusion_step: 0, frozen_m: 0}", "t.yaml"));
  OcclusionCheck check(off);
  EXPECT_EQ(check.faultOf({0, false, {100, 100, 100}, HorizonState::kHidden}, {}).code, ErrorCode::kNone);
  EXPECT_EQ(check.faultOf({3, false, {100, 100, 100}, HorizonState::kVisible}, {}).code, ErrorCode::kNone);
  EXPECT_EQ(check.faultOf({0, false, {50, 50, 50}, HorizonState::kVisible}, {}).code, ErrorCode::kNone);
}

}  // namespace
}  // namespace omnifleet::local_mapper
