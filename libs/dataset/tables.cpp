// The csv files of a dataset: image lists, wheels, observations, laser.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

#include "dataset/csv.h"
#include "dataset/dataset.h"

namespace omnifleet::dataset {
namespace {

using Fields = std::vector<std::string_view>;
constexpr const char* kBadTime = "the timestamp must be a whole number of nanoseconds, not below 0";

/// Of a recording: no clock of one runs before its epoch, such a time is a broken number.
bool parseStamp(std::string_view field, TimeNs& value) {
  return parseTime(field, value) && value >= 0;
}

/// Empty when `time_ns` is later than `latest_ns` (or equal, where that is allowed), which it then becomes.
std::string checkOrder(TimeNs time_ns, bool equal_allowed, TimeNs& latest_ns) {
  if (time_ns < latest_ns || (time_ns == latest_ns && !equal_allowed)) {
    return fmt::format("time {} is not after {}, the latest before it", time_ns, latest_ns);
  }
  latest_ns = time_ns;
  return {};
}

/// Rows, counted from 0, whose time lies after that of each of the next few: it, not theirs, is broken. Else
/// one time too far ahead would throw away all that follows.
class Ahead {
 public:
  explicit Ahead(const std::string& path) {
    std::vector<std::string> told_later;
    std::vector<TimeNs> times;
    readRows(path, ',', told_later, [&](const Fields& fields) -> std::string {
      TimeNs time_ns = kNoTime;
      if (!parseStamp(fields[0], time_ns)) time_ns = kNoTime;
      times.push_back(time_ns);
      return {};
    });
    is_ahead_.assign(times.size(), false);
    std::vector<std::size_t> good;
    for (std::size_t i = 0; i < times.size(); ++i)
      if (times[i] != kNoTime) good.push_back(i);
    for (std::size_t k = 0; k + kNext < good.size(); ++k) {
      const auto first = good.begin() + static_cast<std::ptrdiff_t>(k);
      is_ahead_[good[k]] = std::all_of(first + 1, first + 1 + kNext,
                                       [&](std::size_t next) { return times[next] < times[good[k]]; });
    }
  }
  /// To be asked once for each row, in their order.
  std::string problem() {
    if (!is_ahead_[next_++]) return {};
    return fmt::format("its time is after that of the next {} rows", kNext);
  }

 private:
  static constexpr std::ptrdiff_t kNext = 3;
  static constexpr TimeNs kNoTime = -1;
  std::vector<bool> is_ahead_;
  std::size_t next_ = 0;
};

std::string columns(std::size_t n, const char* names) {
  return fmt::format("expected the columns {}, here are {} fields", names, n);
}

/// A range as laser scanners report it: no echo is +inf, however it is spelt.
bool parseRange(std::string_view field, float& range_m) {
  double value = 0.0;
  if (parseNumber(field, value)) {
    range_m = value > 0.0 ? static_cast<float>(value) : std::numeric_limits<float>::infinity();
    return true;
  }
  range_m = std::numeric_limits<float>::infinity();
  const std::string_view text = trim(field);
  return text == "inf" || text == "+inf" || text == "Inf" || text == "nan" || text == "NaN" || text == "-nan";
}

/// A recorded table: that it is empty is worth a warning, for whoever needs it will wait in vain.
void readRecorded(const std::string& path, std::vector<std::string>& warnings,
                  const std::function<std::string(const Fields&)>& row) {
  bool any = false;
  readRows(path, ',', warnings, [&](const Fields& fields) {
    any = true;
    return row(fields);
  });
  if (!any) warnings.push_back(path + ": holds no row");
}

}  // namespace

ImageStream readImageStream(const std::string& folder, const std::string& name,
                            std::vector<std::string>& warnings) {
  namespace fs = std::filesystem;
  ImageStream stream;
  stream.name = name;
  const fs::path base = fs::path(folder) / name;
  stream.camera = lens::CameraModel::load((base / "sensor.yaml").string());
  std::uint32_t sequence = 0;
  Ahead ahead((base / "data.csv").string());
  readRecorded((base / "data.csv").string(), warnings, [&](const Fields& fields) -> std::string {
    ImageRow row;
    row.sequence = sequence++;
    const std::string broken = ahead.problem();
    if (fields.size() != 2) return columns(fields.size(), "timestamp [ns],filename");
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
    if (!broken.empty()) return broken;
    const fs::path file = fs::path(std::string(fields[1])).lexically_normal();
    if (file.is_absolute() || (!file.empty() && *file.begin() == ".."))
      return "the file '" + file.string() + "' lies outside of the folder data";
    if (!file.empty()) row.path = (base / "data" / file).string();
    stream.rows.push_back(std::move(row));
    return {};
  });
  return stream;
}

std::vector<WheelRow> readWheels(const std::string& path, std::vector<std::string>& warnings) {
  std::vector<WheelRow> rows;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  Ahead ahead(path);
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    WheelRow row;
    const std::string broken = ahead.problem();
    if (fields.size() != 3) return columns(fields.size(), "timestamp [ns],v_left [m s^-1],v_right [m s^-1]");
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
    if (!parseNumber(fields[1], row.left_mps) || !parseNumber(fields[2], row.right_mps)) {
      return "wheel speeds must be finite numbers";
    }
    if (std::max(std::abs(row.left_mps), std::abs(row.right_mps)) > kMaxWheelSpeedMps) {
      return fmt::format("wheel speeds must lie within ±{} m/s", kMaxWheelSpeedMps);
    }
    if (!broken.empty()) return broken;
    if (std::string problem = checkOrder(row.time_ns, false, latest_ns); !problem.empty()) return problem;
    rows.push_back(row);
    return {};
  });
  return rows;
}

