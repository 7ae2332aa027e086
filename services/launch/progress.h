#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <thread>

namespace omnifleet::launch {

/// Listens to service/status and prints what people want to know: a progress line on a terminal (rewritten in
/// place) or every few seconds elsewhere, and each error once.
class Progress {
 public:
  /// `total` frames per robot, 0 where unknown; `fleet_name` heads the line.
  Progress(int domain, std::uint64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

 private:
  void listen(int domain);

  std::uint64_t total_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// "  120/250 frames, 14.2 frames/s, 9 s left".
std::string progressLine(std::uint64_t done, std::uint64_t total, double seconds);

}  // namespace omnifleet::launch
