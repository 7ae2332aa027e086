#pragma once

#include <yaml-cpp/yaml.h>

#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "fleet/fleet.h"
#include "tests/multiprocess/listener.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::test {

inline std::string smallFleet() {
  return sourceDir() + "/config/fleets/small.yaml";
}

/// The small fleet in a room without ceiling cameras, so that only the robots localize each other.
inline std::string fleetWithoutCeiling(const std::string& name) {
  const std::string folder = freshDir(name);
  YAML::Node arena = YAML::LoadFile(sourceDir() + "/config/arenas/small.yaml");
  arena.remove("ceiling");
  std::ofstream(folder + "/arena.yaml") << arena;
  std::ofstream(folder + "/fleet.yaml") << "name: no_ceiling\nworld: {arena: arena.yaml, seed: 1}\n";
  return folder + "/fleet.yaml";
}

/// The small fleet (or another one) as processes, in real time or in lockstep, with a listener.
struct LiveFleet {
  LiveFleet(const std::string& name, int domain, const std::string& config = "long", bool lockstep = false,
            const std::string& fleet = smallFleet())
      : out(freshDir(name)),
        shared_before(sharedMemoryFiles()),
        launch(command(out, domain, config, lockstep, fleet), out + "/launch.log"),
        listener(domain) {}

  static std::vector<std::string> command(const std::string& out, int domain, const std::string& config,
                                          bool lockstep, const std::string& fleet) {
    std::vector<std::string> words{program("launch"),
                                   "run",
                                   fleet,
                                   "--config",
                                   sourceDir() + "/tests/multiprocess/" + config + ".yaml",
                                   "--out",
                                   out,
                                   "--domain",
                                   std::to_string(domain)};
    if (!lockstep) words.push_back("--realtime");
    return words;
  }

  std::string out;
  std::vector<std::string> shared_before;
  Process launch;
  Listener listener;
};

/// Service and instance of a status: "classifier r1", "world ".
inline std::string nameOf(const v1::ServiceStatus& status) {
  return status.service().to_string() + " " + status.instance().to_string();
}

/// All services that publish a status in a fleet on one machine, including the launcher.
inline std::set<std::string> instances(const std::string& fleet_file) {
  std::set<std::string> names{"launch "};
  for (const fleet::ProcessSpec& process : fleet::processes(fleet::Fleet::load(fleet_file, "", {})))
    names.insert(process.service + " " + process.instance);
  return names;
}

}  // namespace omnifleet::test
