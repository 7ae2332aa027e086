// The service of a camera device that comes and goes, whose clock is set, or whose images change their size.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>

#include "camera/device_service.h"
#include "camera/messages.h"
#include "camera/service.h"
#include "camera/source.h"
#include "tests/test_data.h"
#include "tests/unit/dataset/fake_device.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;
using ::testing::HasSubstr;

constexpr TimeNs kSecondNs = 1000000000;
constexpr std::chrono::seconds kLimit{20};  // far above any time under test

class DeviceCamera : public testing::Test {
 protected:
  DeviceCamera()
      : network_(bus::makeFakeNetwork()),
        camera_bus_(bus::makeFakeBus(network_, {})),
        test_bus_(bus::makeFakeBus(network_, {})),
        topics_(bus::RunMode::kLive) {
    std::ofstream(folder_ / "sensor.yaml")
        << "camera_model: fisheye\nprojection: equidistant\nimage_width: 64\nimage_height: 48\nfocal_px: 15\n"
           "principal_point_px: [31.5, 23.5]\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n";
    std::ofstream(folder_ / "fleet.yaml")
        << "robots: {r1: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26}}\n"
           "cameras: {r1/fisheye: {source: device, path: /dev/video97, sensor: sensor.yaml}}\n"
           "services: {camera: {device: {retry_first_s: 0.02, retry_longest_s: 0.1}}}\n";
    options_.fleet = folder_ / "fleet.yaml";
    options_.camera = "r1/fisheye";
    options_.out = folder_.path();
    options_.mode = bus::RunMode::kLive;
    frames_ = test_bus_->frameReader("r1/fisheye", 64 * 48 * 3);
  }
  ~DeviceCamera() override { fake_->block(false); }

  bus::ServiceContext context() {
    return {*camera_bus_, options_, topics_,
            std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>())};
  }
  void start() {
    const auto offset = &system_offset_ns_;
    service_ = std::make_unique<DeviceCameraService>(
        context(), fleet::Fleet::load(options_.fleet, {}, {}), std::make_unique<test::FakeDevice>(fake_),
        [offset]() -> ClockReading {
          const TimeNs monotonic_ns = readHostClocks().monotonic_ns;
          return {monotonic_ns + *offset, monotonic_ns};
        });
    service_->start();
  }
  /// Runs the service as its process does, and takes its frames, until `done`.
  template <class Done>
  bool runUntil(Done done) {
    const auto limit = steady_clock::now() + kLimit;
    while (steady_clock::now() < limit) {
      while (service_->spin()) continue;
      while (const auto frame = frames_->take()) {
        headers_.push_back(frame->header);
        frames_->release();
      }
      for (Message& message : service_->status().takeMessages()) log_.push_back(std::move(message));
      if (done()) return true;
      camera_bus_->wait(std::chrono::milliseconds(20));
    }
    return false;
  }
  bool runForFrames(std::size_t count) {
    const std::size_t until = headers_.size() + count;
    return runUntil([&] { return headers_.size() >= until; });
  }
  bus::StatusBoard::Snapshot status() { return service_->status().snapshot(steady_clock::now()); }
  std::size_t logged(ErrorCode code) const {
    return std::count_if(log_.begin(), log_.end(), [&](const Message& m) { return m.code == code; });
  }

  test::TempFolder folder_;
  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> camera_bus_, test_bus_;
  bus::Topics topics_;
  bus::ServiceOptions options_;
  std::shared_ptr<test::FakeCamera> fake_ = std::make_shared<test::FakeCamera>();
  std::atomic<TimeNs> system_offset_ns_{1700000000 * kSecondNs};  ///< of the host's clocks
  std::unique_ptr<bus::FrameReader> frames_;
  std::unique_ptr<DeviceCameraService> service_;
  std::vector<bus::FrameHeader> headers_;
  std::vector<Message> log_;
};

TEST_F(DeviceCamera, ReportsLossUntilReturnAndNeverEnds) {
  start();
  ASSERT_TRUE(runForFrames(3));
  EXPECT_EQ(status().state, bus::ServiceState::kRunning);
  fake_->plug(false);
  ASSERT_TRUE(runUntil([&] { return status().state == bus::ServiceState::kDegraded; }));
  ASSERT_TRUE(
      runUntil([&] { return status().last_error.text.find("lost for more than 1 s") != std::string::npos; }));
  EXPECT_EQ(status().last_error.code, ErrorCode::kCameraLost);
  EXPECT_THAT(status().last_error.text, HasSubstr("r1/fisheye: camera lost"));
  EXPECT_THAT(status().last_error.text, HasSubstr("trying again every 0.1 s"));
  EXPECT_FALSE(service_->finished());
  EXPECT_EQ(logged(ErrorCode::kCameraLost), 1u) << "the status repeats it, the log does not";
  fake_->plug(true);
  ASSERT_TRUE(runForFrames(3));
  EXPECT_EQ(status().state, bus::ServiceState::kRunning);
  ASSERT_EQ(logged(ErrorCode::kCameraLost), 2u);
  EXPECT_THAT(log_.back().text, HasSubstr("the camera is back"));
  EXPECT_EQ(headers_.back().state, FrameState::kOk);
}

