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
  readRecorded((base / "data.csv").string(), warnings, [&](const Fields& fields) -> std::string {
    ImageRow row;
    row.sequence = sequence++;
    if (fields.size() != 2) return columns(fields.size(), "timestamp [ns],filename");
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
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
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    WheelRow row;
    if (fields.size() != 3) return columns(fields.size(), "timestamp [ns],v_left [m s^-1],v_right [m s^-1]");
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
    if (!parseNumber(fields[1], row.left_mps) || !parseNumber(fields[2], row.right_mps)) {
      return "wheel speeds must be finite numbers";
    }
    if (std::max(std::abs(row.left_mps), std::abs(row.right_mps)) > kMaxWheelSpeedMps) {
      return fmt::format("wheel speeds must lie within ±{} m/s", kMaxWheelSpeedMps);
    }
    if (std::string problem = checkOrder(row.time_ns, false, latest_ns); !problem.empty()) return problem;
    rows.push_back(row);
    return {};
  });
  return rows;
}

std::vector<RangeBearingRow> readObservations(const std::string& path, const std::string& robot,
                                              std::vector<std::string>& warnings) {
  std::vector<RangeBearingRow> rows;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    RangeBearingRow row;
    if (fields.size() != 4) return columns(fields.size(), "timestamp [ns],id,range [m],bearing [rad]");
    if (!parseStamp(fields[0], row.time_ns)) return kBadTime;
    row.id = std::string(fields[1]);
    if (row.id.empty()) return "the id is empty";
    if (row.id == robot) return "the robot '" + robot + "' cannot sight itself";
    if (!parseNumber(fields[2], row.range_m) || !parseNumber(fields[3], row.bearing_rad)) {
      return "range and bearing must be finite numbers";
    }
    if (row.range_m < 0.0 || row.range_m > kMaxObservedRange_m) {
      return fmt::format("the range must lie within 0 and {:g} m", kMaxObservedRange_m);
    }
    if (std::abs(row.bearing_rad) > 2.0 * M_PI) {
      return fmt::format("the bearing must lie within ±2π rad, {:g} looks like degrees", row.bearing_rad);
    }
    if (std::string problem = checkOrder(row.time_ns, true, latest_ns); !problem.empty()) return problem;
    for (auto at = rows.rbegin(); at != rows.rend() && at->time_ns == row.time_ns; ++at) {
      if (at->id == row.id) return "'" + row.id + "' is sighted twice at one time, the first row counts";
    }
    row.bearing_rad = wrapAngle(row.bearing_rad);
    rows.push_back(std::move(row));
    return {};
  });
  return rows;
}

std::vector<LaserRow> readLaser(const std::string& path, std::vector<std::string>& warnings) {
  std::vector<LaserRow> rows;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    LaserRow row;
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
    if (std::string problem = checkOrder(row.time_ns, false, latest_ns); !problem.empty()) return problem;
    rows.push_back(std::move(row));
    return {};
  });
  return rows;
}

}  // namespace omnifleet::dataset
