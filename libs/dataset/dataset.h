#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/landmarks.h"
#include "dataset/laser.h"
#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "lens/camera.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

/// One line of `data.csv` of an image stream. Rows stay in file order, including rows with invalid times.
struct ImageRow {
  TimeNs time_ns = 0;
  std::uint32_t sequence = 0;  ///< index of the row in data.csv, counting rejected rows
  std::string path;  ///< full path of the image; empty if the row has no file name (a missing frame)
};

struct ImageStream {
  std::string name;  ///< "r1/fisheye", "r1/front", "ceiling/c1"
  lens::CameraModel camera;
  std::vector<ImageRow> rows;
};

/// Limits beyond which a wheel speed or a range is a corrupt number. No robot of this kind is that fast.
constexpr double kMaxWheelSpeedMps = 20.0;
constexpr double kMaxObservedRange_m = 1000.0;  ///< maximum range of an observation

struct WheelRow {
  TimeNs time_ns = 0;
  double left_mps = 0.0, right_mps = 0.0;  ///< valid until the next row
};

/// Detection of a landmark or of another robot (by its name), for datasets without images.
struct RangeBearingRow {
  TimeNs time_ns = 0;
  std::string id;
  double range_m = 0.0, bearing_rad = 0.0;
};

inline constexpr double kFarthestInitialPose_m =
    1000.0;  ///< limit of an `initial_pose` from the origin of the map, along x and y

struct RobotRecording {
  std::string name;
  std::optional<Pose2> initial_pose;  ///< map_from_base at the first timestamp
  RobotBody body;
  std::optional<ImageStream> fisheye, front;
  std::vector<WheelRow> wheels;               ///< strictly increasing in time
  std::vector<RangeBearingRow> observations;  ///< non-decreasing in time
  std::vector<LaserRow> laser;                ///< strictly increasing in time
  LaserSensor laser_sensor;                   ///< default values if laser/sensor.yaml does not exist
};

/// The data of a recording that the pipeline may use. Images are only listed (frame_source.h). Ground truth
/// is separate (ground_truth.h, for `evaluate` only).
struct Dataset {
  std::string folder;
  std::vector<RobotRecording> robots;  ///< sorted by name
  std::vector<ImageStream> ceiling;    ///< sorted by name
  std::optional<MarkerSet> markers;
  std::vector<Landmark> landmarks;    ///< surveyed landmarks (landmarks.yaml), sorted by name
  std::vector<std::string> warnings;  ///< one line per rejected row: "FILE:LINE: problem"

  /// Reads dataset.yaml, sensor.yaml, markers.yaml, landmarks.yaml and all csv files. Throws options::Error
  /// for an invalid YAML file, a missing folder or file, or a csv that has rows but no valid one. The message
  /// names file, line and what to do. Rows with non-finite or malformed numbers are ignored and listed in
  /// `warnings`.
  static Dataset open(const std::string& folder);

  /// Null if there is no such robot.
  const RobotRecording* findRobot(const std::string& name) const;
  /// By stream name, "r1/fisheye" or "ceiling/c1". Null if there is no such stream.
  const ImageStream* findStream(const std::string& name) const;
};

/// Readers of single files, for tools and tests. They append to `warnings`.
ImageStream readImageStream(const std::string& folder, const std::string& name,
                            std::vector<std::string>& warnings);
std::vector<WheelRow> readWheels(const std::string& path, std::vector<std::string>& warnings);
std::vector<RangeBearingRow> readObservations(const std::string& path, const std::string& robot,
                                              std::vector<std::string>& warnings);
std::vector<LaserRow> readLaser(const std::string& path, std::vector<std::string>& warnings);

}  // namespace omnifleet::dataset
