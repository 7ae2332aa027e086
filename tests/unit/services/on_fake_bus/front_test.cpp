// The local mapper of a robot with a forward camera and wheels. The test paints its images.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kFrontWidth = 320, kFrontHeight = 240;
constexpr TimeNs kFrontPeriod = 200'000'000;
constexpr double kFocal_px = 160.0, kCameraHeight_m = 0.085, kPitch_rad = 12.0 * M_PI / 180.0;

/// What fills the view of the camera.
enum class FrontScene { kWall, kTooNear, kSky, kDark };

class FrontStage : public testing::Test {
 protected:
  FrontStage()
      : folder_(fs::temp_directory_path() / ("omnifleet_front_stage_" + std::to_string(::getpid()))),
        bench_("local_mapper", "r1", {}, fleetFile()),
        camera_(bench_.bus().frameWriter("r1/front", kFrontWidth * kFrontHeight * 3)),
        wheels_(bench_.bus().writer(bench_.topics.wheels_odometry, "r1")),
        maps_(bench_.bus().reader(bench_.topics.local_map, "r1")) {}
  ~FrontStage() override { fs::remove_all(folder_); }

  std::string fleetFile() const {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "front.yaml")
        << "camera_model: pinhole\nprojection: pinhole\nimage_width: 320\nimage_height: 240\nfocal_px: [160, "
           "160]\n"
           "principal_point_px: [159.5, 119.5]\nfov_deg: 120\nposition_m: [0, 0, 0.085]\n"
           "rotation_rpy_deg: [0, -78, 0]\nself_mask_radius_px: 0\n";
    std::ofstream(folder_ / "fleet.yaml")
        << "robots: {r1: {body: {radius_m: 0.09, height_m: 0.1}, wheel_separation_m: 0.12, wheels: true}}\n"
           "cameras: {r1/front: {source: folder, path: ., sensor: front.yaml}}\n";
    return folder_ / "fleet.yaml";
  }
  /// Image row in which the floor ends at a wall across the view.
  static int footRow(double distance_m) {
    return static_cast<int>(
        std::lround(119.5 + kFocal_px * std::tan(std::atan2(kCameraHeight_m, distance_m) - kPitch_rad)));
  }
  void paint(std::uint8_t* pixels, int width, int height, FrontScene scene) const {
    const std::uint8_t floor[3] = {118, 122, 126}, wall[3] = {60, 60, 170}, sky[3] = {220, 200, 180},
                       dark[3] = {3, 3, 3};
    const int foot = footRow(kWall_m);
    for (int v = 0; v < height; ++v) {
      const std::uint8_t* colour = v > foot ? floor : wall;
      if (scene == FrontScene::kTooNear) colour = wall;
      if (scene == FrontScene::kSky) colour = sky;
      if (scene == FrontScene::kDark) colour = dark;
      for (int u = 0; u < width; ++u) std::memcpy(pixels + 3 * (v * width + u), colour, 3);
    }
  }
  /// Sends one frame and the wheels. @return the stage's only answer
  v1::LocalMap answerTo(std::uint32_t index, FrontScene scene, int width = kFrontWidth, TimeNs time_ns = -1) {
    bus::FrameHeader header;
    header.acquired_ns = time_ns >= 0 ? time_ns : index * kFrontPeriod;
    header.sequence = index;
    header.width_px = width;
    header.height_px = kFrontHeight;
    std::uint8_t* loan = camera_->begin(header);
    EXPECT_NE(loan, nullptr);
    paint(loan, width, kFrontHeight, scene);
    EXPECT_TRUE(camera_->publish());
    v1::WheelOdometry wheels;
    wheels.robot("r1");
    wheels.header().acquired_ns(header.acquired_ns);
    wheels.v_left_mps(0.1);
    wheels.v_right_mps(0.1);
    EXPECT_TRUE(wheels_->write(wheels));
    bench_.spin();
    v1::LocalMap answer, none;
    EXPECT_TRUE(maps_->take(answer)) << "every frame must have an answer";
    EXPECT_FALSE(maps_->take(none)) << "a frame must have only one answer";
    EXPECT_EQ(answer.header().sequence_number(), index);
    return answer;
  }
  /// Rays that show floor or an obstacle, and edges.
  static int claims(const v1::LocalMap& map) {
    const auto& label = map.scan().label();
    const auto& sigma = map.boundary().sigma();
    return static_cast<int>(
        std::count_if(label.begin(), label.end(),
                      [](auto l) { return l != static_cast<std::uint8_t>(RayLabel::kInvalid); }) +
        std::count_if(sigma.begin(), sigma.end(), [](float s) { return s > 0.0f; }));
  }
  /// Expects one new message about the floor in view.
  void expectMessage(const std::string& text) {
    const std::vector<Message> messages = bench_.messages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].code, ErrorCode::kFloorHidden) << messages[0].text;
    EXPECT_THAT(messages[0].text, HasSubstr(text));
  }

  static constexpr double kWall_m = 0.4;
  fs::path folder_;
  test::StageBench bench_;
  std::unique_ptr<bus::FrameWriter> camera_;
  std::unique_ptr<bus::Writer<v1::WheelOdometry>> wheels_;
  std::unique_ptr<bus::Reader<v1::LocalMap>> maps_;
};

