#pragma once

#include <chrono>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bus/service.h"
#include "idl/camera.h"

namespace omnifleet::services {

/// Topic camera_preview: a JPEG at most five times per second, only while a reader is matched. For display
/// only; no stage reads it.
class Preview {
 public:
  Preview(const bus::ServiceContext& context, const std::string& camera_id);

  /// @param image BGR8, valid only during the call. An image larger than the bound of the topic is reported
  /// and skipped.
  void offer(TimeNs acquired_ns, const cv::Mat& image, bus::StatusBoard& status);

 private:
  std::unique_ptr<bus::Writer<v1::CameraPreview>> writer_;
  v1::CameraPreview sample_;
  std::vector<unsigned char> jpeg_;
  std::optional<std::chrono::steady_clock::time_point> sent_;
};

}  // namespace omnifleet::services
