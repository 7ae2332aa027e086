#pragma once

#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::dataset {

/// Noise of recorded ranges and bearings, which a recording does not state.
struct ObservationNoise {
  double range_sigma_m = 0.04;       ///< m, σ at range 0
  double range_sigma_per_m = 0.02;   ///< 1, σ added per metre of range
  double bearing_sigma_rad = 0.015;  ///< rad, σ of a bearing

  static ObservationNoise read(const options::Section& section);
};

/// All observations of a robot at one time as one set of measurements (source "observations/<robot>").
std::vector<Measurement> measurementsOf(const std::string& robot, const RangeBearingRow* rows,
                                        std::size_t count, const ObservationNoise& noise);

}  // namespace omnifleet::dataset
