#pragma once

#include <string>
#include <vector>

#include "fleet/fleet.h"
#include "launch/progress.h"
#include "supervisor/supervisor.h"

namespace omnifleet::launch {

/// What the command line asks for.
struct RunRequest {
  std::string fleet_file;  ///< or
  std::string dataset;
  std::vector<std::string> overlays;
  std::string out;
  std::string host;  ///< only this host's part; empty: all
  double duration_s = 0.0;
  double stop_within_s = 1.8;  ///< s, from the first signal to the last process killed; the merger may save
  bool record = false;
  bool debug_images = false;
  bool realtime = false;  ///< the arena, folders and videos by the wall clock
  int domain = 0;
};

/// "replay" of what lies on disk (a recording; folders of pictures and videos unless --realtime is asked),
/// "lockstep" or "live".
std::string modeOf(const RunRequest& request, const fleet::Fleet& fleet);

/// One entry per process of the fleet on this host. `program_folder` holds the service programs.
std::vector<supervisor::ProcessSpec> plan(const RunRequest& request, const fleet::Fleet& fleet,
                                          const std::string& program_folder);

/// What each of them calls itself on service/status: "camera r1/fisheye", "world".
std::vector<std::string> services(const RunRequest& request, const fleet::Fleet& fleet);

/// Of the robot that has the most.
ExpectedFrames expectedFrames(const fleet::Fleet& fleet);

/// Throws options::Error before anything is started: every option of every service, enough shared memory for
/// the frames, a run directory that can be written.
void checkBeforeStart(const RunRequest& request, const fleet::Fleet& fleet);

}  // namespace omnifleet::launch
