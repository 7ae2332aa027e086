// Camera devices that come and go. The device is a fake; times are generous, because the machine may be busy.
#include "dataset/live_camera.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <thread>

#include "tests/test_data.h"
#include "tests/unit/dataset/fake_device.h"

namespace omnifleet::dataset {
namespace {

using Clock = LiveCamera::Clock;
namespace fs = std::filesystem;
constexpr std::chrono::seconds kPatience{20};  // far above any time under test

class LiveCameraTest : public ::testing::Test {
 protected:
  LiveCameraTest() {
    options_.retry_first_s = 0.02;
    options_.retry_longest_s = 0.08;
  }
  ~LiveCameraTest() override { fake_->block(false); }

  void open() {
    camera_ = std::make_unique<LiveCamera>(
        std::make_unique<test::FakeDevice>(fake_), options_, [] { return TimeNs{42}; }, [] {});
  }
  bool await(const std::function<bool()>& condition, Clock::duration limit = kPatience) {
    const auto until = Clock::now() + limit;
    while (!condition()) {
      if (Clock::now() > until) return false;
      std::this_thread::yield();
    }
    return true;
  }
  bool awaitFrame(Clock::duration limit = kPatience) {
    return await([this] { return camera_->loss(Clock::now()), camera_->take(frame_); }, limit);
  }
  bool awaitLoss() {
    return await([this] { return camera_->loss(Clock::now()).has_value(); });
  }

  std::shared_ptr<test::FakeCamera> fake_ = std::make_shared<test::FakeCamera>();
  LiveCameraOptions options_;
  std::unique_ptr<LiveCamera> camera_;
  LiveFrame frame_;
};

TEST_F(LiveCameraTest, DeliversAgainAfterReturnHoweverManyAttemptsFailed) {
  open();
  ASSERT_TRUE(awaitFrame());
  EXPECT_EQ(frame_.time_ns, 42) << "stamped by the clock of the camera";
  EXPECT_EQ(frame_.image.size(), cv::Size(64, 48));
  const auto before = Clock::now();
  const std::uint32_t last = frame_.sequence;
  fake_->plug(false);
  ASSERT_TRUE(awaitLoss());
  // The former source gave up after 50 failed reads, which took 3 ms.
  ASSERT_TRUE(await([this] { return fake_->attempts().size() >= 8; }));
  const auto loss = camera_->loss(Clock::now());
  ASSERT_TRUE(loss);
  EXPECT_LE(loss->since, before + kPatience);
  EXPECT_EQ(loss->reason, "the fake camera is absent");
  EXPECT_FALSE(camera_->take(frame_) && camera_->take(frame_));
  fake_->plug(true);
  ASSERT_TRUE(awaitFrame());
  EXPECT_GT(frame_.sequence, last);
  EXPECT_FALSE(camera_->loss(Clock::now()));
}

TEST_F(LiveCameraTest, WaitsForDeviceThatIsAbsentAtTheStart) {
  fake_->plug(false);
  open();
  ASSERT_TRUE(awaitLoss());
  fake_->plug(true);
  EXPECT_TRUE(awaitFrame());
}

TEST_F(LiveCameraTest, DeliversWithinTwoSecondsOfReturnEvenIfThePauseIsLonger) {
  options_.retry_first_s = options_.retry_longest_s = 60.0;
  fake_->plug(false);
  open();
  ASSERT_TRUE(awaitLoss());
  const auto returned = Clock::now();
  fake_->plug(true);
  ASSERT_TRUE(awaitFrame());
  EXPECT_LT(Clock::now() - returned, std::chrono::seconds(2)) << "the issue's bound";
}

TEST_F(LiveCameraTest, DeliversAfterReturnDuringAFailingAttempt) {
  options_.retry_first_s = options_.retry_longest_s = 60.0;
  fake_->plug(false);
  fake_->plugDuringAttempt();
  open();
  EXPECT_TRUE(awaitFrame());
}

TEST_F(LiveCameraTest, DoublesPauseUpToTheLongest) {
  fake_->refuse(true);
  open();
  ASSERT_TRUE(await([this] { return fake_->attempts().size() >= 7; }));
  const auto attempts = fake_->attempts();
  const double expected_s[] = {0.02, 0.04, 0.08, 0.08, 0.08, 0.08};
  for (std::size_t i = 0; i < 6; ++i) {
    const double pause_s = std::chrono::duration<double>(attempts[i + 1] - attempts[i]).count();
    EXPECT_GE(pause_s, 0.95 * expected_s[i]) << i;
    // 20 times: the machine may be busy, but a pause that doubles without limit would reach it at the latest
    // at 1.6 s.
    EXPECT_LT(pause_s, 20.0 * 0.08) << i;
  }
}

TEST_F(LiveCameraTest, GivesUpReadThatHangsAndOpensDeviceAgain) {
  options_.read_timeout_s = 0.2;
  fake_->block(true);
  open();
  // The first connection hangs. The fake lets only the newest one hang, so the second frees the first.
  ASSERT_TRUE(await([this] { return camera_->loss(Clock::now()).has_value(); }));
  EXPECT_EQ(camera_->loss(Clock::now())->reason, "the device does not answer");
  ASSERT_TRUE(await([this] { return camera_->loss(Clock::now()), fake_->attempts().size() >= 2; }));
  fake_->block(false);
  EXPECT_TRUE(awaitFrame());
}

TEST_F(LiveCameraTest, StopsWhileReadHangs) {
  fake_->block(true);
  open();
  ASSERT_TRUE(await([this] { return fake_->attempts().size() == 1; }));
  const auto begun = Clock::now();
  camera_.reset();
  EXPECT_LT(Clock::now() - begun, LiveCamera::kStopLimit + std::chrono::seconds(2));
}

TEST_F(LiveCameraTest, OpensAgainOnRequest) {
  open();
  ASSERT_TRUE(awaitFrame());
  camera_->reopen();
  ASSERT_TRUE(await([this] { return fake_->attempts().size() >= 2; }));
  EXPECT_TRUE(awaitFrame());
}

/// Folders like /dev and /dev/v4l/by-id, with plain files as devices.
class DevicePathTest : public ::testing::Test {
 protected:
  DevicePathTest() {
    fs::create_directories(nodes());
    fs::create_directories(byId());
  }
  fs::path nodes() const { return fs::canonical(folder_.path()) / "dev"; }
  fs::path byId() const { return fs::canonical(folder_.path()) / "by-id"; }
  std::string node(int number) const { return nodes() / ("video" + std::to_string(number)); }
  void plug(int number, const std::string& card, const std::string& bus, const std::string& link = {}) {
    std::ofstream(node(number)) << card;
    cards_[node(number)] = {card, bus};
    if (!link.empty()) fs::create_symlink(node(number), byId() / link);
  }
  void unplug(int number, const std::string& link = {}) {
    fs::remove(node(number));
    cards_.erase(node(number));
    if (!link.empty()) fs::remove(byId() / link);
  }
  DevicePath path(const std::string& device) {
    return {device, {nodes(), byId(), [this](const std::string& file) -> std::optional<DeviceIdentity> {
                       const auto found = cards_.find(file);
                       return found == cards_.end() ? std::nullopt : std::optional(found->second);
                     }}};
  }
  static std::string find(const DevicePath& path) {
    std::string fault;
    const std::string found = path.find(fault);
    EXPECT_EQ(found.empty(), !fault.empty()) << fault;
    return found;
  }

