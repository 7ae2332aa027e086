#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::localizer {

struct ObservationOptions {
  double landmark_radius_m = 0.06;  ///< m, of the discs that stand for named landmarks in the map

  static ObservationOptions read(const options::Section& section);
};

/// Frames of robots that report ranges and bearings instead of images: one per report, and one for every such
/// robot that another one saw at that time, so that a sighting ties two poses of the same moment.
class ObservationFrames {
 public:
  /// `robots`: those without a camera.
  ObservationFrames(std::set<std::string> robots, const ObservationOptions& options)
      : robots_(std::move(robots)), options_(options) {}

  /// Everything that a robot reported at one time.
  struct Report {
    std::string robot;
    std::uint32_t sequence = 0;
    std::vector<Measurement> values;
  };

  /// The frames of one time, reporting robots first and in their order. Without motion: the estimator
  /// integrates the wheels itself. Valid until the next call.
  const std::vector<Objects>& framesAt(TimeNs time, const std::vector<const Report*>& reports);

  /// What a report shows of landmarks, for the map: discs where the detector, as it is known by now, puts
  /// them, and the free way to each. Robots are left out.
  Objects objectsOf(const Report& report, TimeNs time, const estimation::FleetEstimator& estimator,
                    const std::set<std::string>& fleet);

 private:
  Track landmark(const std::string& robot, const Measurement& measurement, const Eigen::Vector2d& at_m);

  std::set<std::string> robots_;
  ObservationOptions options_;
  std::vector<Objects> frames_;
  std::map<std::string, std::map<std::string, std::uint32_t>> ids_;  ///< track of a name, by robot
};

}  // namespace omnifleet::localizer
