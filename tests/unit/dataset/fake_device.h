#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "dataset/capture.h"

namespace omnifleet::test {

/// A camera that a test plugs, unplugs, blocks and changes. Shared by the device under test and the test.
class FakeCamera {
 public:
  using Clock = std::chrono::steady_clock;

  void plug(bool present) { set(present_, present); }
  void refuse(bool refused) { set(refused_, refused); }
  void block(bool blocked) { set(blocked_, blocked); }
  /// The camera returns while the next attempt to open it fails.
  void plugDuringAttempt() { set(returns_, true); }
  void resize(cv::Size size) { set(size_, size); }
  std::vector<Clock::time_point> attempts() {
    const std::lock_guard lock(mutex_);
    return attempts_;
  }

  bool isPresent() {
    const std::lock_guard lock(mutex_);
    return present_;
  }
  /// @return number of the connection; 0: the camera cannot be opened
  int open(std::string& fault) {
    const std::lock_guard lock(mutex_);
    attempts_.push_back(Clock::now());
    fault = "the fake camera is absent";
    const bool was_present = present_;
    present_ = present_ || std::exchange(returns_, false);
    if (!was_present || refused_) return 0;
    return ++connections_;
  }
  /// Frames come every 2 ms. A connection of before an outage never delivers again, as with a real device.
  bool read(int connection, cv::Mat& image) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::milliseconds(2), [] { return false; });
    if (blocked_ && connection == connections_) changed_.wait(lock, [this] { return !blocked_; });
    if (!present_) gone_ = connections_;
    if (connection <= gone_) return false;
    image.create(size_, CV_8UC3);
    image.setTo(cv::Scalar::all(connection));
    return true;
  }

 private:
  template <class T>
  void set(T& value, T to) {
    const std::lock_guard lock(mutex_);
    value = std::move(to);
    if (!present_) gone_ = connections_;
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  bool present_ = true, refused_ = false, blocked_ = false, returns_ = false;
  cv::Size size_{64, 48};
  int connections_ = 0;
  int gone_ = 0;  ///< connections up to this one are dead
  std::vector<Clock::time_point> attempts_;
};

class FakeDevice : public dataset::CaptureDevice {
 public:
  explicit FakeDevice(std::shared_ptr<FakeCamera> camera) : camera_(std::move(camera)) {}

  bool isPresent() override { return camera_->isPresent(); }
  std::unique_ptr<dataset::Capture> open(std::string& fault) override {
    struct Connection : dataset::Capture {
      Connection(std::shared_ptr<FakeCamera> owner, int n) : camera(std::move(owner)), number(n) {}
      bool read(cv::Mat& image) override { return camera->read(number, image); }
      std::shared_ptr<FakeCamera> camera;
      int number;
    };
    const int number = camera_->open(fault);
    return number > 0 ? std::make_unique<Connection>(camera_, number) : nullptr;
  }

 private:
  std::shared_ptr<FakeCamera> camera_;
};

}  // namespace omnifleet::test
