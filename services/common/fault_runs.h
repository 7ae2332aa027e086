#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace omnifleet::services {

/// What is to be said of frames that are not usable: of several in a row with the same fault (a camera of
/// another size than its calibration) the first, and how many there were when that is over. The status counts
/// each.
class FaultRuns {
 public:
  /// One frame; `fault`: what is wrong, empty where nothing is. `where` names the frame.
  std::vector<std::string> add(const std::string& where, const std::string& fault);
  /// No frame comes any more.
  std::vector<std::string> end();

 private:
  std::string fault_;  ///< of the frames before; empty: they were usable
  std::uint64_t frames_ = 0;
};

}  // namespace omnifleet::services
