#pragma once

#include <optional>
#include <string>
#include <vector>

#include "distance_vector/scale_fit.h"

namespace omnifleet::fit_scale {

struct Options {
  std::string pairs;                   ///< CSV: d_robot_px,d_ceiling_px
  std::string out;                     ///< scale.yaml to write
  std::string plot;                    ///< picture of α over d_r (Fig. 3b); empty: none
  std::string overlay;                 ///< overlay that selects the fit for the literal method; empty: none
  double metres_per_ceiling_px = 0.0;  ///< m, required with an overlay
  std::optional<int> degree;           ///< empty: the degree with the smallest leave-one-out error
  std::vector<double> at_px;           ///< distances to convert with the fit
};

/// Fits α(d_r), writes the file, the overlay and the picture. Throws options::Error for unusable pairs and
/// std::runtime_error if a file cannot be written.
distance_vector::ScaleFit run(const Options& options);

/// One line per pair: d_r, d_c, α, the fit, its residual, and the paper's polynomial with its difference.
std::string table(const distance_vector::ScaleFit& fit);

/// "d_r px -> d_c px" per distance. Throws options::Error that names the interval if a distance lies outside.
std::string converted(const distance_vector::ScaleFit& fit, const std::vector<double>& at_px);

/// Fig. 3b of the paper: α over d_r, the pairs as red dots joined by a red line, the fit in blue inside its
/// interval, the paper's polynomial in grey inside its own. Throws std::runtime_error.
void drawAlpha(const distance_vector::ScaleFit& fit, const std::string& path);

}  // namespace omnifleet::fit_scale
