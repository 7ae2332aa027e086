#include "ceiling_view/ceiling_view_run.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "dataset/atomic_file.h"
#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "dataset/trajectory_files.h"
#include "localizer/ceiling_view.h"

namespace omnifleet::ceiling_view {
namespace {

namespace fs = std::filesystem;

struct LastImage {
  cv::Mat bgr;
  TimeNs time_ns = 0;
};

LastImage lastImage(const dataset::ImageStream& stream) {
  LastImage last;
  const auto source = dataset::openStream(stream, dataset::Colour::kBgr);
  cv::Mat image;
  dataset::FrameInfo info;
  while (source->next(image, info)) {
    if (info.state == FrameState::kOk) last = {image.clone(), info.time_ns};
  }
  return last;
}

/// Poses of the robots nearest in time, if within 0.5 s.
std::vector<localizer::ViewedRobot> robotsAt(const fs::path& out, const dataset::Dataset& recording,
                                             TimeNs time_ns) {
  constexpr TimeNs kNear_ns = 500'000'000;
  std::vector<localizer::ViewedRobot> robots;
  for (const dataset::RobotRecording& recorded : recording.robots) {
    const fs::path path = out / "trajectories" / (recorded.name + ".tum");
    if (!fs::exists(path)) continue;
    localizer::ViewedRobot robot;
    robot.name = recorded.name;
    TimeNs apart_ns = kNear_ns + 1;
    for (const dataset::StampedPose& pose : dataset::flat(dataset::readTum(path.string()))) {
      if (std::abs(pose.time_ns - time_ns) >= apart_ns) continue;
      apart_ns = std::abs(pose.time_ns - time_ns);
      robot.map_from_base = pose.map_from_base;
    }
    if (recorded.front) {
      const lens::CameraModel& model = recorded.front->camera;
      robot.half_view_rad = std::atan(0.5 * model.image_width_px / model.focal_px.x());
    }
    if (apart_ns <= kNear_ns) robots.push_back(robot);
  }
  return robots;
}

void write(const fs::path& path, const cv::Mat& picture) {
  if (!cv::imwrite(path.string(), picture))
    throw std::runtime_error(path.string() + ": image not written; check the folder and the free disk space");
}

}  // namespace

std::vector<std::string> run(const std::string& out, const std::string& dataset_folder) {
  const dataset::Dataset recording = dataset::Dataset::open(dataset_folder);
  if (recording.ceiling.empty() || !recording.markers)
    throw options::Error(dataset_folder + ": has no ceiling camera with markers");
  if (!fs::is_directory(out)) throw options::Error(out + ": no such folder; give the --out folder of a run");
  const fs::path folder = fs::path(out) / "ceiling", map = fs::path(out) / "map.yaml";
  dataset::makeDirectories(folder.string());
  std::vector<std::string> written;
  for (const dataset::ImageStream& stream : recording.ceiling) {
    const LastImage last = lastImage(stream);
    if (last.bgr.empty()) continue;
    const lens::Camera camera(stream.camera);
    const std::string name = stream.name.substr(stream.name.find('/') + 1);
    cv::Mat picture = last.bgr.clone();
    localizer::drawTracking(camera, *recording.markers, robotsAt(out, recording, last.time_ns), picture);
    write(folder / (name + "_tracking.png"), picture);
    written.push_back((folder / (name + "_tracking.png")).string());
    if (!fs::exists(map)) continue;
    picture = last.bgr.clone();
    localizer::drawMap(camera, dataset::readMapServer(map.string()), picture);
    write(folder / (name + "_map.png"), picture);
    written.push_back((folder / (name + "_map.png")).string());
  }
  return written;
}

}  // namespace omnifleet::ceiling_view
