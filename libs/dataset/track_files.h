#pragma once

#include <string>
#include <vector>

#include "dataset/writer.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

/// What one robot took a visible track for in one frame: a row of OUT/tracks/<robot>.csv, which lets
/// `evaluate` score robots against obstacles.
struct TrackRow {
  TimeNs time_ns = 0;
  std::uint32_t track = 0;
  ObjectKind kind = ObjectKind::kUnknown;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< footprint centre in base_link at that time
};

/// Writes OUT/tracks/<robot>.csv.
class TracksWriter {
 public:
  TracksWriter(const std::string& out, const std::string& robot);
  /// The visible tracks of one frame.
  void write(const Objects& objects);

 private:
  CsvWriter csv_;
};

/// Malformed rows are left out and listed in `warnings`. Throws options::Error when it cannot be read.
std::vector<TrackRow> readTracks(const std::string& path, std::vector<std::string>& warnings);

}  // namespace omnifleet::dataset
