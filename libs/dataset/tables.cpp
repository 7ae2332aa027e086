// The csv files of a dataset: image lists, wheels, observations, laser.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>

#include "dataset/csv.h"
#include "dataset/dataset.h"
#include "dataset/image_names.h"

namespace omnifleet::dataset {
namespace {

using Fields = std::vector<std::string_view>;
/// Empty if `time_ns` is later than `latest_ns` (or equal, if allowed); `latest_ns` then becomes `time_ns`.
std::string checkOrder(TimeNs time_ns, bool equal_allowed, TimeNs& latest_ns) {
  if (time_ns < latest_ns || (time_ns == latest_ns && !equal_allowed)) {
    return fmt::format("time {} is not after the latest time {}", time_ns, latest_ns);
  }
  latest_ns = time_ns;
  return {};
}

/// Finds rows whose time is later than the times of each of the next kNext rows. Such a time is corrupt, not
/// the later ones. Otherwise one time too far ahead would reject all rows that follow.
class Ahead {
 public:
  Ahead(const std::string& path, const TimeColumn& column) {
    std::vector<std::string> ignored;
    std::vector<TimeNs> times;
    readRows(path, ',', ignored, [&](const Fields& fields) -> std::string {
      TimeNs time_ns = kNoTime;
      if (!column.parse(fields[0], time_ns)) time_ns = kNoTime;
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
  /// Call once per row, in file order.
  std::string problem() {
    if (!is_ahead_[next_++]) return {};
    return fmt::format("the time is later than the times of the next {} rows", kNext);
  }

 private:
  static constexpr std::ptrdiff_t kNext = 3;
  static constexpr TimeNs kNoTime = -1;
  std::vector<bool> is_ahead_;
  std::size_t next_ = 0;
};

std::string columns(std::size_t n, const char* names) {
  return fmt::format("expected the columns {}, got {} fields", names, n);
}

/// Parses a range of a laser scanner. No echo becomes +inf, in any spelling.
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

/// Full path of the file that a row of an image stream names. Files lie in `data/`; a name may begin with it.
/// @return what is wrong with the name; empty if nothing
std::string findImage(const std::filesystem::path& base, std::string_view name, std::string& path) {
  namespace fs = std::filesystem;
  if (name.empty()) return {};
  if (name.find('\\') != std::string_view::npos)
    return fmt::format("the file '{}' contains a backslash; write / between folder and name", name);
  const fs::path file = fs::path(std::string(name)).lexically_normal();
  if (file.is_absolute() || *file.begin() == "..")
    return "the file '" + file.string() + "' is outside the folder data";
  fs::path full = base / "data" / file;
  std::error_code ignored;
  if (*file.begin() == "data" && !fs::exists(full, ignored)) full = base / file;
  if (!file.has_extension() && !fs::exists(full, ignored)) {
    for (const std::string& extension : imageExtensions()) {
      if (fs::exists(full.string() + extension, ignored))
        return fmt::format("the file '{}' does not exist, but '{}{}' does; write the name with its extension",
                           name, name, extension);
    }
  }
  path = full.string();
  return {};
}

/// Reads a recorded table and warns if it is empty, because a stage that needs it would wait in vain.
void readRecorded(const std::string& path, std::vector<std::string>& warnings,
                  const std::function<std::string(const Fields&)>& row) {
  bool any = false;
  readRows(path, ',', warnings, [&](const Fields& fields) {
    any = true;
    return row(fields);
  });
  if (!any) warnings.push_back(path + ": contains no row");
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
  const TimeColumn column((base / "data.csv").string());
  Ahead ahead((base / "data.csv").string(), column);
  readRecorded((base / "data.csv").string(), warnings, [&](const Fields& fields) -> std::string {
    ImageRow row;
    row.sequence = sequence++;
    const std::string broken = ahead.problem();
    if (fields.size() != 2) return columns(fields.size(), "timestamp [ns],filename");
    if (!column.parse(fields[0], row.time_ns)) return column.rule();
    if (!broken.empty()) return broken;
    if (std::string problem = findImage(base, fields[1], row.path); !problem.empty()) return problem;
    stream.rows.push_back(std::move(row));
    return {};
  });
  return stream;
}

std::vector<WheelRow> readWheels(const std::string& path, std::vector<std::string>& warnings) {
  std::vector<WheelRow> rows;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  const TimeColumn column(path);
  Ahead ahead(path, column);
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    WheelRow row;
    const std::string broken = ahead.problem();
    if (fields.size() != 3) return columns(fields.size(), "timestamp [ns],v_left [m s^-1],v_right [m s^-1]");
    if (!column.parse(fields[0], row.time_ns)) return column.rule();
    if (!parseNumber(fields[1], row.left_mps) || !parseNumber(fields[2], row.right_mps)) {
      return "wheel speeds must be finite numbers";
    }
    if (std::max(std::abs(row.left_mps), std::abs(row.right_mps)) > kMaxWheelSpeedMps) {
      return fmt::format("wheel speeds must be within ±{} m/s", kMaxWheelSpeedMps);
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
  const TimeColumn column(path);
  Ahead ahead(path, column);
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    RangeBearingRow row;
    const std::string broken = ahead.problem();
    if (fields.size() != 4) return columns(fields.size(), "timestamp [ns],id,range [m],bearing [rad]");
    if (!column.parse(fields[0], row.time_ns)) return column.rule();
    row.id = std::string(fields[1]);
    if (row.id.empty()) return "the id is empty";
    if (row.id == robot) return "the robot '" + robot + "' cannot observe itself";
    if (!parseNumber(fields[2], row.range_m) || !parseNumber(fields[3], row.bearing_rad)) {
      return "range and bearing must be finite numbers";
    }
    if (row.range_m <= 0.0 || row.range_m > kMaxObservedRange_m) {
      return fmt::format("the range must be above 0 and at most {:g} m", kMaxObservedRange_m);
    }
    ++bearings;
    if (std::abs(row.bearing_rad) > 2.0 * M_PI) {
      ++wide;
      return fmt::format("the bearing must be within ±2π rad; {:g} looks like degrees", row.bearing_rad);
    }
    if (!broken.empty()) return broken;
    if (std::string problem = checkOrder(row.time_ns, true, latest_ns); !problem.empty()) return problem;
    for (auto at = rows.rbegin(); at != rows.rend() && at->time_ns == row.time_ns; ++at) {
      if (at->id == row.id)
        return "'" + row.id + "' is observed twice at the same time; the first row is used";
    }
    row.bearing_rad = wrapAngle(row.bearing_rad);
    rows.push_back(std::move(row));
    return {};
  });
  // A file in degrees also has bearings that look like radians. So a share decides.
  if (3 * wide > bearings) {
    throw options::Error(fmt::format("{}: {} of {} bearings are beyond ±2π; bearings must be in radians",
                                     path, wide, bearings));
  }
  return rows;
}

std::vector<LaserRow> readLaser(const std::string& path, std::vector<std::string>& warnings) {
  std::vector<LaserRow> rows;
  TimeNs latest_ns = std::numeric_limits<TimeNs>::min();
  const TimeColumn column(path);
  Ahead ahead(path, column);
  readRecorded(path, warnings, [&](const Fields& fields) -> std::string {
    LaserRow row;
    const std::string broken = ahead.problem();
    if (fields.size() < 4) {
      return columns(fields.size(), "timestamp [ns],angle_min [rad],angle_increment [rad],ranges [m]…");
    }
    if (!column.parse(fields[0], row.time_ns)) return column.rule();
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
