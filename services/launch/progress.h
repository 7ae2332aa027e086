#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace omnifleet::launch {

/// How many frames per robot a whole run has.
struct ExpectedFrames {
  std::uint64_t frames = 0;  ///< 0: not known
  bool at_most = false;      ///< an arena's run ends when all have arrived
};

/// What there is to listen for.
struct Listening {
  int domain = 0;
  std::string host;                   ///< part of the fleet; empty: all
  std::vector<std::string> services;  ///< that are started there: "camera r1/fisheye", "world"
  ExpectedFrames expected;
};

/// Listens to service/status and prints what people want to know: a progress line on a terminal (rewritten in
/// place) or every few seconds elsewhere, each error once, and who falls silent. A process of its own: a
/// launcher that takes no part in DDS keeps its fleet whatever happens there.
class Progress {
 public:
  /// Forks: to be made while the program has one thread. Throws std::system_error.
  explicit Progress(const Listening& listening);
  ~Progress();  ///< the last line is printed before it returns
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

 private:
  pid_t listener_ = -1;
  int stop_ = -1;  // the listener ends when this end of its pipe is closed
};

/// "120/250 frames per robot, 14.2 frames/s, 9 s left"; of an arena "120 frames per robot (at most 250), …,
/// at most 9 s left". Once the run has ended nothing is left.
std::string progressLine(std::uint64_t done, const ExpectedFrames& expected, double seconds, bool ended);

}  // namespace omnifleet::launch
