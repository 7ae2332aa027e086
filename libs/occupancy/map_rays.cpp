#include "occupancy/map_rays.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::occupancy {
namespace {

bool isHit(RayLabel label) {
  return isSolid(label) || label == RayLabel::kRobot;
}

}  // namespace

MapRaysOptions MapRaysOptions::read(const options::Section& section) {
  MapRaysOptions o;
  section.read("room_share", o.room_share, {0.0, 1.0});
  section.read("front_room_share", o.front_room_share, {0.0, 1.0});
  section.read("room_frames", o.room_frames, {1, 1000});
  section.read("shared_share", o.shared_share, {0.0, 1.0});
  section.read("front_shared_share", o.front_shared_share, {0.0, 1.0});
  section.finish();
  return o;
}

std::pair<double, double> MapRays::edgeAt(const Boundary& boundary, std::size_t beam) const {
  const scan::LineScan::Beam& fitted = lines_.beams()[beam];
  const Eigen::Vector2f& along = lines_.bearings()[beam];
  double s = static_cast<double>(boundary.inverse_m[beam]);
  double sigma = static_cast<double>(std::max(fitted.sigma, boundary.sigma[beam]));
  if (fitted.has_line && fitted.line.dot(along) > 0.0f) {
    s = static_cast<double>(fitted.line.dot(along));
    const double shared = options_.shared_share * sigma;
    sigma = std::sqrt(std::max(0.0, static_cast<double>(along.dot(fitted.line_covariance * along))) +
                      shared * shared);
  }
  return {1.0 / s, sigma / (s * s)};
}

void MapRays::placeAtEdge(const Scan& scan, std::size_t i, double range_m, double sigma_m, bool moves) {
  constexpr double kSigmas = 2.0, kCell_m = 0.05;  // a cell of the map: closer edges are the same one
  const double before_m = range_m - static_cast<double>(scan.range_m[i]);
  const bool is_hit = isHit(scan.label[i]) || scan.label[i] == RayLabel::kUndecided;
  if (is_hit && before_m > kCell_m + kSigmas * sigma_m) {
    rays_.label[i] = moves || scan.label[i] == RayLabel::kRobot ? RayLabel::kRobot : RayLabel::kUndecided;
    return;
  }
  rays_.range_m[i] = static_cast<float>(range_m);
  rays_.sigma_m[i] = static_cast<float>(sigma_m);
  const bool same = is_hit && -before_m <= kCell_m + kSigmas * sigma_m;
  if (!same || rays_.object[i] == 0) {
    rays_.object[i] = 0;
    rays_.label[i] = RayLabel::kObstacle;
  }
  if (moves) rays_.label[i] = RayLabel::kRobot;
}

const Scan& MapRays::of(const Objects& objects) {
  const Scan& scan = objects.scan;
  const Boundary& boundary = objects.boundary;
  rays_ = scan;
  const std::size_t rays = std::min(
                        {scan.range_m.size(), scan.sigma_m.size(), scan.label.size(), scan.object.size()}),
                    beams = std::min(boundary.inverse_m.size(), boundary.sigma.size());
  if (rays == 0 || beams == 0 || rays > beams) return rays_;
  lines_.fit(boundary);
  const double kept = 1.0 - 1.0 / options_.room_frames;
  structure_ *= kept;
  nothing_ *= kept;
  for (std::size_t i = 0; i < rays; ++i) {
    const std::size_t beam = i * beams / rays;
    const bool has_edge =
        boundary.sigma[beam] > 0 && std::isfinite(boundary.sigma[beam]) && boundary.inverse_m[beam] > 0;
    if (has_edge) {
      const auto [range_m, sigma_m] = edgeAt(boundary, beam);
      placeAtEdge(scan, i, range_m, sigma_m, beam < boundary.moving.size() && boundary.moving[beam] != 0);
    } else if (rays_.label[i] == RayLabel::kObstacle && rays_.object[i] == 0) {
      rays_.label[i] = RayLabel::kUnknown;
    }
    if (rays_.label[i] == RayLabel::kFloorEnd) nothing_ += 1.0;
    if (isHit(rays_.label[i]) && rays_.object[i] == 0) structure_ += 1.0;
  }
  if (structure_ <= options_.room_share * (structure_ + nothing_)) return rays_;
  for (std::size_t i = 0; i < rays; ++i)
    if (rays_.label[i] == RayLabel::kFloorEnd) rays_.label[i] = RayLabel::kInvalid;
  return rays_;
}

}  // namespace omnifleet::occupancy
