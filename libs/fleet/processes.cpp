#include <algorithm>
#include <set>

#include "fleet/fleet.h"

namespace omnifleet::fleet {
namespace {

// Stages in stopping order: producers stop first, the merger finishes last.
enum Stage { kSources, kMappers, kClassifiers, kLocalizers, kFormations, kMergers };

std::string hostOf(const Fleet& fleet, const std::string& service, const std::string& fallback) {
  std::string host = fallback;
  fleet.file.child("services").child(service).read("host", host);
  return host;
}

}  // namespace

std::vector<ProcessSpec> processes(const Fleet& fleet, const std::string& host) {
  std::vector<ProcessSpec> all;
  const auto add = [&](const std::string& service, const std::string& instance, const std::string& machine,
                       int stage) {
    all.push_back({service, instance, hostOf(fleet, service, machine), stage});
  };
  if (fleet.hasWorld()) add("world", "", "", kSources);
  for (const CameraSpec& camera : fleet.cameras) {
    if (fleet.isRead(camera)) add("camera", camera.id, camera.host, kSources);
  }
  const std::vector<std::string> robots = fleet.mappingRobots();
  for (const std::string& robot : robots) add("local_mapper", robot, fleet.robot(robot).host, kMappers);
  for (const std::string& robot : robots) add("classifier", robot, fleet.robot(robot).host, kClassifiers);
  for (const std::string& camera : fleet.ceilingCameras())
    add("localizer", camera, fleet.camera(camera).host, kMappers);
  add("localizer", "", "", kLocalizers);
  if (fleet.hasFormation()) {
    for (const std::string& robot : robots) add("formation", robot, fleet.robot(robot).host, kFormations);
  }
  for (const std::string& robot : fleet.replicas())
    add("global_merger", robot, fleet.robot(robot).host, kMergers);
  if (!host.empty()) {
    // Services of the whole fleet without a host of their own run on the first machine.
    const std::vector<std::string> hosts = fleet.hosts();
    for (ProcessSpec& process : all) {
      if (process.host.empty() && process.instance.empty() && !hosts.empty()) process.host = hosts.front();
    }
    all.erase(std::remove_if(all.begin(), all.end(), [&](const ProcessSpec& p) { return p.host != host; }),
              all.end());
  }
  return all;
}

std::vector<std::string> Fleet::hosts() const {
  std::set<std::string> names;
  for (const ProcessSpec& process : processes(*this)) names.insert(process.host);
  names.erase("");
  return {names.begin(), names.end()};
}

std::vector<std::string> Fleet::estimatorHosts() const {
  std::vector<std::string> names = hosts();
  const auto own = std::find(names.begin(), names.end(), hostOf(*this, "localizer", ""));
  if (own != names.end()) std::rotate(names.begin(), own, own + 1);
  return names;
}

std::string Fleet::savingReplica(const std::string& host) const {
  for (const ProcessSpec& process : processes(*this, host))
    if (process.service == "global_merger") return process.instance;
  return {};
}

int expectedReaders(const Fleet& fleet, const std::string& topic, const std::string& instance) {
  const int robots = static_cast<int>(fleet.mappingRobots().size());
  const int replicas = static_cast<int>(fleet.replicas().size());
  const int formations = fleet.hasFormation() ? robots : 0;
  const bool maps = !instance.empty() && fleet.maps(instance);
  if (topic == "camera") return 1;
  const std::vector<std::string> observing = fleet.observingRobots();
  const bool observes = std::find(observing.begin(), observing.end(), instance) != observing.end();
  if (topic == "wheels/odometry")
    return maps || observes ? 1 : 0;  // the local mapper of the robot, or the localizer
  if (topic == "wheels/command") return fleet.arena ? 1 : 0;
  if (topic == "local_map" || topic == "laser") return 1;
  if (topic == "objects" && observes) return 1;  // published by the localizer, read by the merger
  if (topic == "objects") return 2 + (fleet.hasFormation() ? 1 : 0);  // localizer, merger, formation
  if (topic == "measurement") return 1;
  if (topic == "pose") {  // every merger; also every classifier and formation unless the robot only observes
    return replicas + (observes ? 0 : robots + formations);
  }
  if (topic == "formation/state") return std::max(0, formations - 1);  // all other formations
  if (topic == "map/contribution" || topic == "map/keyframe_pose") return replicas;
  // The replica that saves. Late joiners get the latest sample, but a short run might end before it joins.
  if (topic == "alignment" || topic == "place") return 1;
  if (topic == "world/truth") {
    return static_cast<int>(
        std::count_if(fleet.cameras.begin(), fleet.cameras.end(), [&](const CameraSpec& camera) {
          return camera.source == CameraSource::kArena && fleet.isRead(camera);
        }));
  }
  return 0;
}

}  // namespace omnifleet::fleet
