#include "dataset/capture.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>

#include "dataset/gstreamer_reason.h"

namespace omnifleet::dataset {
namespace {

std::string textOf(const __u8* text, std::size_t size) {
  const char* begin = reinterpret_cast<const char*>(text);
  return {begin, ::strnlen(begin, size)};
}

std::optional<DeviceIdentity> identify(const std::string& node) {
  const int file = ::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (file < 0) return std::nullopt;
  v4l2_capability capability{};
  const bool known = ::ioctl(file, VIDIOC_QUERYCAP, &capability) == 0;
  ::close(file);
  if (!known) return std::nullopt;
  const __u32 flags = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                                            : capability.capabilities;
  // A webcam has a second device file without frames, for its metadata.
  if ((flags & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) == 0) return std::nullopt;
  return DeviceIdentity{textOf(capability.card, sizeof capability.card),
                        textOf(capability.bus_info, sizeof capability.bus_info)};
}

class OpenCvCapture : public Capture {
 public:
  OpenCvCapture(const std::string& device, bool is_node, FrameSize size) {
    const bool has_v4l = cv::videoio_registry::hasBackend(cv::CAP_V4L2);
    capture_.open(device, is_node && has_v4l ? cv::CAP_V4L2 : cv::CAP_ANY);
    if (!capture_.isOpened() || size.width_px <= 0) return;
    capture_.set(cv::CAP_PROP_FRAME_WIDTH, size.width_px);
    capture_.set(cv::CAP_PROP_FRAME_HEIGHT, size.height_px);
  }
  bool isOpen() const { return capture_.isOpened(); }
  bool read(cv::Mat& image) override { return capture_.read(image); }

 private:
  cv::VideoCapture capture_;
};

class OpenCvDevice : public CaptureDevice {
 public:
  OpenCvDevice(const std::string& device, FrameSize size)
      : size_(size), path_(device, [] {
          DevicePath::Places places;
          places.identify = identify;
          return places;
        }()) {}

  bool isPresent() override {
    const std::lock_guard lock(mutex_);
    std::string ignored;
    return !path_.find(ignored).empty();
  }

  std::unique_ptr<Capture> open(std::string& fault) override {
    std::string node;
    {
      const std::lock_guard lock(mutex_);
      node = path_.find(fault);
    }
    if (node.empty()) return nullptr;
    const bool is_node = node.rfind("/dev/", 0) == 0;
    if (is_node && ::access(node.c_str(), R_OK | W_OK) != 0) {
      fault = errno == EACCES ? node + ": permission denied; add the user to the group video"
                              : node + ": " + std::strerror(errno);
      return nullptr;
    }
    receiveGLibMessages();
    auto capture = std::make_unique<OpenCvCapture>(node, is_node, size_);
    if (!capture->isOpen()) {
      const bool is_pipeline = node.find('!') != std::string::npos;
      fault = is_pipeline ? "the GStreamer pipeline cannot be opened: " + pipelineReason(node)
                          : node + " cannot be opened as a camera (is it in use by another program?)";
      return nullptr;
    }
    const std::lock_guard lock(mutex_);
    path_.opened(node);
    return capture;
  }

 private:
  FrameSize size_;
  std::mutex mutex_;
  DevicePath path_;
};

}  // namespace

std::unique_ptr<CaptureDevice> makeCaptureDevice(const std::string& device, FrameSize size) {
  return std::make_unique<OpenCvDevice>(device, size);
}

}  // namespace omnifleet::dataset
