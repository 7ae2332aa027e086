#include "occupancy/camera_correction.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "observation/camera_error.h"

namespace omnifleet::occupancy {
namespace {

std::int32_t rounded(double metres) {
  return static_cast<std::int32_t>(std::lround(metres * kDmmPerMetre));
}

/// Foot, height and error of the camera.
struct Lens {
  Eigen::Vector2d foot_m;
  double seen_height_m;
  CameraError error;
  lens::Spread spread;

  double heightOf() const { return seen_height_m * (1.0 - error(1)); }
  Eigen::Vector2d shift(const Eigen::Vector2d& from_foot_m) const {
    return cameraField(from_foot_m, seen_height_m, spread) * error.head<4>();
  }
  /// Near the horizon the first-order model is not valid.
  bool holds(double shift_m, double away_m) const {
    return std::abs(shift_m) <= 0.25 * (away_m + seen_height_m);
  }
  PointDmm onFloor(const PointDmm& seen) const {
    const Eigen::Vector2d p = metres(seen);
    const Eigen::Vector2d shift_m = shift(p - foot_m);
    if (!holds(shift_m.norm(), (p - foot_m).norm())) return seen;
    return {rounded(p.x() - shift_m.x()), rounded(p.y() - shift_m.y())};
  }
};

void correct(const Lens& lens, SupportView& view) {
  view.position = lens.onFloor(view.position);
  view.contact = lens.onFloor(view.contact);
  std::vector<std::int32_t> corrected = view.b_dmm;
  std::vector<std::size_t> unusable;
  const std::size_t k = std::min(corrected.size(), view.sigma_dmm.size());
  const auto at = [&](std::size_t i) {
    return view.sigma_dmm[i] > 0 ? view.b_dmm[i] / kDmmPerMetre : std::nan("");
  };
  for (std::size_t i = 0; i < k; ++i) {
    if (view.sigma_dmm[i] == 0) continue;
    const CameraError by_error = supportByCameraError({at((i + k - 1) % k), at(i), at((i + 1) % k)}, i, k,
                                                      lens.seen_height_m, lens.spread);
    const double shift_m = by_error.dot(lens.error);
    if (lens.holds(shift_m, std::abs(at(i)))) {
      corrected[i] = rounded(at(i) - shift_m);
    } else {
      unusable.push_back(i);
    }
  }
  view.b_dmm = std::move(corrected);
  for (const std::size_t i : unusable) view.sigma_dmm[i] = 0;
}

void correctRays(const Lens& lens, Contribution& out) {
  const std::size_t rays = std::min(out.range_dmm.size(), out.label.size());
  for (std::size_t i = 0; i < rays; ++i) {
    if (out.range_dmm[i] <= 0) continue;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(rays);
    const Eigen::Vector2d along(std::cos(bearing), std::sin(bearing));
    const double range_m = out.range_dmm[i] / kDmmPerMetre, shift_m = along.dot(lens.shift(range_m * along));
    const bool holds = lens.holds(shift_m, range_m);
    out.range_dmm[i] = holds ? std::max(1, rounded(range_m - shift_m)) : 0;
    if (!holds) out.label[i] = RayLabel::kInvalid;
  }
}

/// Corrects a point that was seen along a ray which meets the floor elsewhere. Its distance below the camera
/// is kept, because it was measured by parallax. Returns false if the corrected position is not valid or
/// exceeds 16 bits.
bool correct(const Lens& lens, SurfacePoint& point) {
  const double below_m = lens.seen_height_m - point.z_dmm / kDmmPerMetre;
  if (!(below_m > 0)) return true;
  const Eigen::Vector2d from_foot = Eigen::Vector2d(point.x_dmm, point.y_dmm) / kDmmPerMetre - lens.foot_m;
  const Eigen::Vector2d on_floor = from_foot * (lens.seen_height_m / below_m);
  const Eigen::Vector2d shift_m = lens.shift(on_floor);
  if (!lens.holds(shift_m.norm(), on_floor.norm())) return false;
  const Eigen::Vector2d p = lens.foot_m + (on_floor - shift_m) * (below_m / lens.heightOf());
  const std::int32_t dmm[3] = {rounded(p.x()), rounded(p.y()), rounded(lens.heightOf() - below_m)};
  if (std::any_of(dmm, dmm + 3, [](std::int32_t value) { return std::abs(value) > 32767; })) return false;
  point.x_dmm = static_cast<std::int16_t>(dmm[0]);
  point.y_dmm = static_cast<std::int16_t>(dmm[1]);
  point.z_dmm = static_cast<std::int16_t>(dmm[2]);
  return true;
}

}  // namespace

Contribution withoutCameraError(const Contribution& seen, const CameraErrorPpm& error,
                                const lens::Spread& spread) {
  Contribution out = seen;
  if (seen.camera_height_dmm <= 0 || error == CameraErrorPpm{}) return out;
  Lens lens{metres(seen.scan_origin), seen.camera_height_dmm / kDmmPerMetre, CameraError::Zero(), spread};
  lens.error.head<4>() = cameraErrorOf(error);
  out.camera_height_dmm = rounded(lens.heightOf());
  for (SupportView& view : out.views) correct(lens, view);
  correctRays(lens, out);
  out.points.clear();
  for (SurfacePoint point : seen.points) {
    if (correct(lens, point)) out.points.push_back(point);
  }
  return out;
}

}  // namespace omnifleet::occupancy
