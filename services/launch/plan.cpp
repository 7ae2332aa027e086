#include "launch/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "bus/service.h"
#include "bus/shared_memory.h"
#include "camera/source.h"
#include "common/check_options.h"
#include "dataset/dataset.h"

namespace omnifleet::launch {

namespace {

/// Everything that goes in lies on disk already.
bool isRecorded(const fleet::Fleet& fleet) {
  if (!fleet.dataset.empty()) return true;
  const bool on_disk =
      std::all_of(fleet.cameras.begin(), fleet.cameras.end(), [](const fleet::CameraSpec& camera) {
        return camera.source == fleet::CameraSource::kFolder || camera.source == fleet::CameraSource::kVideo;
      });
  return !fleet.cameras.empty() && on_disk &&
         std::none_of(fleet.robots.begin(), fleet.robots.end(),
                      [](const fleet::RobotSpec& robot) { return robot.has_wheels || robot.laser; });
}

}  // namespace

std::string modeOf(const RunRequest& request, const fleet::Fleet& fleet) {
  if (isRecorded(fleet) && (!fleet.dataset.empty() || !request.realtime)) return "replay";
  return fleet.arena && !request.realtime ? "lockstep" : "live";
}

std::vector<supervisor::ProcessSpec> plan(const RunRequest& request, const fleet::Fleet& fleet,
                                          const std::string& program_folder) {
  const std::string mode = modeOf(request, fleet);
  std::vector<supervisor::ProcessSpec> specs;
  for (const fleet::ProcessSpec& process : fleet::processes(fleet, request.host)) {
    supervisor::ProcessSpec spec;
    std::string instance = process.instance;
    std::replace(instance.begin(), instance.end(), '/', '_');
    spec.name = instance.empty() ? process.service : process.service + "_" + instance;
    spec.argv = {program_folder + "/omnifleet_" + process.service,
                 "--mode",
                 mode,
                 "--out",
                 request.out,
                 "--domain",
                 std::to_string(request.domain)};
    const auto add = [&](const std::string& key, const std::string& value) {
      if (!value.empty()) spec.argv.insert(spec.argv.end(), {key, value});
    };
    add("--fleet", request.fleet_file);
    add("--dataset", fleet.dataset);
    for (const std::string& overlay : request.overlays) add("--config", overlay);
    add(process.instance.find('/') == std::string::npos ? "--robot" : "--camera", process.instance);
    spec.life_option = "--life";
    if (request.debug_images) spec.argv.push_back("--debug-images");
    if (request.record) spec.argv.push_back("--record");
    spec.log_path = request.out + "/log/" + spec.name + ".log";
    spec.level = process.stage;
    spec.sink = process.service == "global_merger";
    // Where nothing may be lost a lost process is the end of the run; live, the fleet goes on without it.
    // A simulated world that dies takes its time and places along: there is nothing to go on with.
    spec.restart = mode == "live" && process.service != "world" ? supervisor::RestartPolicy::kOnFailure
                                                                : supervisor::RestartPolicy::kNever;
    spec.refusal_code = static_cast<int>(bus::ExitCode::kBadOptions);
    specs.push_back(std::move(spec));
  }
  return specs;
}

std::vector<std::string> services(const RunRequest& request, const fleet::Fleet& fleet) {
  std::vector<std::string> names;
  for (const fleet::ProcessSpec& process : fleet::processes(fleet, request.host))
    names.push_back(process.instance.empty() ? process.service : process.service + " " + process.instance);
  return names;
}

ExpectedFrames expectedFrames(const fleet::Fleet& fleet) {
  if (fleet.arena) return {static_cast<std::uint64_t>(fleet.arena->frames()), true};
  if (fleet.dataset.empty()) return {};
  const dataset::Dataset recording = dataset::Dataset::open(fleet.dataset);
  std::size_t frames = 0;
  for (const auto& robot : recording.robots) {
    if (robot.fisheye) frames = std::max(frames, robot.fisheye->rows.size());
  }
  return {frames, false};
}

namespace {

/// A host that no part of the fleet is on would start nothing.
void checkHost(const std::string& host, const fleet::Fleet& fleet) {
  if (host.empty()) return;
  std::set<std::string> hosts;
  for (const fleet::ProcessSpec& process : fleet::processes(fleet, {})) hosts.insert(process.host);
  if (hosts.count(host)) return;
  hosts.erase("");
  throw options::Error(fmt::format(
      "--host {}: nothing of this fleet runs there; {}", host,
      hosts.empty() ? "its file names no hosts" : fmt::format("its hosts are {}", fmt::join(hosts, ", "))));
}

}  // namespace

void checkBeforeStart(const RunRequest& request, const fleet::Fleet& fleet) {
  checkHost(request.host, fleet);
  services::checkOptions(fleet);
  services::checkCameras(fleet);
  services::checkOutput(fleet, request.out);
  for (const fleet::CameraSpec& camera : fleet.cameras) {
    if (request.host.empty() || camera.host == request.host) services::checkSource(camera, fleet);
  }
  std::size_t bytes = 0;
  const bus::RunMode mode = modeOf(request, fleet) == "live" ? bus::RunMode::kLive : bus::RunMode::kReplay;
  for (const fleet::CameraSpec& camera : fleet.cameras) {
    try {
      bytes += bus::frameChannelBytes(
          static_cast<std::size_t>(camera.model.image_width_px) * camera.model.image_height_px * 3, mode);
    } catch (const std::runtime_error& error) {
      throw options::Error("camera " + camera.id + ": " + error.what());
    }
  }
  services::makeOutput(request.out + "/log");
  try {
    bus::requireSharedMemory(bytes);
  } catch (const std::runtime_error& error) {
    throw options::Error(error.what());
  }
}

}  // namespace omnifleet::launch
