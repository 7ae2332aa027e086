#pragma once

#include <algorithm>
#include <cstdint>
#include <map>

#include "observation/observation.h"

namespace omnifleet::services {

/// Which poses count where several localizers have published some: those with the greatest term so far. A
/// localizer that was cut off or suspended may publish for a moment after another one has taken over. The new
/// one begins with the frames that the classifiers have kept: it may repeat times that the old one has
/// published.
class NewestTerm {
 public:
  /// @param stream one robot's poses @param time_ns of the frame
  bool accepts(int stream, std::uint32_t term, TimeNs time_ns) {
    newest_ = std::max(newest_, term);
    if (term != newest_) return false;
    const auto [last, is_first] = last_.try_emplace(stream, Last{term, time_ns});
    if (!is_first && last->second.term != term && time_ns <= last->second.time_ns) return false;
    last->second = {term, time_ns};
    return true;
  }

 private:
  struct Last {
    std::uint32_t term;
    TimeNs time_ns;
  };

  std::uint32_t newest_ = 0;
  std::map<int, Last> last_;  ///< accepted pose, by stream
};

}  // namespace omnifleet::services
