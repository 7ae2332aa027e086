#pragma once

#include <string>
#include <vector>

namespace omnifleet::ahmed {

/// Errors of the distances of one method at true distances around `distance_m`.
struct DistanceErrors {
  int count = 0;          ///< bearings
  double median_m = 0.0;  ///< of |error|
  double share90_m = 0.0;
};

struct ErrorCurve {
  std::vector<double> distance_m;                  ///< from base_link, middles of the bins
  std::vector<DistanceErrors> literal, omnifleet;  ///< per bin
  std::string csv() const;  ///< distance_m, then count, median_cm, p90_cm of each method
};

/// Distances of the forward cameras of recordings, by the literal method with a scale and by the default
/// method, compared with the true scene at the true poses: the error of the distance vector alone. Bearings
/// at which the true ray meets a robot are left out. The distance of a bearing begins at base_link, as in
/// eq. 3.
/// @param recordings data sets with truth
/// @param overlays those of the literal method
/// Throws options::Error and std::runtime_error.
ErrorCurve errorCurve(const std::vector<std::string>& recordings, const std::vector<std::string>& overlays);

/// Error over distance, both methods: medians as lines, 90 % as dashed lines.
void drawErrorCurve(const ErrorCurve& curve, const std::string& path);

}  // namespace omnifleet::ahmed
