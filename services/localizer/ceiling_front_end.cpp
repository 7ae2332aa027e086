#include "localizer/ceiling_front_end.h"

namespace omnifleet::localizer {

CeilingFrontEnd::CeilingFrontEnd(const std::string& camera_id, const lens::CameraModel& camera,
                                 const dataset::MarkerSet& markers, const markers::FinderOptions& options)
    : source_("ceiling/" + camera_id),
      finder_(markers::MarkerFinder::make(lens::Camera(camera), markers, options)) {}

std::vector<Measurement> CeilingFrontEnd::process(TimeNs acquired, std::uint32_t sequence,
                                                  const cv::Mat& bgr) {
  detections_ = finder_->find(bgr, acquired);
  std::vector<Measurement> measurements;
  for (const markers::Detection& detection : detections_) {
    Measurement measurement;
    measurement.source = source_;
    measurement.sequence = sequence;
    measurement.kind = MeasurementKind::kAbsolutePose;
    measurement.to = detection.robot;
    measurement.acquired_ns = acquired;
    measurement.value = detection.map_from_base.vector();
    measurement.covariance = detection.covariance;
    measurements.push_back(std::move(measurement));
  }
  return measurements;
}

}  // namespace omnifleet::localizer
