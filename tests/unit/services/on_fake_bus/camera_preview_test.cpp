// camera_preview: an image for display, encoded only while a reader is matched.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "camera/service.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;

/// One camera that plays a folder of three images.
class FolderCamera : public testing::Test {
 protected:
  FolderCamera()
      : folder_(fs::temp_directory_path() / ("omnifleet_preview_" + std::to_string(::getpid()))),
        network_(bus::makeFakeNetwork()),
        camera_bus_(bus::makeFakeBus(network_, {})),
        test_bus_(bus::makeFakeBus(network_, {})),
        topics_(bus::RunMode::kLockstep) {
    fs::create_directories(folder_ / "images");
    image_ = cv::Mat(240, 320, CV_8UC3, cv::Scalar(60, 120, 180));
    cv::rectangle(image_, {100, 60, 120, 90}, cv::Scalar(200, 40, 20), cv::FILLED);
    for (const char* name : {"a.png", "b.png", "c.png"}) cv::imwrite(folder_ / "images" / name, image_);
    std::ofstream(folder_ / "sensor.yaml")
        << "camera_model: fisheye\nprojection: equidistant\nimage_width: 320\nimage_height: 240\nfocal_px: "
           "75\n"
           "principal_point_px: [159.5, 119.5]\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n";
    std::ofstream(folder_ / "fleet.yaml")
        << "robots: {r1: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26}}\n"
           "cameras: {r1/fisheye: {source: folder, path: images, sensor: sensor.yaml}}\n";
  }
  ~FolderCamera() override { fs::remove_all(folder_); }

  /// Plays the folder to its end. @return number of images that the frame reader received
  int play() {
    auto frames = test_bus_->frameReader("r1/fisheye", 320 * 240 * 3);
    bus::ServiceOptions options;
    options.fleet = folder_ / "fleet.yaml";
    options.camera = "r1/fisheye";
    options.mode = bus::RunMode::kReplay;
    auto log = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>());
    auto camera = services::makeCamera({*camera_bus_, options, topics_, log});
    camera->start();
    int seen = 0;
    while (camera->spin()) {
      while (frames->take()) {
        ++seen;
        frames->release();
      }
    }
    camera->drain();
    return seen;
  }

  fs::path folder_;
  cv::Mat image_;
  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> camera_bus_, test_bus_;
  bus::Topics topics_;
};

TEST_F(FolderCamera, PublishesImageAsJpegToReader) {
  auto previews = test_bus_->reader(topics_.camera_preview);
  EXPECT_EQ(play(), 3);
  v1::CameraPreview preview;
  ASSERT_TRUE(previews->take(preview));
  EXPECT_STREQ(preview.camera().c_str(), "r1/fisheye");
  EXPECT_EQ(preview.width(), 320u);
  EXPECT_EQ(preview.height(), 240u);
  const cv::Mat decoded = cv::imdecode(preview.jpeg(), cv::IMREAD_COLOR);
  ASSERT_EQ(decoded.size(), image_.size());
  // JPEG with quality 80 preserves flat areas within a few grey levels.
  EXPECT_LT(cv::norm(decoded, image_, cv::NORM_L1) / static_cast<double>(image_.total() * 3), 4.0);
}

TEST_F(FolderCamera, PublishesNothingWithoutReader) {
  EXPECT_EQ(play(), 3);
  auto late = test_bus_->reader(topics_.camera_preview);
  v1::CameraPreview preview;
  EXPECT_FALSE(late->take(preview));
}

}  // namespace
}  // namespace omnifleet
