#include "scan/surface_viewer.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::scan {

double rangeSigma(const LineScan::Beam& beam) {
  return static_cast<double>(beam.sigma) / (static_cast<double>(beam.s) * static_cast<double>(beam.s));
}

std::size_t strideOf(const LineScan& scan, const OverlapOptions& options) {
  return std::max<std::size_t>(1, scan.beams().size() / static_cast<std::size_t>(options.beams));
}

bool showsSurface(const LineScan::Beam& beam, const OverlapOptions& options) {
  return beam.has_line && beam.s > 0 && rangeSigma(beam) < options.most_sigma_m;
}

Says Viewer::about(const Eigen::Vector2d& map_m, double sigma_m, const OverlapOptions& o) const {
  const Eigen::Vector2d at = scan_from_map * map_m;
  const double range_m = at.norm();
  const auto& beams = scan->beams();
  const auto n = static_cast<int>(beams.size());
  if (n == 0 || !(range_m > 0)) return Says::kNothing;
  const int middle = static_cast<int>(std::lround(std::atan2(at.y(), at.x()) * n / (2.0 * M_PI)));
  bool all_pass = true;
  for (int i = middle - o.neighbours; i <= middle + o.neighbours; ++i) {
    const LineScan::Beam& beam = beams[static_cast<std::size_t>(((i % n) + n) % n)];
    if (!(beam.s > 0) || !(beam.sigma > 0)) {
      all_pass = false;
      continue;
    }
    const double other_m = 1.0 / static_cast<double>(beam.s),
                 margin_m = o.sigmas * std::hypot(sigma_m, rangeSigma(beam));
    if (std::abs(other_m - range_m) < o.agree_m + margin_m) return Says::kAgrees;
    all_pass = all_pass && other_m > range_m + o.through_m + margin_m;
  }
  return all_pass ? Says::kDenies : Says::kNothing;
}

}  // namespace omnifleet::scan
