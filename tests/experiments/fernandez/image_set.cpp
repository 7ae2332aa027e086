#include "tests/experiments/fernandez/image_set.h"

#include <stdexcept>

#include "appearance/panorama.h"
#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "evaluation/trajectory_metrics.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::fernandez {
namespace {

constexpr TimeNs kMaxGap_ns = 10'000'000'000;  // images by distance: the truth has a pose at each of them

template <typename PoseOf>
std::vector<Eigen::Vector2d> positions(const std::vector<SetImage>& images, int step, const PoseOf& poseOf) {
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < images.size(); i += static_cast<std::size_t>(step))
    points.push_back(poseOf(images[i]).translation());
  return points;
}

/// The paper does not give its band. Of the bands tried on seeds 0 and 1 (lower edge 0 to −60°) those near
/// the horizon suit the literal compass best: what is far below it is near, and shifts with the translation.
appearance::PanoramaOptions nearHorizon() {
  appearance::PanoramaOptions options;
  options.least_elevation_deg = -4.0;
  return options;
}

appearance::SignatureOptions everyRow() {
  appearance::SignatureOptions options;
  options.rows = 64;
  options.k1 = options.k2 = kFrequencies;
  options.dark_level = 0.0;
  return options;
}

appearance::SignatureOptions pooledRows() {
  appearance::SignatureOptions options;
  options.k1 = options.k2 = kFrequencies;
  return options;
}

}  // namespace

std::vector<Eigen::Vector2d> ImageSet::truth(int step) const {
  return positions(images, step, [](const SetImage& image) { return image.truth; });
}

std::vector<Eigen::Vector2d> ImageSet::odometry(int step) const {
  return positions(images, step, [](const SetImage& image) { return image.odometry; });
}

double ImageSet::length_m() const {
  double sum = 0.0;
  for (std::size_t i = 1; i < images.size(); ++i)
    sum += (images[i].truth.translation() - images[i - 1].truth.translation()).norm();
  return sum;
}

ImageSet ImageSet::load(const std::string& recording) {
  const dataset::Dataset data = dataset::Dataset::open(recording);
  if (data.robots.empty() || !data.robots.front().fisheye)
    throw std::runtime_error(recording + ": its first robot has no fisheye camera");
  const dataset::RobotRecording& robot = data.robots.front();
  const dataset::GroundTruth truth = dataset::GroundTruth::load(recording);
  const auto path = truth.trajectories.find(robot.name);
  if (path == truth.trajectories.end())
    throw std::runtime_error(recording + ": has no true poses of " + robot.name);

  const lens::Camera camera(robot.fisheye->camera);
  const auto narrow = appearance::Unwrapper::fromCamera(camera, nearHorizon()),
             wide = appearance::Unwrapper::fromCamera(camera, {});
  appearance::SignatureMaker every_row(narrow, everyRow()), pooled(wide, pooledRows());
  motion::WheelIntegrator wheels;
  if (!robot.wheels.empty()) wheels = motion::WheelIntegrator(robot.body.wheel_separation_m, {});
  for (const dataset::WheelRow& row : robot.wheels) wheels.add(row.time_ns, row.left_mps, row.right_mps);

  ImageSet set;
  set.has_wheels = !robot.wheels.empty();
  const auto source = dataset::openStream(*robot.fisheye, dataset::Colour::kBgr);
  cv::Mat image;
  cv::Mat1b panorama;
  dataset::FrameInfo info;
  Pose2 odometry;
  while (source->next(image, info)) {
    SetImage next;
    if (info.state != FrameState::kOk ||
        !evaluation::poseAt(path->second, info.time_ns, kMaxGap_ns, next.truth))
      continue;
    const Motion motion = wheels.motionTo(info.time_ns);
    if (motion.valid) odometry = odometry * motion.previous_from_current;
    next.sequence = info.sequence;
    next.time_ns = info.time_ns;
    next.odometry = odometry;
    narrow.unwrap(image, panorama);
    every_row.compute(panorama, next.rows);
    wide.unwrap(image, panorama);
    pooled.compute(panorama, next.pooled);
    set.images.push_back(std::move(next));
  }
  if (set.images.size() < 3) throw std::runtime_error(recording + ": has fewer than three images");
  return set;
}

}  // namespace omnifleet::fernandez
