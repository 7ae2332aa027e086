#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "distance_vector/distance_vector.h"
#include "tests/unit/distance_vector/ray_caster.h"

namespace omnifleet::test {

/// Errors against the truth, by distance.
struct Accuracy {
  struct Band {
    double to_m = 0.0;
    int n = 0;
    double squares = 0.0;     ///< of range errors without outliers, m²
    double normalised = 0.0;  ///< of (error/σ), likewise
    double rms_m() const;
    double normalised_rms() const;
  };
  std::array<Band, 5> bands{{{0.3}, {0.6}, {1.0}, {1.5}, {100.0}}};
  int hits = 0, outliers = 0;    ///< bearings with an edge; errors beyond 5 σ
  int seen = 0, found = 0;       ///< bearings with truth within 1.5 m; of these with an edge
  int wrong_free = 0, free = 0;  ///< floor claimed more than 2 cm + 5 σ beyond the truth; all floor ends
  int invalid = 0;

  void add(const distance_vector::DistanceVector& vector, const RayCaster& caster, const World& world,
           const RobotPose& pose);
  std::string text() const;
};

/// The image, and beside it the floor in green with the boundary: red edges, orange edges without a sub-pixel
/// position, blue ends of the measured floor, yellow undecided columns, magenta no floor at the bottom.
cv::Mat picture(const cv::Mat& image, const distance_vector::DistanceVector& vector);

}  // namespace omnifleet::test