  test::TempFolder folder_;
  std::map<std::string, DeviceIdentity> cards_;
};

TEST_F(DevicePathTest, ResolvesLinkAtEveryOpening) {
  plug(0, "Cam", "usb-1", "usb-Cam_1234-video-index0");
  DevicePath path = this->path(byId() / "usb-Cam_1234-video-index0");
  EXPECT_EQ(find(path), node(0));
  path.opened(node(0));
  unplug(0, "usb-Cam_1234-video-index0");
  EXPECT_EQ(find(path), "");
  plug(0, "Other", "usb-7");
  EXPECT_EQ(find(path), "") << "another camera has taken its number";
  plug(3, "Cam", "usb-2", "usb-Cam_1234-video-index0");
  EXPECT_EQ(find(path), node(3));
}

TEST_F(DevicePathTest, FollowsByIdLinkOfNumberedDevice) {
  plug(0, "Cam", "usb-1", "usb-Cam_1234-video-index0");
  plug(1, "Cam", "usb-9", "usb-Cam_5678-video-index0");
  DevicePath path = this->path(node(0));
  EXPECT_EQ(find(path), node(0));
  path.opened(node(0));
  unplug(0, "usb-Cam_1234-video-index0");
  EXPECT_EQ(find(path), "") << "the other one of this model is another camera";
  plug(2, "Cam", "usb-4", "usb-Cam_1234-video-index0");
  EXPECT_EQ(find(path), node(2));
}

TEST_F(DevicePathTest, FollowsModelAndConnectionWithoutLinks) {
  plug(0, "Cam", "usb-1");
  plug(1, "Cam", "usb-2");
  plug(2, "Other", "usb-3");
  DevicePath path = this->path("0");
  EXPECT_EQ(find(path), node(0));
  path.opened(node(0));
  unplug(0);
  plug(4, "Cam", "usb-1");
  EXPECT_EQ(find(path), node(4)) << "the same socket";
  unplug(4);
  EXPECT_EQ(find(path), node(1)) << "the only one of its model";
  plug(0, "Cam", "usb-8");
  EXPECT_EQ(find(path), "") << "two of its model, neither at its socket";
}

TEST_F(DevicePathTest, DoesNotUseAnotherCameraUnderItsNumber) {
  plug(0, "Cam", "usb-1");
  DevicePath path = this->path(node(0));
  path.opened(node(0));
  unplug(0);
  plug(0, "Other", "usb-1");
  EXPECT_EQ(find(path), "");
}

TEST_F(DevicePathTest, PassesAddressesOn) {
  DevicePath path = this->path("rtsp://camera/1");
  EXPECT_FALSE(path.isFile());
  EXPECT_EQ(find(path), "rtsp://camera/1");
}

}  // namespace
}  // namespace omnifleet::dataset