TEST_F(DeviceCamera, WaitsForDeviceThatIsAbsentWhenItsProcessStarts) {
  fake_->plug(false);
  start();
  ASSERT_TRUE(runUntil([&] { return status().last_error.code == ErrorCode::kCameraLost; }));
  fake_->plug(true);
  EXPECT_TRUE(runForFrames(1));
}

TEST_F(DeviceCamera, OfFleetFileRetriesIfItsDeviceIsAbsent) {
  const auto camera = makeCamera(context());
  camera->start();
  const auto limit = steady_clock::now() + kLimit;
  while (camera->status().snapshot(steady_clock::now()).last_error.code != ErrorCode::kCameraLost) {
    ASSERT_LT(steady_clock::now(), limit);
    camera->spin();
    camera_bus_->wait(std::chrono::milliseconds(20));
  }
  EXPECT_FALSE(camera->finished());
}

/// After a boot, the launcher may start before the camera is found.
TEST_F(DeviceCamera, IsNotRefusedByLaunchCheckIfAbsent) {
  const auto fleet = fleet::Fleet::load(options_.fleet, {}, {});
  EXPECT_NO_THROW(checkSource(fleet.camera("r1/fisheye"), fleet));
}

TEST_F(DeviceCamera, RejectsFramesOfAnotherSizeAndOpensDeviceAgain) {
  start();
  ASSERT_TRUE(runForFrames(1));
  fake_->resize({32, 24});
  ASSERT_TRUE(runUntil([&] { return fake_->attempts().size() >= 2; }));
  EXPECT_EQ(headers_.back().state, FrameState::kWrongSize);
  EXPECT_GE(logged(ErrorCode::kImageSizeMismatch), 1u);
  fake_->resize({64, 48});
  EXPECT_TRUE(runUntil([&] { return headers_.back().state == FrameState::kOk; }));
}

TEST_F(DeviceCamera, StopsWhileDeviceHangs) {
  fake_->block(true);
  start();
  service_->spin();
  service_->drain();
  const auto begun = steady_clock::now();
  service_.reset();
  EXPECT_LT(steady_clock::now() - begun, std::chrono::seconds(3));
}

/// By this much the system clock is set during the run.
class SetClock : public DeviceCamera, public testing::WithParamInterface<TimeNs> {};

TEST_P(SetClock, LosesNoFrameAndIsReportedOnce) {
  start();
  ASSERT_TRUE(runForFrames(3));
  system_offset_ns_ += GetParam();
  ASSERT_TRUE(runForFrames(10));
  ASSERT_TRUE(runUntil([&] { return logged(ErrorCode::kClockJump) > 0; }));
  ASSERT_TRUE(runForFrames(10));
  EXPECT_EQ(logged(ErrorCode::kClockJump), 1u);
  for (std::size_t i = 1; i < headers_.size(); ++i) {
    EXPECT_GT(headers_[i].acquired_ns, headers_[i - 1].acquired_ns) << i;
    EXPECT_LT(headers_[i].acquired_ns, headers_[i - 1].acquired_ns + kLimit.count() * kSecondNs) << i;
  }
}

TEST_P(SetClock, RestartedProcessContinuesTimeOfTheRun) {
  const SharedClock of_another_process(folder_.path(), [this]() -> ClockReading {
    const TimeNs monotonic_ns = readHostClocks().monotonic_ns;
    return {monotonic_ns + system_offset_ns_, monotonic_ns};
  });
  start();
  ASSERT_TRUE(runForFrames(3));
  system_offset_ns_ += GetParam();
  service_.reset();
  start();
  const TimeNs before_ns = headers_.back().acquired_ns;
  ASSERT_TRUE(runForFrames(1));
  EXPECT_GT(headers_.back().acquired_ns, before_ns);
  EXPECT_LT(headers_.back().acquired_ns, before_ns + kLimit.count() * kSecondNs);
}

INSTANTIATE_TEST_SUITE_P(BackAndForward, SetClock,
                         testing::Values(-3600 * kSecondNs, -10 * kSecondNs, 3600 * kSecondNs));

TEST(CameraLost, GrowsInSteps) {
  const auto text = [](double s) { return cameraLost("r1/fisheye", s, "gone", 2.0).text; };
  EXPECT_THAT(text(0.2), HasSubstr("camera lost, gone;"));
  EXPECT_THAT(text(12.0), HasSubstr("camera lost for more than 10 s, gone;"));
  EXPECT_THAT(text(12.0), HasSubstr("trying again every 2 s"));
  EXPECT_THAT(text(59.0), HasSubstr("more than 30 s"));
  EXPECT_THAT(text(3700.0), HasSubstr("more than 60 min"));
}

}  // namespace
}  // namespace omnifleet::services
