#include "tests/experiments/ahmed/figures.h"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "dataset/map_files.h"
#include "fleet/fleet.h"
#include "local_mapper/front_service.h"
#include "tests/experiments/plot/plot.h"

namespace omnifleet::ahmed {
namespace {

constexpr double kPixels_per_m = 300.0, kMargin_m = 0.1;

cv::Mat readPicture(const std::string& path) {
  const cv::Mat picture = cv::imread(path);
  if (picture.empty()) throw std::runtime_error(path + ": cannot be read");
  return picture;
}

/// The image in quarter turns so that map +x points to the right, as in the maps.
cv::Mat turnedToMap(const lens::CameraModel& model, const cv::Mat& image) {
  const lens::Camera camera(model);
  const Eigen::Vector2d middle = model.position_m.head<2>();
  const auto pixel = [&](const Eigen::Vector2d& at) {
    return camera.pixelFromPoint({at.x(), at.y(), 0.0}).value_or(Eigen::Vector2d::Zero());
  };
  constexpr double kStep_m = 0.1;
  const Eigen::Vector2d x = pixel(middle + Eigen::Vector2d(kStep_m, 0.0)) - pixel(middle);
  if (std::abs(x.x()) > std::abs(x.y()) && x.x() > 0.0) return image;
  cv::Mat turned;
  cv::rotate(image, turned,
             std::abs(x.x()) > std::abs(x.y()) ? cv::ROTATE_180
             : x.y() > 0.0                     ? cv::ROTATE_90_COUNTERCLOCKWISE
                                               : cv::ROTATE_90_CLOCKWISE);
  return turned;
}

cv::Mat lastImage(const dataset::ImageStream& stream) {
  for (auto row = stream.rows.rbegin(); row != stream.rows.rend(); ++row) {
    const cv::Mat image = cv::imread(row->path);
    if (!image.empty()) return turnedToMap(stream.camera, image);
  }
  throw std::runtime_error(stream.name + ": has no readable image");
}

/// How much the boundary varies: many columns with an edge, at different rows.
double variation(const std::vector<float>& rows) {
  double sum = 0.0, square = 0.0, count = 0.0;
  for (const float row : rows) {
    if (!std::isfinite(row)) continue;
    sum += static_cast<double>(row);
    square += static_cast<double>(row * row);
    count += 1.0;
  }
  if (count < 2.0) return 0.0;
  return count / static_cast<double>(rows.size()) *
         std::sqrt(std::max(0.0, square / count - sum * sum / (count * count)));
}

/// The map in grey levels (occupied black, free white) with the true faces as red lines.
cv::Mat mapPicture(const std::string& run, const dataset::GroundTruth& truth) {
  const dataset::OccupancyGrid grid = dataset::readMapServer(run + "/map.yaml");
  Eigen::Vector2d low = truth.room.front(), high = low;
  for (const Eigen::Vector2d& corner : truth.room) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  low.array() -= kMargin_m;
  high.array() += kMargin_m;
  const auto pixel = [&](const Eigen::Vector2d& at) {
    return cv::Point2d(kPixels_per_m * (at.x() - low.x()), kPixels_per_m * (high.y() - at.y()));
  };
  const cv::Point2d size = pixel({high.x(), low.y()});
  cv::Mat picture(cvRound(size.y), cvRound(size.x), CV_8UC3, cv::Scalar::all(205));
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const int value = grid.cells[static_cast<std::size_t>(y * grid.width + x)];
      if (value < 0) continue;
      const Eigen::Vector2d corner = grid.origin_m + grid.resolution_m * Eigen::Vector2d(x, y);
      const cv::Point2d upper = pixel(corner + Eigen::Vector2d(0.0, grid.resolution_m)),
                        lower = pixel(corner + Eigen::Vector2d(grid.resolution_m, 0.0));
      cv::rectangle(picture, cv::Point(upper), cv::Point(lower) - cv::Point(1, 1),
                    value > 50 ? cv::Scalar::all(0) : cv::Scalar::all(255), cv::FILLED);
    }
  }
  const auto outline = [&](const Polygon& polygon) {
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& corner : polygon) points.emplace_back(pixel(corner));
    cv::polylines(picture, points, true, {40, 40, 230}, 1, cv::LINE_AA);
  };
  outline(truth.room);
  for (const dataset::MapObject& object : truth.scene) outline(object.outline_m);
  return picture;
}

}  // namespace

void drawDistanceVector(const std::string& recording, const std::vector<std::string>& overlays,
                        const std::string& path) {
  const dataset::Dataset data = dataset::Dataset::open(recording);
  const auto options = services::frontOptions(fleet::Fleet::load("", recording, overlays));
  double most = 0.0;
  cv::Mat best, floor, distance;
  for (const dataset::RobotRecording& robot : data.robots) {
    if (!robot.front) continue;
    local_mapper::FrontMapper mapper(lens::Camera(robot.front->camera), options);
    const auto source = dataset::openStream(*robot.front, dataset::Colour::kBgr);
    cv::Mat image;
    dataset::FrameInfo info;
    while (source->next(image, info)) {
      mapper.process({info.time_ns, info.sequence, info.state, image}, {});
      const double varies = variation(mapper.distances().edgeRows());
      if (info.state != FrameState::kOk || varies <= most) continue;
      most = varies;
      best = image.clone();
      cv::cvtColor(mapper.distances().floorMask(), floor, cv::COLOR_GRAY2BGR);
      distance = local_mapper::distancePicture(mapper, image);
    }
  }
  if (best.empty()) throw std::runtime_error(recording + ": no image of a forward camera shows floor");
  experiments::save(path, experiments::beside({best, floor, distance},
                                              {"(b) input image", "(c) segmented", "(d) distance vector"}));
}

void drawMaps(const std::string& recording, const std::vector<std::pair<std::string, std::string>>& runs,
              const std::string& path) {
  const dataset::Dataset data = dataset::Dataset::open(recording);
  const dataset::GroundTruth truth = dataset::GroundTruth::load(recording);
  std::vector<cv::Mat> ceiling, maps;
  std::vector<std::string> cameras, captions;
  for (const dataset::ImageStream& stream : data.ceiling) {
    ceiling.push_back(lastImage(stream));
    cameras.push_back("(" + std::string(1, static_cast<char>('a' + cameras.size())) + ") " + stream.name);
  }
  for (const auto& [caption, run] : runs) {
    maps.push_back(mapPicture(run, truth));
    captions.push_back("(c) map, " + caption + "; true faces red");
  }
  experiments::save(path, experiments::stacked(
                              {experiments::beside(maps, captions), experiments::beside(ceiling, cameras)}));
}

void drawBeside(const std::vector<std::pair<std::string, std::string>>& pictures, const std::string& path) {
  std::vector<cv::Mat> images;
  std::vector<std::string> captions;
  for (const auto& [caption, file] : pictures) {
    images.push_back(readPicture(file));
    captions.push_back(caption);
  }
  experiments::save(path, experiments::beside(images, captions));
}

}  // namespace omnifleet::ahmed
