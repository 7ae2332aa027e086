#pragma once

#include <string>
#include <vector>

#include "dataset/writer.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

/// Classification of a visible track by one robot in one frame: a row of OUT/tracks/<robot>.csv. `evaluate`
/// scores robots against obstacles with it.
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
  /// Writes the visible tracks of one frame.
  void write(const Objects& objects);

 private:
  CsvWriter csv_;
};

/// Malformed rows are ignored and listed in `warnings`. Throws options::Error when the file cannot be read.
std::vector<TrackRow> readTracks(const std::string& path, std::vector<std::string>& warnings);

}  // namespace omnifleet::dataset
