#include "dataset/writer.h"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "dataset/atomic_file.h"

namespace omnifleet::dataset {
namespace {

std::string streamFolder(const std::string& folder, const std::string& stream) {
  makeDirectories(folder + "/" + stream + "/data");
  return folder + "/" + stream;
}

std::string robotYaml(const RobotRecording& robot) {
  std::string text = fmt::format("  {}:\n", robot.name);
  if (robot.initial_pose) {
    text += fmt::format("    initial_pose: [{}, {}, {}]\n", robot.initial_pose->x_m, robot.initial_pose->y_m,
                        robot.initial_pose->theta_rad);
  }
  if (robot.body.height_m > 0.0) {
    std::string shape = fmt::format("radius_m: {}", robot.body.radius_m);
    if (!robot.body.footprint_m.empty()) {
      std::vector<std::string> vertices;
      for (const Eigen::Vector2d& v : robot.body.footprint_m)
        vertices.push_back(fmt::format("[{}, {}]", v.x(), v.y()));
      shape = fmt::format("footprint_m: [{}]", fmt::join(vertices, ", "));
    }
    text += fmt::format("    body: {{{}, height_m: {}}}\n", shape, robot.body.height_m);
  }
  if (robot.body.wheel_separation_m > 0.0) {
    text += fmt::format("    wheel_separation_m: {}\n", robot.body.wheel_separation_m);
  }
  return text;
}

}  // namespace

void writeDatasetYaml(const std::string& folder, const std::vector<RobotRecording>& robots) {
  std::string text = "format: omnifleet-dataset\nversion: 1\nrobots:\n";
  for (const RobotRecording& robot : robots) text += robotYaml(robot);
  writeAtomic(folder + "/dataset.yaml", text);
}

void writeMarkers(const std::string& folder, const MarkerSet& markers) {
  writeAtomic(folder + "/ceiling/markers.yaml", markers.toYaml());
}

CsvWriter::CsvWriter(std::string path, const std::string& header) : path_(std::move(path)) {
  const std::size_t slash = path_.rfind('/');
  if (slash != std::string::npos) makeDirectories(path_.substr(0, slash));
  file_.open(path_, std::ios::trunc);
  row(header);
}

void CsvWriter::row(const std::string& line) {
  file_ << line << '\n';
  file_.flush();
  if (!file_) throw std::runtime_error(path_ + ": cannot be written (disk full or no permission?)");
}

ImageStreamWriter::ImageStreamWriter(const std::string& folder, const std::string& stream,
                                     const lens::CameraModel& camera, const std::string& extension)
    : folder_(streamFolder(folder, stream)),
      extension_(extension),
      csv_(folder_ + "/data.csv", "#timestamp [ns],filename") {
  if (extension != "png" && extension != "jpg")
    throw std::invalid_argument("ImageStreamWriter: the extension must be png or jpg");
  writeAtomic(folder_ + "/sensor.yaml", camera.toYaml());
}

void ImageStreamWriter::write(TimeNs time_ns, const cv::Mat& image) {
  const std::string name = fmt::format("{}.{}", time_ns, extension_);
  const std::string path = folder_ + "/data/" + name;
  static const std::vector<int> kParameters{cv::IMWRITE_JPEG_QUALITY, 95, cv::IMWRITE_PNG_COMPRESSION, 1};
  bool written = false;
  try {
    written = cv::imwrite(path, image, kParameters);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw std::runtime_error(path + ": cannot be written (disk full or no permission?)");
  csv_.row(fmt::format("{},{}", time_ns, name));
}

void ImageStreamWriter::writeMissing(TimeNs time_ns) {
  csv_.row(fmt::format("{},", time_ns));
}

WheelsWriter::WheelsWriter(const std::string& folder, const std::string& robot)
    : csv_(folder + "/" + robot + "/wheels/data.csv", "#timestamp [ns],v_left [m s^-1],v_right [m s^-1]") {}

void WheelsWriter::write(const WheelRow& row) {
  csv_.row(fmt::format("{},{},{}", row.time_ns, row.left_mps, row.right_mps));
}

ObservationsWriter::ObservationsWriter(const std::string& folder, const std::string& robot)
    : csv_(folder + "/" + robot + "/observations.csv", "#timestamp [ns],id,range [m],bearing [rad]") {}

void ObservationsWriter::write(const RangeBearingRow& row) {
  csv_.row(fmt::format("{},{},{},{}", row.time_ns, row.id, row.range_m, row.bearing_rad));
}

LaserWriter::LaserWriter(const std::string& folder, const std::string& robot, const LaserSensor& sensor)
    : csv_(folder + "/" + robot + "/laser/data.csv",
           "#timestamp [ns],angle_min [rad],angle_increment [rad],ranges [m]...") {
  writeAtomic(folder + "/" + robot + "/laser/sensor.yaml", sensor.toYaml());
}

void LaserWriter::write(const LaserRow& row) {
  csv_.row(fmt::format("{},{},{},{}", row.time_ns, row.angle_min_rad, row.angle_increment_rad,
                       fmt::join(row.range_m, ",")));
}

void writeTruthTrajectory(const std::string& folder, const std::string& robot,
                          const std::vector<StampedPose>& poses) {
  writeTum(folder + "/groundtruth/" + robot + ".tum", poses);
}

void writeTruthScene(const std::string& folder, const std::vector<MapObject>& scene) {
  writeObjects(folder + "/groundtruth/scene.geojson", scene);
}

void writeTruthRoom(const std::string& folder, const Polygon& room) {
  if (room.empty()) return;
  MapObject outline;
  outline.kind = "room";
  outline.outline_m = room;
  outline.centroid_m = centroid(room);
  writeObjects(folder + "/groundtruth/room.geojson", {outline});
}

}  // namespace omnifleet::dataset
