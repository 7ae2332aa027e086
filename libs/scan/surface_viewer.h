#pragma once

#include <Eigen/Core>

#include "scan/map_overlap.h"

namespace omnifleet::scan {

/// What a scan says about a surface at a place.
enum class Says { kNothing, kAgrees, kDenies };

/// A scan with its inverse pose, to look up bearings.
struct Viewer {
  const LineScan* scan;
  Pose2 scan_from_map;

  explicit Viewer(const Reference& reference)
      : scan(reference.scan), scan_from_map(reference.map_from_scan.inverse()) {}

  /// A beam that ends at the surface confirms it. Beams that all pass its place deny it. One that ends before
  /// it says nothing. @param sigma_m of the surface's range along the line of sight
  Says about(const Eigen::Vector2d& map_m, double sigma_m, const OverlapOptions& options) const;
};

/// σ of a beam's range, m.
double rangeSigma(const LineScan::Beam& beam);

/// Beams of a scan from one that is compared to the next.
std::size_t strideOf(const LineScan& scan, const OverlapOptions& options);

/// Whether a beam shows a surface whose place is known well enough to be compared.
bool showsSurface(const LineScan::Beam& beam, const OverlapOptions& options);

}  // namespace omnifleet::scan
