#include "markers/pairing.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace omnifleet::markers {
namespace {
constexpr double kLeastCutArea = 0.25;  // share of a patch; a smaller visible part has too little information
}

PatchPairs::PatchPairs(const dataset::MarkerSet& markers, const FinderOptions& options)
    : options_(options),
      team_m_(markers.team_offset_m),
      individual_m_(markers.individual_offset_m),
      size_m_(markers.patch_size_m) {
  colours_.push_back(markers.team);
  for (const auto& [robot, colours] : markers.robots) {
    robots_.push_back(robot);
    colours_.push_back(colours.individual);
  }
}

bool PatchPairs::plausibleArea(const Patch& patch) const {
  const double ratio = patch.area_m2 / area();
  return ratio >= (patch.cut ? kLeastCutArea : options_.min_area_ratio) && ratio <= options_.max_area_ratio;
}

std::optional<Pair> PatchPairs::pair(const std::vector<Patch>& patches, std::size_t team,
                                     std::size_t individual) const {
  const Patch &a = patches[team], &b = patches[individual];
  const Eigen::Vector2d seen = b.centre_m - a.centre_m, known = individual_m_ - team_m_;
  const double deviation = seen.norm() - known.norm();
  if (a.cut && b.cut) return std::nullopt;
  // The centroid of a cut patch is off by up to half its diagonal.
  const double tolerance = options_.distance_tolerance_m + (a.cut || b.cut ? 0.35 * size_m_.norm() : 0.0);
  if (std::abs(deviation) > tolerance) return std::nullopt;

  Pair pair;
  pair.team = team;
  pair.individual = individual;
  Detection& d = pair.detection;
  d.robot = robots_[static_cast<std::size_t>(b.colour) - 2];
  d.team_px = a.centre_px;
  d.individual_px = b.centre_px;
  const double theta = std::atan2(seen.y(), seen.x()) - std::atan2(known.y(), known.x());
  const Eigen::Vector2d middle_in_base = 0.5 * (team_m_ + individual_m_);
  const Eigen::Vector2d origin = 0.5 * (a.centre_m + b.centre_m) - Eigen::Rotation2Dd(theta) * middle_in_base;
  d.map_from_base = {origin.x(), origin.y(), wrapAngle(theta)};

  // Two centroids with σ each: their midpoint has σ/√2, the heading σ√2/distance. The origin rotates about
  // the midpoint.
  const double sigma = options_.pixel_sigma_px * 0.5 * (a.metres_per_px + b.metres_per_px);
  const double middle_variance = 0.5 * sigma * sigma;
  const double theta_variance = 2.0 * sigma * sigma / known.squaredNorm();
  const Eigen::Vector2d lever(middle_in_base.y(), -middle_in_base.x());  // d(origin)/dθ in base_link
  d.covariance.setZero();
  d.covariance.topLeftCorner<2, 2>() =
      middle_variance * Eigen::Matrix2d::Identity() + theta_variance * lever * lever.transpose();
  d.covariance.topRightCorner<2, 1>() = theta_variance * lever;
  d.covariance.bottomLeftCorner<1, 2>() = d.covariance.topRightCorner<2, 1>().transpose();
  d.covariance(2, 2) = theta_variance;
  d.score = std::pow(deviation / tolerance, 2) + std::pow(std::log(a.area_m2 / area()), 2) +
            std::pow(std::log(b.area_m2 / area()), 2);
  return pair;
}

void PatchPairs::find(const std::vector<Patch>& patches, std::vector<Pair>& pairs) const {
  pairs.clear();
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (patches[i].colour != 1 || !plausibleArea(patches[i])) continue;
    for (std::size_t j = 0; j < patches.size(); ++j) {
      if (patches[j].colour < 2 || !plausibleArea(patches[j])) continue;
      if (auto found = pair(patches, i, j)) pairs.push_back(std::move(*found));
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.detection.score, a.team, a.individual) <
           std::tie(b.detection.score, b.team, b.individual);
  });
}

}  // namespace omnifleet::markers
