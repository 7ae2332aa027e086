#include "scan/transients.h"

#include "scan/surface_viewer.h"

namespace omnifleet::scan {

void Transients::count(const Reference& shown, const Reference& viewer, Counts& counts) const {
  const Viewer other(viewer);
  const auto& beams = shown.scan->beams();
  const std::size_t stride = strideOf(*shown.scan, options_);
  for (std::size_t i = 0, k = 0; i < beams.size(); i += stride, ++k) {
    if (!showsSurface(beams[i], options_)) continue;
    const Says says =
        other.about(shown.map_from_scan * beams[i].point_m.cast<double>(), rangeSigma(beams[i]), options_);
    counts.agree[k] += says == Says::kAgrees ? 1 : 0;
    counts.deny[k] += says == Says::kDenies ? 1 : 0;
  }
}

void Transients::decide(const LineScan& scan, Counts& counts) const {
  const std::size_t stride = strideOf(scan, options_);
  for (std::size_t i = 0, k = 0; i < scan.beams().size(); i += stride, ++k)
    counts.transient[i] = counts.deny[k] > counts.agree[k] ? 1 : 0;
}

void Transients::update(const std::vector<Reference>& scans) {
  const std::size_t known = scans_.size();
  if (scans.size() <= known) return;
  for (std::size_t added = known; added < scans.size(); ++added) {
    const LineScan& scan = *scans[added].scan;
    const std::size_t stride = strideOf(scan, options_),
                      compared = (scan.beams().size() + stride - 1) / stride;
    Counts& counts = scans_.emplace_back();
    counts.agree.assign(compared, 1);
    counts.deny.assign(compared, 0);
    counts.transient.assign(scan.beams().size(), 0);
    for (std::size_t other = 0; other < added; ++other) {
      count(scans[added], scans[other], counts);
      count(scans[other], scans[added], scans_[other]);
    }
  }
  for (std::size_t i = 0; i < scans.size(); ++i) decide(*scans[i].scan, scans_[i]);
}

}  // namespace omnifleet::scan
