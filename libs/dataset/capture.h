#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "dataset/frame_source.h"

namespace omnifleet::dataset {

/// One open connection to a camera device.
class Capture {
 public:
  virtual ~Capture() = default;
  /// Waits for the next frame: 8-bit grey or BGR. False: no frame has arrived.
  virtual bool read(cv::Mat& image) = 0;
};

/// A camera device that may come and go. Several threads may call it.
class CaptureDevice {
 public:
  virtual ~CaptureDevice() = default;
  /// Whether an attempt to open the device may succeed, by a cheap look: its device file exists.
  virtual bool isPresent() = 0;
  /// Opens the device, wherever it is now. Null when that fails; `fault` then has the reason.
  virtual std::unique_ptr<Capture> open(std::string& fault) = 0;
};

/// A camera device through OpenCV: a number, "/dev/videoN", a link as in /dev/v4l/by-id, or an address that
/// OpenCV opens. Requests `size` at every opening (zeros: the device's own).
std::unique_ptr<CaptureDevice> makeCaptureDevice(const std::string& device, FrameSize size);

/// What a video device says about itself (V4L2 QUERYCAP).
struct DeviceIdentity {
  std::string card;  ///< model, e.g. "HD Webcam C615"
  std::string bus;   ///< where it is connected, e.g. "usb-0000:00:14.0-2"
};

/// Finds the device file of a camera at every opening, because the kernel may give a camera that returns
/// another number. A link (by-id) is resolved anew each time. A numbered file ("/dev/video0", "0") is
/// followed by what was known at its first opening: first by the by-id link that pointed to it, then by model
/// and connection, then by the model if only one device has it. Another camera under the same number is not
/// used.
class DevicePath {
 public:
  struct Places {
    std::string nodes = "/dev";            ///< folder of the files "videoN"
    std::string by_id = "/dev/v4l/by-id";  ///< folder of links that udev makes
    /// Empty: unknown, or no device that captures frames.
    std::function<std::optional<DeviceIdentity>(const std::string& node)> identify;
  };

  DevicePath(const std::string& device, Places places);

  /// The file to open now. Empty when the camera is absent; `fault` then has the reason.
  std::string find(std::string& fault) const;
  /// The camera was opened as `node`. The first call fixes its identity.
  void opened(const std::string& node);
  /// False for an address that is no file: find() always returns it.
  bool isFile() const { return is_file_; }

 private:
  std::string findAgain(std::string& fault) const;

  std::string device_;
  Places places_;
  bool is_file_ = true, is_link_ = false;
  std::string link_;  ///< by-id link that pointed to the device at its first opening
  std::optional<DeviceIdentity> identity_;
  bool was_opened_ = false;
};

}  // namespace omnifleet::dataset
