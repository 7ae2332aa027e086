#pragma once

#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::dataset {

/// How well recorded ranges and bearings are known; a recording does not say.
struct ObservationNoise {
  double range_sigma_m = 0.04;       ///< m, at range 0 …
  double range_sigma_per_m = 0.02;   ///< 1, … and added per metre
  double bearing_sigma_rad = 0.015;  ///< rad

  static ObservationNoise read(const options::Section& section);
};

/// All that a robot saw at one time as one set of measurements (source "observations/<robot>").
std::vector<Measurement> measurementsOf(const std::string& robot, const RangeBearingRow* rows,
                                        std::size_t count, const ObservationNoise& noise);

}  // namespace omnifleet::dataset
