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
  double landmark_radius_m = 0.06;  ///< m, radius of the discs that represent named landmarks in the map

  static ObservationOptions read(const options::Section& section);
};

/// Frames of robots that report ranges and bearings instead of images: one per report, and one for every such
/// robot that another one observed at that time, so that an observation connects two poses of the same time.
class ObservationFrames {
 public:
  /// `robots`: the robots without a camera.
  ObservationFrames(std::set<std::string> robots, const ObservationOptions& options)
      : robots_(std::move(robots)), options_(options) {}

  /// All values that a robot reported at one time.
  struct Report {
    std::string robot;
    std::uint32_t sequence = 0;
    std::vector<Measurement> values;
  };

  /// Frames of one time: reporting robots first, in their order. They contain no motion, because the
  /// estimator integrates the wheels itself. Valid until the next call.
  const std::vector<Objects>& framesAt(TimeNs time, const std::vector<const Report*>& reports);

  /// Landmarks in a report, as objects for the map: discs at the places given by the currently calibrated
  /// detector, and the free ray to each. Robots are left out.
  Objects objectsOf(const Report& report, TimeNs time, const estimation::FleetEstimator& estimator,
                    const std::set<std::string>& fleet);

 private:
  Track landmark(const std::string& robot, const Measurement& measurement, const Eigen::Vector2d& at_m);

  std::set<std::string> robots_;
  ObservationOptions options_;
  std::vector<Objects> frames_;
  std::map<std::string, std::map<std::string, std::uint32_t>> ids_;  ///< by robot: track id of each name
};

}  // namespace omnifleet::localizer
