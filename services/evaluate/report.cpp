#include "evaluate/report.h"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "evaluation/shape.h"

namespace omnifleet::evaluate {
namespace {

namespace fs = std::filesystem;
using dataset::StampedPose;

constexpr TimeNs kMaxGap_ns = 1'000'000'000;

dataset::GroundTruth loadTruth(const std::string& folder) {
  try {
    return dataset::GroundTruth::load(folder);
  } catch (const std::runtime_error& error) {
    throw options::Error(error.what());
  }
}

/// The stream whose frames the trajectory follows.
const dataset::ImageStream* frames(const dataset::RobotRecording* robot) {
  if (!robot) return nullptr;
  if (robot->fisheye) return &*robot->fisheye;
  return robot->front ? &*robot->front : nullptr;
}

/// Places carry the index of their image in data.csv.
void comparePlaces(const std::string& path, const dataset::ImageStream& stream,
                   const std::vector<StampedPose>& truth, RobotReport& report) {
  std::vector<Eigen::Vector2d> got, expected;
  for (const dataset::G2oVertex& vertex : dataset::readG2o(path).vertices) {
    for (const dataset::ImageRow& row : stream.rows) {
      Pose2 pose;
      if (static_cast<int>(row.sequence) != vertex.id) continue;
      if (!evaluation::poseAt(truth, row.time_ns, kMaxGap_ns, pose)) continue;
      got.push_back(vertex.pose.translation());
      expected.push_back(pose.translation());
    }
  }
  report.places = static_cast<int>(got.size());
  if (got.size() > 1) report.shape_difference = evaluation::shapeDifference(got, expected);
}

RobotReport compareRobot(const fs::path& out, const dataset::Dataset& recording, const std::string& name,
                         const std::vector<StampedPose>& truth, std::vector<std::string>& warnings) {
  RobotReport report;
  report.name = name;
  const dataset::ImageStream* stream = frames(recording.findRobot(name));
  report.frames = stream ? static_cast<int>(stream->rows.size()) : 0;
  std::vector<StampedPose> estimate;
  const fs::path path = out / "trajectories" / (name + ".tum");
  report.has_trajectory = fs::exists(path);
  if (report.has_trajectory) estimate = dataset::flat(dataset::readTum(path.string(), &warnings));
  report.path = evaluation::comparePaths(truth, estimate, kMaxGap_ns);
  const auto pairs = evaluation::associate(evaluation::lift(truth), evaluation::lift(estimate));
  report.ate_m = evaluation::absoluteTrajectoryError(pairs, evaluation::Alignment::kSe2);
  report.rpe = evaluation::relativePoseError(pairs);
  const fs::path places = out / "places" / (name + ".g2o");
  if (stream && fs::exists(places)) comparePlaces(places.string(), *stream, truth, report);
  return report;
}

std::optional<evaluation::KindMetrics> compareTracks(const fs::path& out, const dataset::GroundTruth& truth,
                                                     std::vector<std::string>& warnings) {
  std::optional<evaluation::KindMetrics> sum;
  for (const auto& [name, poses] : truth.trajectories) {
    const fs::path path = out / "tracks" / (name + ".csv");
    if (poses.empty() || !fs::exists(path)) continue;
    const auto rows = dataset::readTracks(path.string(), warnings);
    if (!sum) sum.emplace();
    *sum += evaluation::compareKinds(name, rows, truth.trajectories, truth.scene);
  }
  return sum;
}

}  // namespace

Report evaluateRun(const std::string& out, const std::string& dataset_folder) {
  if (!fs::is_directory(out)) throw options::Error(out + ": no such folder; give the --out folder of a run");
  const dataset::Dataset recording = dataset::Dataset::open(dataset_folder);
  const dataset::GroundTruth truth = loadTruth(dataset_folder);
  Report report;
  report.warnings = recording.warnings;
  if (truth.has_scene) {
    const fs::path path = fs::path(out) / "objects.geojson";
    if (!fs::exists(path)) {
      throw std::runtime_error(path.string() + ": is missing; the run has not written its map (see " + out +
                               "/log)");
    }
    report.truth = truth.scene;
    report.objects = dataset::readObjects(path.string());
    report.map = evaluation::compareMaps(report.truth, report.objects, {});
  }
  for (const auto& [name, poses] : truth.trajectories) {
    report.robots.push_back(compareRobot(out, recording, name, poses, report.warnings));
  }
  report.kinds = compareTracks(out, truth, report.warnings);
  return report;
}

}  // namespace omnifleet::evaluate
