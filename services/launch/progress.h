#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

namespace omnifleet::launch {

/// Listens to service/status and prints what people want to know: a progress line on a terminal (rewritten in
/// place) or every few seconds elsewhere, and each error once. A process of its own: a launcher that takes no
/// part in DDS keeps its fleet whatever happens there.
class Progress {
 public:
  /// `total` frames per robot, 0 where unknown. Forks: to be made while the program has one thread. Throws
  /// std::system_error.
  Progress(int domain, std::uint64_t total);
  ~Progress();  ///< the last line is printed before it returns
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

 private:
  pid_t listener_ = -1;
  int stop_ = -1;  // the listener ends when this end of its pipe is closed
};

/// "  120/250 frames, 14.2 frames/s, 9 s left".
std::string progressLine(std::uint64_t done, std::uint64_t total, double seconds);

}  // namespace omnifleet::launch
