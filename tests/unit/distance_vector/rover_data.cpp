#include "tests/unit/distance_vector/rover_data.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

namespace omnifleet::test {
namespace {

constexpr int kMapCells = 200;

/// From a name such as robocam_2017_05_02_11_16_21_421.jpg. Negative if it is none.
TimeNs timeOf(const std::string& name) {
  std::tm date{};
  int milliseconds = 0;
  if (std::sscanf(name.c_str(), "robocam_%d_%d_%d_%d_%d_%d_%d.jpg", &date.tm_year, &date.tm_mon,
                  &date.tm_mday, &date.tm_hour, &date.tm_min, &date.tm_sec, &milliseconds) != 7)
    return -1;
  date.tm_year -= 1900;
  date.tm_mon -= 1;
  return (static_cast<TimeNs>(::timegm(&date)) * 1000 + milliseconds) * 1'000'000;
}

}  // namespace

/// The corners are (14, 140), (301, 140), (200, 96), (118, 96). The sides are 287 and 82 px wide, so the
/// horizon is at row 78.4, the vanishing point at column 159.5. The pitch follows from the horizon, the focal
/// length from the depth of 1 m between both sides, the height from the rows. The square begins 0.6 m in
/// front of the rover.
lens::CameraModel roverCamera() {
  constexpr double kNear_px = 287.0, kFar_px = 82.0, kNearRow = 140.0, kFarRow = 96.0, kCentreRow = 79.5;
  constexpr double kHorizonRow = (kFarRow * kNear_px - kNearRow * kFar_px) / (kNear_px - kFar_px);
  constexpr double kFocal_px = 1.0 / (1.0 / kFar_px - 1.0 / kNear_px);
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 320;
  model.image_height_px = 160;
  model.focal_px = {kFocal_px, kFocal_px};
  model.principal_point_px = {159.5, kCentreRow};
  model.position_m = {0.6 - kFocal_px / kNear_px, 0.0, (kNearRow - kHorizonRow) / kNear_px};
  model.rotation_rpy_deg = {0.0, -90.0 + std::atan2(kCentreRow - kHorizonRow, kFocal_px) * 180.0 / M_PI, 0.0};
  return model;
}

std::vector<RoverStep> roverSteps(const std::string& folder) {
  std::vector<RoverStep> steps;
  std::ifstream file(folder + "/test_dataset/robot_log.csv");
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::vector<std::string> fields;
    std::stringstream stream(line);
    for (std::string field; std::getline(stream, field, ';');) fields.push_back(field);
    if (fields.size() < 10) continue;
    const std::string name = fields[0].substr(fields[0].rfind('/') + 1);
    RoverStep step;
    step.image = folder + "/test_dataset/IMG/" + name;
    step.time_ns = timeOf(name);
    if (step.time_ns < 0 || !std::filesystem::exists(step.image)) continue;
    const auto turned = [&](std::size_t i) { return std::remainder(std::stod(fields[i]), 360.0); };
    step.map_from_base = {std::stod(fields[5]), std::stod(fields[6]), turned(8) * M_PI / 180.0};
    step.tilt_deg = std::max(std::abs(turned(7)), std::abs(turned(9)));
    steps.push_back(step);
  }
  for (std::size_t k = steps.size(); k-- > 0;) steps[k].time_ns -= steps.front().time_ns;
  return steps;
}

cv::Mat1b roverMap(const std::string& folder) {
  return cv::imread(folder + "/calibration_images/map_bw.png", cv::IMREAD_GRAYSCALE);
}

void alongRoverMap(const Eigen::Vector2d& from_m, double heading_rad, double to_m,
                   const std::function<bool(const cv::Point&)>& each) {
  constexpr double kFirst_m = 0.5, kStep_m = 0.1;
  for (double r = kFirst_m; r < to_m; r += kStep_m) {
    const cv::Point cell(static_cast<int>(from_m.x() + r * std::cos(heading_rad)),
                         static_cast<int>(from_m.y() + r * std::sin(heading_rad)));
    if (cell.x < 0 || cell.y < 0 || cell.x >= kMapCells || cell.y >= kMapCells || !each(cell)) return;
  }
}

cv::Mat1b roverSight(const cv::Mat1b& map, const std::vector<RoverStep>& steps, double reach_m) {
  constexpr double kHalfView_rad = 0.9;  // the image columns end at ±54°
  constexpr int kRays = 206;             // 720 per turn, as a distance vector has
  const double mounted_m = roverCamera().position_m.x();
  cv::Mat1b seen(map.size(), static_cast<std::uint8_t>(0));
  for (const RoverStep& step : steps) {
    const Eigen::Vector2d from = step.map_from_base * Eigen::Vector2d(mounted_m, 0.0);
    for (int i = 0; i <= kRays; ++i) {
      const double bearing = kHalfView_rad * (2.0 * i / kRays - 1.0);
      alongRoverMap(from, step.map_from_base.theta_rad + bearing, reach_m, [&](const cv::Point& cell) {
        if (map(cell)) seen(cell) = 1;
        return map(cell) != 0;
      });
    }
  }
  return seen;
}

}  // namespace omnifleet::test
