#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "lens/camera.h"
#include "markers/patch_finder.h"
#include "observation/observation.h"

namespace omnifleet::localizer {

/// Front end of a ceiling camera: image in, one absolute pose measurement per visible robot out (source
/// "ceiling/<camera>").
class CeilingFrontEnd {
 public:
  CeilingFrontEnd(const std::string& camera_id, const lens::CameraModel& camera,
                  const dataset::MarkerSet& markers, const markers::FinderOptions& options);

  /// `bgr`: CV_8UC3 of the camera's size; throws std::runtime_error otherwise. Measurements are ordered by
  /// robot name.
  std::vector<Measurement> process(TimeNs acquired, std::uint32_t sequence, const cv::Mat& bgr);

  /// The detections of the last image, for pictures.
  const std::vector<markers::Detection>& detections() const { return detections_; }
  /// Robots of which the last image shows two markers.
  const std::vector<markers::Conflict>& conflicts() const { return finder_->conflicts(); }

 private:
  std::string source_;
  std::unique_ptr<markers::MarkerFinder> finder_;
  std::vector<markers::Detection> detections_;
};

}  // namespace omnifleet::localizer
