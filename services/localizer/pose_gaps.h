#pragma once

#include <map>
#include <optional>
#include <string>

#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::localizer {

struct PoseGapOptions {
  double least_s = 2.0;        ///< s, shortest gap
  double least_periods = 5.0;  ///< × the frame period of the robot, which may be a few seconds

  static PoseGapOptions read(const options::Section& section);
};

/// Finds the times in which no pose of a robot was published (live): the link to the robot was down, its
/// camera was gone, or no localizer ran.
class PoseGaps {
 public:
  explicit PoseGaps(const PoseGapOptions& options) : options_(options) {}

  /// The last pose that is known from before this localizer began. @param sequence of its frame
  void know(const std::string& robot, TimeNs time_ns, std::uint32_t sequence) {
    last_[robot] = {time_ns, sequence, 0};
  }
  /// A pose is about to be published. @param sequence of its frame
  /// @return the length of the gap before it, s, if there is one
  std::optional<double> gapBefore(const std::string& robot, TimeNs time_ns, std::uint32_t sequence);

 private:
  struct Last {
    TimeNs time_ns = 0;
    std::uint32_t sequence = 0;
    TimeNs period_ns = 0;  ///< the shortest time per frame so far; 0: unknown
  };
  PoseGapOptions options_;
  std::map<std::string, Last> last_;
};

}  // namespace omnifleet::localizer