TEST_F(FrontStage, AnswersEachFrameWithTheDistanceOfTheWall) {
  answerTo(0, FrontScene::kWall);
  const v1::LocalMap map = answerTo(1, FrontScene::kWall);
  EXPECT_EQ(map.state(), v1::FrameState::FRAME_OK);
  EXPECT_TRUE(map.objects().empty());
  EXPECT_TRUE(map.motion().valid());
  EXPECT_NEAR(map.motion().previous_from_current().x(), 0.02, 1e-9);  // 0.1 m/s for 0.2 s
  ASSERT_FALSE(map.scan().range_m().empty());
  // One row is 1.2 cm there; the painted edge lies within half a row of the wall's foot.
  EXPECT_NEAR(map.scan().range_m()[0], kWall_m, 0.012) << "straight ahead";
  EXPECT_EQ(map.scan().label()[0], static_cast<std::uint8_t>(RayLabel::kObstacle));
  EXPECT_GT(map.scan().sigma_m()[0], 0.0f);
}

TEST_F(FrontStage, ClaimsNothingAtAWallThatFillsTheView) {
  EXPECT_GT(claims(answerTo(0, FrontScene::kWall)), 100);
  EXPECT_TRUE(bench_.messages().empty());
  const v1::LocalMap map = answerTo(1, FrontScene::kTooNear);
  EXPECT_EQ(map.state(), v1::FrameState::FRAME_OK) << "the image is good";
  EXPECT_EQ(claims(map), 0);
  EXPECT_TRUE(map.motion().valid()) << "the wheels still count";
  expectMessage("frame 1 of camera r1/front: an obstacle fills the view");
  EXPECT_GT(claims(answerTo(2, FrontScene::kWall)), 100) << "back to the floor";
}

TEST_F(FrontStage, ClaimsNothingInTheSky) {
  EXPECT_EQ(claims(answerTo(0, FrontScene::kSky)), 0);
  expectMessage("frame 0 of camera r1/front: the image shows no floor");
}

TEST_F(FrontStage, ClaimsNothingInTheDark) {
  EXPECT_EQ(claims(answerTo(0, FrontScene::kDark)), 0);
  EXPECT_FALSE(bench_.messages().empty());
}

TEST_F(FrontStage, RejectsFramesOfAnotherSizeAndContinues) {
  EXPECT_GT(claims(answerTo(0, FrontScene::kWall)), 100);
  const v1::LocalMap map = answerTo(1, FrontScene::kWall, kFrontWidth / 2);
  EXPECT_EQ(map.state(), v1::FrameState::FRAME_WRONG_SIZE);
  EXPECT_EQ(claims(map), 0);
  EXPECT_EQ(bench_.status().invalid, 1u);
  EXPECT_EQ(bench_.status().last_error.code, ErrorCode::kImageSizeMismatch);
  EXPECT_GT(claims(answerTo(2, FrontScene::kWall)), 100);
  EXPECT_EQ(bench_.status().invalid, 1u);
}

// The camera was unplugged: no frame for some seconds.
TEST_F(FrontStage, ReportsAGapBetweenFrames) {
  for (std::uint32_t index = 0; index < 3; ++index) answerTo(index, FrontScene::kWall);
  EXPECT_TRUE(bench_.messages().empty());
  EXPECT_GT(claims(answerTo(3, FrontScene::kWall, kFrontWidth, 40 * kFrontPeriod)), 100);
  const std::vector<Message> messages = bench_.messages();
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].code, ErrorCode::kFrameGap);
  EXPECT_THAT(messages[0].text, HasSubstr("camera r1/front: no frame for 7.6 s"));
}

TEST_F(FrontStage, GivesEqualMapsForEqualFrames) {
  const v1::LocalMap first = answerTo(0, FrontScene::kWall), second = answerTo(1, FrontScene::kWall);
  EXPECT_EQ(first.scan().range_m(), second.scan().range_m());
  EXPECT_EQ(first.scan().label(), second.scan().label());
}

}  // namespace
}  // namespace omnifleet