std::vector<RangeBearingRow> readObservations(const std::string& path, const std::string& robot,
                                              std::vector<std::string>& warnings) {
  std::vector<RangeBearingRow> rows;
  std::size_t bearings = 0, wide = 0;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  Ahead ahead(path);
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    RangeBearingRow row;
    const std::string broken = ahead.problem();
    if (fields.size() != 4) return columns(fields.size(), "timestamp [ns],id,range [m],bearing [rad]");
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
    row.id = std::string(fields[1]);
    if (row.id.empty()) return "the id is empty";
    if (row.id == robot) return "the robot '" + robot + "' cannot sight itself";
    if (!parseNumber(fields[2], row.range_m) || !parseNumber(fields[3], row.bearing_rad)) {
      return "range and bearing must be finite numbers";
    }
    if (row.range_m <= 0.0 || row.range_m > kMaxObservedRange_m) {
      return fmt::format("the range must be above 0, up to {:g} m", kMaxObservedRange_m);
    }
    ++bearings;
    if (std::abs(row.bearing_rad) > 2.0 * M_PI) {
      ++wide;
      return fmt::format("the bearing must lie within ±2π rad, {:g} looks like degrees", row.bearing_rad);
    }
    if (!broken.empty()) return broken;
    if (std::string problem = checkOrder(row.time_ns, true, latest_ns); !problem.empty()) return problem;
    for (auto at = rows.rbegin(); at != rows.rend() && at->time_ns == row.time_ns; ++at) {
      if (at->id == row.id) return "'" + row.id + "' is sighted twice at one time, the first row counts";
    }
    row.bearing_rad = wrapAngle(row.bearing_rad);
    rows.push_back(std::move(row));
    return {};
  });
  // What is left of a file in degrees looks like radians.
  if (3 * wide > bearings) {
    throw options::Error(fmt::format("{}: {} of {} bearings lie beyond ±2π: they must be given in radians",
                                     path, wide, bearings));
  }
  return rows;
}

std::vector<LaserRow> readLaser(const std::string& path, std::vector<std::string>& warnings) {
  std::vector<LaserRow> rows;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  Ahead ahead(path);
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    LaserRow row;
    const std::string broken = ahead.problem();
    if (fields.size() < 4) {
      return columns(fields.size(), "timestamp [ns],angle_min [rad],angle_increment [rad],ranges [m]…");
    }
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
    if (!parseNumber(fields[1], row.angle_min_rad) || !parseNumber(fields[2], row.angle_increment_rad)) {
      return "angle_min and angle_increment must be finite numbers, the increment not 0";
    }
    row.range_m.reserve(fields.size() - 3);
    for (std::size_t i = 3; i < fields.size(); ++i) {
      float range_m = 0.0f;
      if (!parseRange(fields[i], range_m)) return fmt::format("range {} is not a number", i - 3);
      row.range_m.push_back(range_m);
    }
    const std::size_t beams = rows.empty() ? 0 : rows.front().range_m.size();
    if (std::string problem = problemOf(row, beams); !problem.empty()) return problem;
    if (!broken.empty()) return broken;
    if (std::string problem = checkOrder(row.time_ns, false, latest_ns); !problem.empty()) return problem;
    rows.push_back(std::move(row));
    return {};
  });
  return rows;
}

}  // namespace omnifleet::dataset
