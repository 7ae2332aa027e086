#include "launch/plan.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <set>

#include "bus/service.h"
#include "camera/source.h"
#include "common/check_options.h"
#include "common/fleet_network.h"
#include "dataset/dataset.h"
#include "dataset/frame_source.h"

namespace omnifleet::launch {

namespace {

/// All input data is on disk.
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

std::vector<fleet::ProcessSpec> processesOf(const RunRequest& request, const fleet::Fleet& fleet) {
  std::vector<fleet::ProcessSpec> processes = fleet::processes(fleet, request.host);
  if (request.host.empty() || modeOf(request, fleet) != "live" || fleet.estimatorHosts().size() < 2)
    return processes;
  const auto isLocalizer = [](const fleet::ProcessSpec& process) {
    return process.service == "localizer" && process.instance.empty();
  };
  if (std::any_of(processes.begin(), processes.end(), isLocalizer)) return processes;
  for (fleet::ProcessSpec& process : fleet::processes(fleet)) {
    if (!isLocalizer(process)) continue;
    process.host = request.host;
    processes.push_back(process);
  }
  return processes;
}

std::vector<supervisor::ProcessSpec> plan(const RunRequest& request, const fleet::Fleet& fleet,
                                          const bus::HostNetwork& network,
                                          const std::string& program_folder) {
  const std::string mode = modeOf(request, fleet);
  std::vector<supervisor::ProcessSpec> specs;
  for (const fleet::ProcessSpec& process : processesOf(request, fleet)) {
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
    add("--host", request.host);
    add("--fleet", request.fleet_file);
    add("--dataset", fleet.dataset);
    for (const std::string& overlay : request.overlays) add("--config", overlay);
    add(process.instance.find('/') == std::string::npos ? "--robot" : "--camera", process.instance);
    if (network.leavesHost()) {
      const std::vector<std::string> words = network.arguments();
      spec.argv.insert(spec.argv.end(), words.begin(), words.end());
    }
    spec.incarnation_option = "--incarnation";
    if (request.debug_images) spec.argv.push_back("--debug-images");
    if (request.record) spec.argv.push_back("--record");
    spec.log_path = request.out + "/log/" + spec.name + ".log";
    spec.level = process.stage;
    spec.sink = process.service == "global_merger";
    // In deterministic modes a failed process ends the run. In live mode the other processes continue. A
    // failed simulated world always ends the run, because its time and poses are lost.
    spec.restart = mode == "live" && process.service != "world" ? supervisor::RestartPolicy::kOnFailure
                                                                : supervisor::RestartPolicy::kNever;
    spec.stops_run = mode == "live";
    spec.refusal_code = static_cast<int>(bus::ExitCode::kBadOptions);
    specs.push_back(std::move(spec));
  }
  return specs;
}

std::vector<std::string> services(const RunRequest& request, const fleet::Fleet& fleet) {
  std::vector<std::string> names;
  for (const fleet::ProcessSpec& process : processesOf(request, fleet)) {
    const std::string& instance = process.instance.empty() ? request.host : process.instance;
    names.push_back(instance.empty() ? process.service : process.service + " " + instance);
  }
  return names;
}

std::vector<std::string> otherHosts(const RunRequest& request, const fleet::Fleet& fleet) {
  if (request.host.empty()) return {};
  std::vector<std::string> hosts = fleet.hosts();
  hosts.erase(std::remove(hosts.begin(), hosts.end(), request.host), hosts.end());
  return hosts;
}

MapFile::MapFile(const std::string& out) : path_(out + "/map.bt"), before_(version()) {}

MapFile::Version MapFile::version() const {
  struct stat file {};
  if (::stat(path_.c_str(), &file) != 0) return std::nullopt;
  return std::tuple{file.st_ino, file.st_mtim.tv_sec, file.st_mtim.tv_nsec};
}

bool MapFile::hasChanged() const {
  const Version now = version();
  return now && now != before_;
}

SavedMap checkSavedMap(const RunRequest& request, const fleet::Fleet& fleet, const MapFile& file) {
  const std::string replica = fleet.savingReplica(request.host);
  if (replica.empty()) {
    std::set<std::string> hosts;
    for (const fleet::ProcessSpec& process : fleet::processes(fleet))
      if (process.service == "global_merger") hosts.insert(process.host);
    return {false, fmt::format("no replica of the map runs on {}; the map is saved on {}", request.host,
                               fmt::join(hosts, ", "))};
  }
  if (file.hasChanged()) return {};
  return {true,
          fmt::format("no map was saved: the replica of {} has none; see {}/log/global_merger_{}.log and the "
                      "localizer's log",
                      replica, request.out, replica)};
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

bus::HostNetwork networkFor(const RunRequest& request, const fleet::Fleet& fleet) {
  const bus::HostNetwork network = services::networkOf(fleet, request.network);
  const std::vector<std::string> hosts = fleet.hosts();
  if (request.host.empty() || hosts.size() < 2 || network.leavesHost() || !request.network.interfaces.empty())
    return network;
  throw options::Error(fmt::format(
      "{}: this fleet runs on {}, but only the loopback interface is used, so its machines cannot reach each "
      "other; add `network: {{interface: NAME}}` to the file, or give --interface NAME; {}",
      request.fleet_file, fmt::join(hosts, ", "), bus::listed(bus::networkAddresses())));
}

namespace {

/// Rejects a host on which no part of the fleet runs, and a fleet some part of which no host would start.
void checkHost(const std::string& host, const fleet::Fleet& fleet) {
  if (host.empty()) return;
  const std::vector<std::string> hosts = fleet.hosts();
  for (const fleet::ProcessSpec& process : fleet::processes(fleet, {})) {
    if (process.host.empty() && !process.instance.empty())
      throw options::Error(
          fmt::format("--host {}: no machine would start {} {}; give its robot or camera a `host`", host,
                      process.service, process.instance));
  }
  if (std::find(hosts.begin(), hosts.end(), host) != hosts.end()) return;
  throw options::Error(fmt::format("--host {}: no part of this fleet runs there; {}", host,
                                   hosts.empty() ? "the fleet file names no hosts"
                                                 : fmt::format("its hosts are {}", fmt::join(hosts, ", "))));
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
  // After the checks above, whose messages are more specific.
  if (!fleet.dataset.empty()) dataset::checkFrames(dataset::Dataset::open(fleet.dataset));
  services::makeOutput(request.out + "/log");
}

}  // namespace omnifleet::launch
