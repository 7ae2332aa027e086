#pragma once

#include <map>
#include <optional>
#include <string>

#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::localizer {

struct PoseGapOptions {
  double least_s = 2.0;        ///< s, shortest gap
  double least_periods = 5.0;  ///< × the interval before; robots may publish a frame every few seconds

  static PoseGapOptions read(const options::Section& section);
};

/// Finds the times in which no pose of a robot was published (live): the link to the robot was down, its
/// camera was gone, or no localizer ran.
class PoseGaps {
 public:
  explicit PoseGaps(const PoseGapOptions& options) : options_(options) {}

  /// The last pose that is known from before this localizer began.
  void know(const std::string& robot, TimeNs time_ns) { last_[robot] = {time_ns, 0}; }
  /// A pose is about to be published. @return the length of the gap before it, s, if there is one
  std::optional<double> gapBefore(const std::string& robot, TimeNs time_ns);

 private:
  struct Last {
    TimeNs time_ns = 0, interval_ns = 0;
  };
  PoseGapOptions options_;
  std::map<std::string, Last> last_;
};

}  // namespace omnifleet::localizer
