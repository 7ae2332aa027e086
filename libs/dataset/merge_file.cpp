#include "dataset/merge_file.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/atomic_file.h"

namespace omnifleet::dataset {
namespace {

using MergeJson = nlohmann::ordered_json;

/// Millionths, without a negative zero.
double inMillionths(double value) {
  return std::round(value * 1e6) / 1e6 + 0.0;
}

MergeJson toJson(const RobotMerge& robot) {
  MergeJson json{
      {"status", toString(robot.status)}, {"frame", nullptr}, {"reason", robot.reason}, {"score", nullptr},
      {"map_from_frame", nullptr},        {"sigma", nullptr}, {"time_s", nullptr}};
  if (!robot.frame.empty()) json["frame"] = robot.frame;
  if (robot.score) json["score"] = inMillionths(*robot.score);
  if (robot.map_from_frame) {
    const Pose2& pose = *robot.map_from_frame;
    json["map_from_frame"] = {inMillionths(pose.x_m), inMillionths(pose.y_m), inMillionths(pose.theta_rad)};
  }
  if (robot.sigma) json["sigma"] = {inMillionths(robot.sigma->x()), inMillionths(robot.sigma->y())};
  if (robot.time_s) json["time_s"] = *robot.time_s;
  return json;
}

AlignmentStatus statusOf(const std::string& text) {
  for (const AlignmentStatus status : {AlignmentStatus::kAnchored, AlignmentStatus::kMatched,
                                       AlignmentStatus::kRefused, AlignmentStatus::kUndecided})
    if (text == toString(status)) return status;
  throw std::runtime_error("unknown status '" + text + "'");
}

RobotMerge robotFrom(const MergeJson& json) {
  RobotMerge robot;
  robot.status = statusOf(json.at("status").get<std::string>());
  if (const MergeJson& frame = json.at("frame"); !frame.is_null()) robot.frame = frame.get<std::string>();
  robot.reason = json.value("reason", "");
  const auto given = [&](const char* key) { return json.contains(key) && !json[key].is_null(); };
  if (given("score")) robot.score = json["score"].get<double>();
  if (given("map_from_frame")) {
    const auto pose = json["map_from_frame"].get<std::array<double, 3>>();
    robot.map_from_frame = Pose2{pose[0], pose[1], pose[2]};
  }
  if (given("sigma")) {
    const auto sigma = json["sigma"].get<std::array<double, 2>>();
    robot.sigma = Eigen::Vector2d(sigma[0], sigma[1]);
  }
  if (given("time_s")) robot.time_s = json["time_s"].get<double>();
  return robot;
}

}  // namespace

std::string mergeText(const MergeReport& report) {
  MergeJson robots = MergeJson::object();
  for (const auto& [name, robot] : report) robots[name] = toJson(robot);
  // A reason that was cut within a character is still written.
  constexpr auto kReplace = MergeJson::error_handler_t::replace;
  return MergeJson{{"robots", robots}}.dump(2, ' ', false, kReplace) + "\n";
}

void writeMerge(const std::string& path, const MergeReport& report) {
  writeAtomic(path, mergeText(report));
}

MergeReport readMerge(const std::string& path) {
  MergeReport report;
  const std::string text = readFile(path);
  std::string at = "robots";
  try {
    const MergeJson json = MergeJson::parse(text);
    for (const auto& [name, robot] : json.at("robots").items()) {
      at = name;
      report[name] = robotFrom(robot);
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}: {}", path, at, error.what()));
  }
  return report;
}

}  // namespace omnifleet::dataset
