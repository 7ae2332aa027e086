#include "estimation/boundary_correction.h"

#include <cmath>

#include "geometry/pose2.h"
#include "observation/camera_error.h"

namespace omnifleet::estimation {
namespace {

constexpr float kOneSurface = 0.1f;  // relative difference of two neighbours' ranges on one surface

}  // namespace

void correctBoundary(const Boundary& seen, const Eigen::Vector4d& error, double camera_height_m,
                     const lens::Spread& lens, Boundary& corrected) {
  corrected = seen;
  const std::size_t n = seen.inverse_m.size();
  if (!(camera_height_m > 0) || error.isZero() || n == 0) return;
  const double step = 2.0 * M_PI / static_cast<double>(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double s = static_cast<double>(seen.inverse_m[i]), bearing = step * static_cast<double>(i);
    if (!(s > 0)) continue;
    const Eigen::Vector2d along(std::cos(bearing), std::sin(bearing)),
        p = along / s, there = p - cameraField(p, camera_height_m, lens) * error;
    // Across the bearing the boundary moves along itself: back to the bearing by its slope.
    const float before = seen.inverse_m[(i + n - 1) % n], after = seen.inverse_m[(i + 1) % n];
    const bool smooth = before > 0 && after > 0 && std::abs(after - before) < kOneSurface * seen.inverse_m[i];
    const double slope = smooth ? static_cast<double>(after - before) / (2.0 * step) : 0.0,
                 turned = wrapAngle(std::atan2(there.y(), there.x()) - bearing);
    const double inverse = 1.0 / there.norm() - slope * turned;
    corrected.inverse_m[i] = inverse > 0 ? static_cast<float>(inverse) : 0.0f;
  }
}

scan::BeamFields beamFields(const scan::LineScan& scan, double camera_height_m, const lens::Spread& lens) {
  scan::BeamFields fields;
  if (!(camera_height_m > 0)) return fields;
  fields.assign(scan.beams().size(), Eigen::Matrix<float, 2, 4>::Zero());
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const scan::LineScan::Beam& beam = scan.beams()[i];
    if (beam.has_line)
      fields[i] = cameraField(beam.point_m.cast<double>(), camera_height_m, lens).cast<float>();
  }
  return fields;
}

}  // namespace omnifleet::estimation
