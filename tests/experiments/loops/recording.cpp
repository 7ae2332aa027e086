#include "tests/experiments/loops/recording.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "dataset/ground_truth.h"
#include "local_mapper/appearance_source.h"
#include "local_mapper/local_mapper.h"

namespace omnifleet::loops {
namespace {

constexpr std::size_t kFewestLines = 60;  // as of a keyframe

std::string kindOf(const std::string& folder) {
  std::ifstream file(folder + "/groundtruth/pair.json");
  return file ? nlohmann::json::parse(file).at("kind").get<std::string>() : "loop";
}

/// The folder that names a recording: seed_7 of seed_7/recording.
std::string nameOf(const std::string& folder) {
  const std::filesystem::path path = std::filesystem::path(folder + "/").parent_path();
  return (path.filename() == "recording" ? path.parent_path() : path).filename().string();
}

}  // namespace

Recording::Recording(const std::string& folder)
    : name_(nameOf(folder)), kind_(kindOf(folder)), data_(dataset::Dataset::open(folder)) {
  const dataset::GroundTruth truth = dataset::GroundTruth::load(folder);
  for (const dataset::RobotRecording& robot : data_.robots) {
    auto& poses = truth_.emplace_back();
    const auto path = truth.trajectories.find(robot.name);
    if (!robot.fisheye || path == truth.trajectories.end()) continue;
    std::map<TimeNs, dataset::StampedPose> at;
    for (const dataset::StampedPose& pose : path->second) at[pose.time_ns] = pose;
    for (std::size_t row = 0; row < robot.fisheye->rows.size(); ++row) {
      const auto pose = at.find(robot.fisheye->rows[row].time_ns);
      if (pose != at.end() && !robot.fisheye->rows[row].path.empty()) poses[row] = pose->second;
    }
  }
}

std::vector<FrameId> Recording::around(const FrameId& frame, double spacing_m, double reach_m) const {
  std::vector<FrameId> frames;
  const auto& path = truth_[frame.first];
  const auto walk = [&](auto at, auto end) {
    Eigen::Vector2d last = at->second.map_from_base.translation(), kept = last;
    double way_m = 0.0;
    for (++at; at != end; ++at) {
      const Eigen::Vector2d here = at->second.map_from_base.translation();
      way_m += (here - last).norm();
      last = here;
      if (way_m > reach_m) return;
      if ((here - kept).norm() < spacing_m) continue;
      kept = here;
      frames.emplace_back(frame.first, at->first);
    }
  };
  const auto at = path.find(frame.second);
  walk(std::make_reverse_iterator(std::next(at)), path.rend());
  walk(at, path.end());
  return frames;
}

std::map<FrameId, Shot> Recording::shots(const std::vector<FrameId>& frames) const {
  std::map<FrameId, Shot> shots;
  const std::set<FrameId> ordered(frames.begin(), frames.end());
  for (std::size_t robot = 0; robot < data_.robots.size(); ++robot) {
    const auto& stream = data_.robots[robot].fisheye;
    if (!stream) continue;
    const lens::Camera camera(stream->camera);
    local_mapper::LocalMapper mapper(camera, local_mapper::Options());
    local_mapper::AppearanceOptions every;
    every.places.rule = appearance::KeyframeRule::kEveryImage;
    local_mapper::AppearanceSource appearance(camera, every);
    for (const FrameId& id : ordered) {
      if (id.first != robot) continue;
      const dataset::ImageRow& row = stream->rows[id.second];
      local_mapper::Frame frame;
      frame.acquired_ns = row.time_ns;
      frame.sequence = row.sequence;
      frame.image = cv::imread(row.path);
      const LocalMap& map = mapper.process(frame, {});
      Shot shot;
      shot.scan.fit(map.boundary);
      if (map.state != FrameState::kOk || shot.scan.lines() < kFewestLines) continue;
      shot.scan.compact();
      shot.base_from_scan = {map.boundary.origin_m.x(), map.boundary.origin_m.y(), 0.0};
      shot.appearance = appearance.process(row.time_ns, frame.image, {});
      shots.emplace(id, std::move(shot));
    }
  }
  return shots;
}

}  // namespace omnifleet::loops
