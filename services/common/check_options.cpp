#include "common/check_options.h"

#include "camera/device_service.h"
#include "classifier/classifier.h"
#include "dataset/atomic_file.h"
#include "dataset/observation_rows.h"
#include "formation/formation.h"
#include "global_merger/merger.h"
#include "laser/laser_mapper.h"
#include "local_mapper/front_service.h"
#include "local_mapper/local_mapper.h"
#include "local_mapper/service.h"
#include "localizer/ceiling_agreement.h"
#include "localizer/ceiling_wait.h"
#include "localizer/estimator_stage.h"
#include "localizer/marked_robots.h"
#include "localizer/observation_frames.h"
#include "localizer/pose_gaps.h"
#include "markers/patch_finder.h"
#include "motion/wheel_integrator.h"
#include "occupancy/reconciler.h"
#include "world/world.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <utility>

namespace omnifleet::services {
namespace {

void checkFormation(const fleet::Fleet& fleet) {
  const options::Section section = fleet.service("formation");
  const std::string leader = formation::Formation::Options::read(section).leader;
  const std::vector<std::string> robots = fleet.mappingRobots();
  if (leader.empty() || std::find(robots.begin(), robots.end(), leader) != robots.end()) return;
  section.fail("leader", fmt::format("'{}' is not a robot of the formation; choose one of {}", leader,
                                     fmt::join(robots, ", ")));
}

}  // namespace

void checkCameras(const fleet::Fleet& fleet) {
  const local_mapper::Options fisheye = fisheyeOptions(fleet);
  const local_mapper::FrontMapper::Options front = frontOptions(fleet);
  for (const fleet::CameraSpec& camera : fleet.cameras) {
    try {
      const lens::Camera lens(camera.model);
      if (!fleet.isRead(camera)) continue;
      if (camera.role == fleet::CameraRole::kFisheye) local_mapper::LocalMapper(lens, fisheye);
      if (camera.role == fleet::CameraRole::kFront) local_mapper::FrontMapper(lens, front);
    } catch (const std::runtime_error& error) {
      throw options::Error("camera " + camera.id + ": " + error.what());
    }
  }
}

void checkOutput(const fleet::Fleet& fleet, const std::string& out) {
  if (fleet.dataset.empty() || out.empty()) return;
  const auto recording = std::filesystem::weakly_canonical(fleet.dataset);
  const auto run = std::filesystem::weakly_canonical(out);
  const auto [end, at] = std::mismatch(recording.begin(), recording.end(), run.begin(), run.end());
  if (end != recording.end()) return;
  throw options::Error("--out " + out + " is inside the recording " + fleet.dataset +
                       "; recordings are not modified, choose another folder");
}

void makeOutput(const std::string& folder) {
  const std::string probe = folder + "/.writable";
  try {
    dataset::makeDirectories(folder);
    dataset::writeAtomic(probe, "");
    std::filesystem::remove(probe);
  } catch (const std::runtime_error& error) {
    throw options::Error(error.what());
  }
}

void removeOldTrajectories(const fleet::Fleet& fleet, const std::string& out, const std::string& host) {
  namespace fs = std::filesystem;
  const auto processes = fleet::processes(fleet, host);
  if (std::none_of(processes.begin(), processes.end(),
                   [](const fleet::ProcessSpec& process) { return process.service == "global_merger"; }))
    return;
  try {
    for (const auto& [folder, kind] :
         {std::pair{"trajectories", ".tum"}, {"covariances", ".csv"}, {"localization", ".csv"}}) {
      const fs::path path = fs::path(out) / folder;
      if (!fs::is_directory(path)) continue;
      for (const auto& entry : fs::directory_iterator(path)) {
        if (entry.path().extension() == kind) fs::remove(entry.path());
      }
    }
  } catch (const fs::filesystem_error& error) {
    throw options::Error(std::string("--out: cannot remove the trajectories of an earlier run: ") +
                         error.what());
  }
}

void checkOptions(const fleet::Fleet& fleet) {
  const options::Section mapper = fleet.service("local_mapper");
  motion::WheelIntegrator::Options::read(mapper.child("wheels"));
  laser::Options::read(mapper.child("laser"));
  double laser_age_s = 0.0;
  mapper.read("laser_age_s", laser_age_s, {0.0, 1.0});
  wheelsMissing_s(mapper);
  local_mapper::AppearanceOptions::read(mapper.child("appearance"));
  local_mapper::ImageCircleOptions::read(mapper.child("image_circle"));
  fisheyeOptions(fleet);
  frontOptions(fleet);

  classifier::Classifier::Options::read(fleet.service("classifier"));

  const options::Section localizer = fleet.service("localizer");
  estimation::EstimatorOptions::read(localizer.child("estimator"));
  markers::FinderOptions::read(localizer.child("markers"));
  localizer::ObservationOptions::read(localizer.child("observations"));
  localizer::MarkedOptions::read(localizer.child("marked"));
  localizer::AgreementOptions::read(localizer.child("agreement"));
  localizer::PoseGapOptions::read(localizer.child("pose_gaps"));
  localizer::CeilingWaitOptions::read(localizer.child("ceiling_wait"));
  localizer.finish();

  const options::Section merger = fleet.service("global_merger");
  global_merger::KeyframeOptions::read(merger.child("keyframes"));
  global_merger::MergerOptions::read(merger.child("outlines"));
  occupancy::OccupancyOptions::read(merger.child("occupancy"));
  occupancy::ReconcilerOptions::read(merger.child("replication"));
  merger.finish();

  if (fleet.hasFormation()) checkFormation(fleet);
  const options::Section world = fleet.service("world");
  if (fleet.arena) {
    world::World::Options::read(world);
  } else {
    dataset::ObservationNoise::read(world.child("observations"));
    world.finish();
  }
  CameraOptions::read(fleet.service("camera"));
}

}  // namespace omnifleet::services
