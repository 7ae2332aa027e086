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

/// One line of `data.csv` of an image stream. Rows stay in file order, bad times and all.
struct ImageRow {
  TimeNs time_ns = 0;
  std::uint32_t sequence = 0;  ///< index of the row in data.csv (rejected rows are counted too)
  std::string path;            ///< full path of the image; empty where the file names none (a missing frame)
};

struct ImageStream {
  std::string name;  ///< "r1/fisheye", "r1/front", "ceiling/c1"
  lens::CameraModel camera;
  std::vector<ImageRow> rows;
};

/// Faster than any robot of this kind; a speed beyond it is a broken number.
constexpr double kMaxWheelSpeedMps = 20.0;
constexpr double kMaxObservedRange_m = 1000.0;  ///< farther off is a broken number

struct WheelRow {
  TimeNs time_ns = 0;
  double left_mps = 0.0, right_mps = 0.0;  ///< held until the next row
};

/// A detection where a data set has no images: of a landmark or of another robot (its name).
struct RangeBearingRow {
  TimeNs time_ns = 0;
  std::string id;
  double range_m = 0.0, bearing_rad = 0.0;
};

inline constexpr double kFarthestStart_m =
    1000.0;  ///< of an `initial_pose` from the map's origin, along x and y

struct RobotRecording {
  std::string name;
  std::optional<Pose2> initial_pose;  ///< map_from_base at the first time
  RobotBody body;
  std::optional<ImageStream> fisheye, front;
  std::vector<WheelRow> wheels;               ///< strictly increasing in time
  std::vector<RangeBearingRow> observations;  ///< not decreasing in time
  std::vector<LaserRow> laser;                ///< strictly increasing in time
  LaserSensor laser_sensor;                   ///< the default where laser/sensor.yaml is missing
};

/// Everything of a recording that the pipeline may see; images are only listed (see frame_source.h), truth is
/// not here (ground_truth.h, for `evaluate` alone).
struct Dataset {
  std::string folder;
  std::vector<RobotRecording> robots;  ///< sorted by name
  std::vector<ImageStream> ceiling;    ///< sorted by name
  std::optional<MarkerSet> markers;
  std::vector<Landmark> landmarks;    ///< surveyed ones (landmarks.yaml), by name
  std::vector<std::string> warnings;  ///< one line per rejected row: FILE:LINE: why

  /// Reads dataset.yaml, sensor.yaml, markers.yaml, landmarks.yaml and all csv files. Throws options::Error
  /// for a bad YAML file, a missing folder or file, a csv without a single good row where rows are; the
  /// message names file, line and what to do. Rows with non-finite or malformed numbers are left out and
  /// listed in `warnings`.
  static Dataset open(const std::string& folder);

  /// Null where there is none.
  const RobotRecording* findRobot(const std::string& name) const;
  /// By stream name, "r1/fisheye" or "ceiling/c1". Null where there is none.
  const ImageStream* findStream(const std::string& name) const;
};

/// The single files, for tools and tests. `warnings` is appended to.
ImageStream readImageStream(const std::string& folder, const std::string& name,
                            std::vector<std::string>& warnings);
std::vector<WheelRow> readWheels(const std::string& path, std::vector<std::string>& warnings);
std::vector<RangeBearingRow> readObservations(const std::string& path, const std::string& robot,
                                              std::vector<std::string>& warnings);
std::vector<LaserRow> readLaser(const std::string& path, std::vector<std::string>& warnings);

}  // namespace omnifleet::dataset
