#include "local_mapper/front_mapper.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "local_mapper/debug_images.h"
#include "local_mapper/messages.h"

namespace omnifleet::local_mapper {

FrontMapper::Options FrontMapper::Options::read(const options::Section& section) {
  Options o;
  o.check = FrameCheckOptions::read(section.child("frame"));
  o.distance_vector = distance_vector::Options::read(section.child("distance_vector"));
  return o;
}

FrontMapper::FrontMapper(const lens::Camera& camera, const Options& options)
    : check_(camera.model(),
             cv::Mat1b(camera.model().image_height_px, camera.model().image_width_px, std::uint8_t{255}),
             options.check),
      is_literal_(options.distance_vector.method == distance_vector::Method::kLiteral),
      distances_(camera, options.distance_vector) {}

const LocalMap& FrontMapper::process(const Frame& frame, const Motion& wheels) {
  local_map_.acquired_ns = frame.acquired_ns;
  local_map_.sequence = frame.sequence;
  local_map_.state = check_.check(frame);
  local_map_.motion = wheels;
  fault_ = {};
  if (local_map_.state != FrameState::kOk) {
    local_map_.scan = {};
    local_map_.boundary.clear();
    return local_map_;
  }
  const bool is_grey = frame.image.channels() == 1;
  if (is_grey) cv::cvtColor(frame.image, bgr_, cv::COLOR_GRAY2BGR);
  distances_.process(is_grey ? bgr_ : frame.image);
  local_map_.scan = distances_.scan();
  local_map_.boundary = distances_.boundary();
  if (is_literal_) {
    std::fill(local_map_.scan.sigma_m.begin(), local_map_.scan.sigma_m.end(), 0.0f);
    local_map_.boundary.clear();
  }
  using Fault = distance_vector::DistanceVector::Fault;
  if (distances_.fault() == Fault::kNoFloor) fault_ = noFloorAhead();
  if (distances_.fault() == Fault::kTooNear) fault_ = obstacleTooNear();
  return local_map_;
}

cv::Mat distancePicture(const FrontMapper& mapper, const cv::Mat& image) {
  cv::Mat original;
  if (image.channels() == 1)
    cv::cvtColor(image, original, cv::COLOR_GRAY2BGR);
  else
    original = image;
  cv::Mat picture = original.clone();
  const std::vector<float>& rows = mapper.distances().edgeRows();
  for (std::size_t u = 0; u < rows.size(); ++u) {
    const int row = std::isfinite(rows[u]) ? cvRound(rows[u]) : -1;
    if (row < 0 || row >= picture.rows) continue;
    cv::line(picture, {static_cast<int>(u), row}, {static_cast<int>(u), picture.rows - 1}, {90, 90, 200}, 1);
    picture.at<cv::Vec3b>(row, static_cast<int>(u)) = {0, 0, 255};
  }
  cv::addWeighted(picture, 0.6, original, 0.4, 0.0, picture);
  return picture;
}

std::vector<std::string> saveDistancePictures(const FrontMapper& mapper, const cv::Mat& image,
                                              const std::string& prefix) {
  std::vector<std::string> problems;
  writePicture(prefix + "_floor.png", mapper.distances().floorMask(), problems);
  writePicture(prefix + "_distance.png", distancePicture(mapper, image), problems);
  return problems;
}

}  // namespace omnifleet::local_mapper
