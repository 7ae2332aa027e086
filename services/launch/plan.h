#pragma once

#include <sys/types.h>

#include <ctime>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "bus/network.h"
#include "fleet/fleet.h"
#include "launch/progress.h"
#include "supervisor/supervisor.h"

namespace omnifleet::launch {

/// The parsed command line.
struct RunRequest {
  std::string fleet_file;  ///< this or `dataset`
  std::string dataset;
  std::vector<std::string> overlays;
  std::string out;
  std::string host;  ///< start only the part for this host; empty: all
  double duration_s = 0.0;
  double stop_within_s = 1.8;  ///< s, from the first signal to the last kill; sinks have longer to save
  bool record = false;
  bool debug_images = false;
  bool realtime = false;  ///< arena, image folders and videos in real time
  int domain = 0;
  bus::NetworkRequest network;  ///< --interface, --peer
};

/// "replay" for input on disk (a recording; image folders and videos without --realtime), "lockstep" or
/// "live".
std::string modeOf(const RunRequest& request, const fleet::Fleet& fleet);

/// The processes of this run. Live, each of several machines has a localizer (ElectedLocalizer).
std::vector<fleet::ProcessSpec> processesOf(const RunRequest& request, const fleet::Fleet& fleet);

/// One entry per process of the fleet on this host. `program_folder` contains the service programs.
std::vector<supervisor::ProcessSpec> plan(const RunRequest& request, const fleet::Fleet& fleet,
                                          const bus::HostNetwork& network, const std::string& program_folder);

/// The network of this run. Throws options::Error when it does not exist, and when a part of a fleet of
/// several machines would use only the loopback interface, unless the user gave that one.
bus::HostNetwork networkFor(const RunRequest& request, const fleet::Fleet& fleet);

/// Names of these services on service/status: "camera r1/fisheye", "world".
std::vector<std::string> services(const RunRequest& request, const fleet::Fleet& fleet);

/// With --host: the other machines of the fleet, whose launchers must be heard.
std::vector<std::string> otherHosts(const RunRequest& request, const fleet::Fleet& fleet);

/// The map file of a run directory as it was at the start of a run. (Not by its time: a clock may be set.)
class MapFile {
 public:
  explicit MapFile(const std::string& out);
  bool hasChanged() const;  ///< it was written since, or written for the first time

 private:
  using Version = std::optional<std::tuple<ino_t, time_t, long>>;  ///< every writer makes a new file
  Version version() const;
  std::string path_;
  Version before_;
};

/// What to say at the end of a live run about the map of this machine; empty: it was saved.
struct SavedMap {
  bool is_missing = false;  ///< a replica ran here, but no map was saved
  std::string text;         ///< why, or on which machines the map is
};
SavedMap checkSavedMap(const RunRequest& request, const fleet::Fleet& fleet, const MapFile& file);

/// Number of frames of the robot with the most frames.
ExpectedFrames expectedFrames(const fleet::Fleet& fleet);

/// Throws options::Error before any process starts: checks every option of every service and write access to
/// the run directory.
void checkBeforeStart(const RunRequest& request, const fleet::Fleet& fleet);

}  // namespace omnifleet::launch
