#pragma once

#include <fstream>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::dataset {

/// Writers of the dataset format, one per file, so that each process of a fleet records its own data. Every
/// call throws std::runtime_error that names the file when it cannot be written. Rows are flushed, so a full
/// disk is detected at once.

/// Writes dataset.yaml: names, initial poses, bodies, wheel separations.
void writeDatasetYaml(const std::string& folder, const std::vector<RobotRecording>& robots);
/// Writes ceiling/markers.yaml.
void writeMarkers(const std::string& folder, const MarkerSet& markers);

/// A csv file with its header line, one flushed row per call.
class CsvWriter {
 public:
  CsvWriter(std::string path, const std::string& header);
  void row(const std::string& line);
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::ofstream file_;
};

/// <folder>/<stream>/sensor.yaml, data.csv and data/<time>.png|jpg.
class ImageStreamWriter {
 public:
  /// `extension`: "png" (lossless) or "jpg" (quality 95).
  ImageStreamWriter(const std::string& folder, const std::string& stream, const lens::CameraModel& camera,
                    const std::string& extension = "png");
  void write(TimeNs time_ns, const cv::Mat& image);
  /// Writes a row with an empty file name, for a frame without pixels.
  void writeMissing(TimeNs time_ns);

 private:
  std::string folder_, extension_;
  CsvWriter csv_;
};

/// <folder>/<robot>/wheels/data.csv
class WheelsWriter {
 public:
  WheelsWriter(const std::string& folder, const std::string& robot);
  void write(const WheelRow& row);

 private:
  CsvWriter csv_;
};

/// <folder>/<robot>/observations.csv
class ObservationsWriter {
 public:
  ObservationsWriter(const std::string& folder, const std::string& robot);
  void write(const RangeBearingRow& row);

 private:
  CsvWriter csv_;
};

/// <folder>/<robot>/laser/sensor.yaml and data.csv
class LaserWriter {
 public:
  LaserWriter(const std::string& folder, const std::string& robot, const LaserSensor& sensor = {});
  void write(const LaserRow& row);

 private:
  CsvWriter csv_;
};

/// Write groundtruth/<robot>.tum, scene.geojson and room.geojson (not for an empty room), each as a whole.
void writeTruthTrajectory(const std::string& folder, const std::string& robot,
                          const std::vector<StampedPose>& poses);
void writeTruthScene(const std::string& folder, const std::vector<MapObject>& scene);
void writeTruthRoom(const std::string& folder, const Polygon& room);

}  // namespace omnifleet::dataset
