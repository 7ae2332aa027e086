#include "dataset/trajectory_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dataset/atomic_file.h"
#include "dataset/csv.h"
#include "options/options.h"

namespace omnifleet::dataset {
namespace {

using Fields = std::vector<std::string_view>;

/// Avoids "−0.000000000", which would make the bytes of equal poses differ.
std::string fixed(double value) {
  std::string text = fmt::format("{:.9f}", value);
  return text == "-0.000000000" ? "0.000000000" : text;
}

std::string parsePose(const Fields& fields, StampedPose3& pose) {
  if (fields.size() < 8)
    return fmt::format("expected 8 values: timestamp tx ty tz qx qy qz qw, got {}", fields.size());
  if (!parseSeconds(fields[0], pose.time_ns)) return "the timestamp must be a number of seconds";
  double v[7];
  for (std::size_t i = 0; i < 7; ++i) {
    if (!parseNumber(fields[i + 1], v[i])) return "position and quaternion must be finite numbers";
  }
  pose.position_m = {v[0], v[1], v[2]};
  pose.orientation = Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double norm = pose.orientation.norm();
  if (!(norm > 1e-6)) return "the quaternion is zero";
  pose.orientation.coeffs() /= norm;
  return {};
}

bool numbers(const Fields& fields, std::size_t first, std::size_t count, double* out) {
  if (fields.size() < first + count) return false;
  for (std::size_t i = 0; i < count; ++i) {
    if (!parseNumber(fields[first + i], out[i])) return false;
  }
  return true;
}

/// Finds the value with this name. Returns the problem, which lists the valid names, or an empty string.
template <typename Names, typename Value>
std::string parseName(std::string_view field, const char* what, const Names& values, Value& value) {
  const auto* const at =
      std::find_if(values.begin(), values.end(), [&](Value one) { return field == toString(one); });
  if (at != values.end()) {
    value = *at;
    return {};
  }
  std::string names;
  for (const Value one : values) names += std::string(names.empty() ? "" : ", ") + toString(one);
  return fmt::format("the {} must be one of {}", what, names);
}

constexpr std::string_view kNoSources = "none";

/// Names joined by '+', or "none". Returns the problem, or an empty string.
std::string parseSources(std::string_view field, SourceSet& sources) {
  sources = {};
  if (field == kNoSources) return {};
  while (true) {
    const std::size_t end = field.find('+');
    Source source{};
    std::string problem = parseName(field.substr(0, end), "source", kSources, source);
    if (!problem.empty() || end == std::string_view::npos) {
      if (problem.empty()) sources.add(source);
      return problem;
    }
    sources.add(source);
    field.remove_prefix(end + 1);
  }
}

std::string sourcesText(SourceSet sources) {
  std::string text;
  for (const Source source : kSources)
    if (sources.has(source)) text += (text.empty() ? "" : "+") + std::string(toString(source));
  return text.empty() ? std::string(kNoSources) : text;
}

std::string parseLocalization(const Fields& fields, StampedLocalization& row) {
  constexpr double kMaxCorrection = 1e9;  // σ
  if (fields.size() != 4 && fields.size() != 6)
    return fmt::format(
        "expected 6 values: timestamp [ns],state,event,correction [sigma],used,rejected, got {}",
        fields.size());
  if (!parseTime(fields[0], row.time_ns)) return "the timestamp must be whole nanoseconds";
  std::string problem = parseName(fields[1], "state", kLocalizationStates, row.state);
  if (problem.empty()) problem = parseName(fields[2], "event", kPoseEvents, row.event);
  if (!problem.empty()) return problem;
  if (!parseNumber(fields[3], row.correction_sigmas) || row.correction_sigmas < 0.0 ||
      row.correction_sigmas > kMaxCorrection)
    return fmt::format("the correction must be between 0 and {:g} sigma", kMaxCorrection);
  if (fields.size() == 4) return {};
  problem = parseSources(fields[4], row.used);
  return problem.empty() ? parseSources(fields[5], row.rejected) : problem;
}

std::string parseVertex(const Fields& fields, G2oGraph& graph) {
  double v[4];
  if (!numbers(fields, 1, 4, v)) return "expected VERTEX_SE2 id x y θ";
  graph.vertices.push_back({static_cast<int>(v[0]), Pose2{v[1], v[2], wrapAngle(v[3])}});
  return {};
}

std::string parseEdge(const Fields& fields, G2oGraph& graph) {
  double v[11];
  if (!numbers(fields, 1, 11, v))
    return "expected EDGE_SE2 from to x y θ and 6 values of the information matrix";
  G2oEdge edge{static_cast<int>(v[0]), static_cast<int>(v[1]), Pose2{v[2], v[3], wrapAngle(v[4])}, {}};
  edge.information << v[5], v[6], v[7], v[6], v[8], v[9], v[7], v[9], v[10];
  graph.edges.push_back(edge);
  return {};
}

}  // namespace

StampedPose StampedPose3::flat() const {
  const Eigen::Vector3d forward = orientation * Eigen::Vector3d::UnitX();
  return {time_ns, Pose2{position_m.x(), position_m.y(), std::atan2(forward.y(), forward.x())}};
}

std::string tumText(const std::vector<StampedPose>& poses) {
  std::string text;
  for (const StampedPose& pose : poses) {
    const Pose2& p = pose.map_from_base;
    const bool negative = pose.time_ns < 0;
    const auto time =
        negative ? 0 - static_cast<std::uint64_t>(pose.time_ns) : static_cast<std::uint64_t>(pose.time_ns);
    text += fmt::format("{}{}.{:09} {} {} 0 0 0 {} {}\n", negative ? "-" : "", time / 1000000000,
                        time % 1000000000, fixed(p.x_m), fixed(p.y_m), fixed(std::sin(0.5 * p.theta_rad)),
                        fixed(std::cos(0.5 * p.theta_rad)));
  }
  return text;
}

void writeTum(const std::string& path, const std::vector<StampedPose>& poses) {
  writeAtomic(path, tumText(poses));
}

std::vector<StampedPose3> readTum(const std::string& path, std::vector<std::string>* warnings) {
  std::vector<StampedPose3> poses;
  std::vector<std::string> local;
  readRows(path, ' ', warnings ? *warnings : local, [&](const Fields& fields) {
    StampedPose3 pose;
    std::string problem = parsePose(fields, pose);
    if (problem.empty()) poses.push_back(pose);
    return problem;
  });
  return poses;
}

std::vector<StampedPose> flat(const std::vector<StampedPose3>& poses) {
  std::vector<StampedPose> result;
  result.reserve(poses.size());
  for (const StampedPose3& pose : poses) result.push_back(pose.flat());
  return result;
}

void writeCovariances(const std::string& path, const std::vector<StampedCovariance>& rows) {
  std::string text = "#timestamp [ns],xx [m^2],xy [m^2],xt [m rad],yy [m^2],yt [m rad],tt [rad^2],datum\n";
  for (const StampedCovariance& row : rows) {
    const Eigen::Matrix3d& c = row.covariance;
    text += fmt::format("{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{}\n", row.time_ns, c(0, 0), c(0, 1),
                        c(0, 2), c(1, 1), c(1, 2), c(2, 2), row.datum);
  }
  writeAtomic(path, text);
}

std::vector<StampedCovariance> readCovariances(const std::string& path, std::vector<std::string>* warnings) {
  std::vector<StampedCovariance> rows;
  std::vector<std::string> local;
  readRows(path, ',', warnings ? *warnings : local, [&](const Fields& fields) -> std::string {
    StampedCovariance row;
    double v[7];
    if (fields.empty() || !parseTime(fields[0], row.time_ns))
      return "the timestamp must be whole nanoseconds";
    if (!numbers(fields, 1, 7, v) || v[6] < 0 || v[6] > 4e9)
      return "expected 6 numbers of a covariance and its datum after the timestamp";
    row.datum = static_cast<std::uint32_t>(v[6]);
    row.covariance << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
    rows.push_back(row);
    return {};
  });
  return rows;
}

void writeLocalization(const std::string& path, const std::vector<StampedLocalization>& rows) {
  std::string text = "#timestamp [ns],state,event,correction [sigma],used,rejected\n";
  for (const StampedLocalization& row : rows)
    text += fmt::format("{},{},{},{:.9g},{},{}\n", row.time_ns, toString(row.state), toString(row.event),
                        row.correction_sigmas, sourcesText(row.used), sourcesText(row.rejected));
  writeAtomic(path, text);
}

std::vector<StampedLocalization> readLocalization(const std::string& path,
                                                  std::vector<std::string>* warnings) {
  std::vector<StampedLocalization> rows;
  std::vector<std::string> local;
  readRows(path, ',', warnings ? *warnings : local, [&](const Fields& fields) {
    StampedLocalization row;
    std::string problem = parseLocalization(fields, row);
    if (problem.empty()) rows.push_back(row);
    return problem;
  });
  return rows;
}

void writeG2o(const std::string& path, const G2oGraph& graph) {
  std::string text;
  const auto pose = [](const Pose2& p) {
    return fmt::format("{} {} {}", fixed(p.x_m), fixed(p.y_m), fixed(p.theta_rad));
  };
  for (const G2oVertex& vertex : graph.vertices)
    text += fmt::format("VERTEX_SE2 {} {}\n", vertex.id, pose(vertex.pose));
  for (const G2oEdge& edge : graph.edges) {
    const Eigen::Matrix3d& i = edge.information;
    text += fmt::format("EDGE_SE2 {} {} {} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g}\n", edge.from, edge.to,
                        pose(edge.from_from_to), i(0, 0), i(0, 1), i(0, 2), i(1, 1), i(1, 2), i(2, 2));
  }
  writeAtomic(path, text);
}

G2oGraph readG2o(const std::string& path) {
  G2oGraph graph;
  std::vector<std::string> problems;
  readRows(path, ' ', problems, [&](const Fields& fields) -> std::string {
    if (fields[0] == "VERTEX_SE2") return parseVertex(fields, graph);
    if (fields[0] == "EDGE_SE2") return parseEdge(fields, graph);
    return {};
  });
  if (!problems.empty()) throw std::runtime_error(problems.front());
  return graph;
}

}  // namespace omnifleet::dataset
