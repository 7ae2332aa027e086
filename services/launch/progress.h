#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "bus/dds_bus.h"
#include "bus/network.h"

namespace omnifleet::launch {

/// Number of frames per robot of the whole run.
struct ExpectedFrames {
  std::uint64_t frames = 0;  ///< 0: unknown
  bool at_most = false;      ///< the run of an arena may end earlier, when all robots have arrived
};

/// What to listen to.
struct Listening {
  int domain = 0;
  bus::HostNetwork network;
  std::string host;                      ///< part of the fleet; empty: all
  std::vector<std::string> other_hosts;  ///< machines with the other parts
  std::vector<std::string> services;     ///< started on this host: "camera r1/fisheye", "world"
  ExpectedFrames expected;
};

/// The participant that listens. Within one host its lease is long: on a busy machine the fleet must not
/// consider it gone. Between hosts a link may be cut, and its lease is that of the services
/// (docs/methods/dds.md).
bus::DdsBusOptions listenerOptions(const Listening& listening);

/// Listens to service/status and prints to stderr (console.h): a progress line (rewritten in place on a
/// terminal, every few seconds elsewhere), each error once, and services that become silent. Runs in its own
/// process, so that the launcher is no DDS participant and a DDS failure cannot affect the fleet.
class Progress {
 public:
  /// Forks: construct while the program is single-threaded. Throws std::system_error.
  explicit Progress(const Listening& listening);
  ~Progress();  ///< returns after the last line is printed, or after kEnd: a hanging listener is killed
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A process keeps failing: published as the state of the launcher. Never waits.
  void noteFailing(const std::string& what);

  static constexpr std::chrono::seconds kEnd{3};

 private:
  pid_t listener_ = -1;
  int pipe_ = -1;  // notes as lines; the listener ends when this end is closed
};

/// "120/250 frames per robot, 14.2 frames/s, 9 s left". For an arena: "120 frames per robot (at most 250), …,
/// at most 9 s left". No remaining time once the run has `ended`.
std::string progressLine(std::uint64_t done, const ExpectedFrames& expected, double seconds, bool ended);

}  // namespace omnifleet::launch
