#include "occupancy/voxel_counts.h"

#include <algorithm>
#include <cmath>

#include "occupancy/log_odds.h"

namespace omnifleet::occupancy {

VoxelCounts::VoxelCounts(const OccupancyOptions& options)
    : resolution_dmm_(std::llround(options.resolution_m * 1e4)),
      max_range_dmm_(std::llround(options.max_range_m * 1e4)),
      bucket_ns_(std::llround(options.bucket_s * 1e9)),
      log_hit_(logOdds(options.probability_hit)),
      log_miss_(logOdds(options.probability_miss)),
      log_min_(logOdds(options.clamp_min)),
      log_max_(logOdds(options.clamp_max)),
      least_hits_(options.least_point_hits) {}

/// Where a contribution looks from.
struct VoxelCounts::Eye {
  PointDmm foot;  ///< map
  std::int64_t height_dmm;
  Direction heading;
};

VoxelCounts::Eye VoxelCounts::eyeOf(const Applied& what) const {
  return {scanOrigin(*what.contribution, what.at), what.contribution->camera_height_dmm,
          directionOf(turnFromDmrad(what.at.theta_dmrad))};
}

bool VoxelCounts::keyOf(const SurfacePoint& point, const Contribution& contribution, const Standing& at,
                        VoxelKey& key) const {
  const PointDmm& foot = contribution.scan_origin;
  const std::int64_t x = point.x_dmm - foot.x_dmm, y = point.y_dmm - foot.y_dmm;
  if (point.z_dmm < resolution_dmm_ || x * x + y * y > max_range_dmm_ * max_range_dmm_) return false;
  const PointDmm turned = rotate(directionOf(turnFromDmrad(at.theta_dmrad)), {point.x_dmm, point.y_dmm});
  const auto cell = [&](std::int64_t dmm) {
    return static_cast<std::int32_t>(floorDivide(dmm, resolution_dmm_));
  };
  key = {cell(std::int64_t{at.position.x_dmm} + turned.x_dmm),
         cell(std::int64_t{at.position.y_dmm} + turned.y_dmm), cell(point.z_dmm)};
  return true;
}

/// The last of `rays` bearings 2πi/n that is not beyond the direction of a vector that is not zero.
std::size_t VoxelCounts::rayBefore(const PointDmm& to, std::size_t rays) const {
  if (bearings_.size() != rays) {
    bearings_.clear();
    for (std::uint32_t i = 0; i < rays; ++i)
      bearings_.push_back(directionOf(turnOfBearing(i, static_cast<std::uint32_t>(rays))));
  }
  const bool low = to.y_dmm < 0 || (to.y_dmm == 0 && to.x_dmm < 0);  // in the second half of the turn
  const auto isBeyond = [&](std::size_t i) {
    const Direction& d = bearings_[i];
    if ((2 * i >= rays) != low) return !low;
    return d.cos_q30 * to.y_dmm - d.sin_q30 * to.x_dmm < 0;
  };
  std::size_t first = 0, last = rays;  // bearing 0 never is
  while (last - first > 1) {
    const std::size_t middle = (first + last) / 2;
    (isBeyond(middle) ? last : first) = middle;
  }
  return first;
}

/// The floor that the voxel's middle would hide was seen, by the rays on both sides of it.
bool VoxelCounts::seesThrough(const Eye& eye, const Applied& what, const VoxelKey& key) const {
  const std::int64_t half = resolution_dmm_ / 2;
  const std::int64_t below = eye.height_dmm - (key.z * resolution_dmm_ + half);
  const std::int64_t x = key.x * resolution_dmm_ + half - eye.foot.x_dmm,
                     y = key.y * resolution_dmm_ + half - eye.foot.y_dmm;
  if (below <= 0 || std::max(std::abs(x), std::abs(y)) >= max_range_dmm_) return false;
  const std::int64_t away = integerSqrt(x * x + y * y);
  const std::int64_t hidden = away * eye.height_dmm / below + resolution_dmm_;  // a cell's leeway
  if (away == 0 || hidden >= max_range_dmm_) return false;
  const PointDmm in_base =
      unrotate(eye.heading, {static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)});
  const std::size_t rays = what.roles.size();
  if (rays == 0) return false;
  const std::size_t before = rayBefore(in_base, rays);
  for (const std::size_t i : {before, (before + 1) % rays}) {
    if (what.roles[i] == RayRole::kNone || what.contribution->range_dmm[i] <= hidden) return false;
  }
  return true;
}

void VoxelCounts::change(Counts& counts, std::int64_t bucket, int hits, int misses) {
  auto at = std::lower_bound(counts.begin(), counts.end(), bucket,
                             [](const Count& count, std::int64_t b) { return count.bucket < b; });
  if (at == counts.end() || at->bucket != bucket) at = counts.insert(at, {bucket, 0, 0});
  at->hits += hits;
  at->misses += misses;
  if (at->hits == 0 && at->misses == 0) counts.erase(at);
}

void VoxelCounts::create(const VoxelKey& key, const AppliedSet& all, const Applied* but) {
  const auto [voxel, is_new] = voxels_.try_emplace(key);
  if (!is_new) return;
  for (const auto& [name, other] : all) {
    if (&other != but && seesThrough(eyeOf(other), other, key)) change(voxel->second, bucketOf(other), 0, 1);
  }
}

void VoxelCounts::apply(const Applied& what, int sign, const AppliedSet& all, const Applied* but) {
  if (sign > 0) {
    for (const VoxelKey& key : what.voxels) create(key, all, but);
  }
  const Eye eye = eyeOf(what);
  const auto reach = static_cast<std::int32_t>(max_range_dmm_ / resolution_dmm_ + 1);
  const auto column = static_cast<std::int32_t>(floorDivide(eye.foot.x_dmm, resolution_dmm_));
  auto voxel = voxels_.lower_bound({column - reach, INT32_MIN, INT32_MIN});
  while (voxel != voxels_.end() && voxel->first.x <= column + reach) {
    const VoxelKey& key = voxel->first;
    const bool hit = std::binary_search(what.voxels.begin(), what.voxels.end(), key);
    if (hit || seesThrough(eye, what, key))
      change(voxel->second, bucketOf(what), hit ? sign : 0, hit ? 0 : sign);
    const auto& counts = voxel->second;
    const bool any = sign > 0 || !hit ||
                     std::any_of(counts.begin(), counts.end(), [](const Count& c) { return c.hits > 0; });
    voxel = any ? std::next(voxel) : voxels_.erase(voxel);
  }
}

std::vector<VoxelKey> VoxelCounts::occupied() const {
  std::vector<VoxelKey> keys;
  for (const auto& [key, counts] : voxels_) {
    std::int64_t folded = 0, hits = 0;
    for (const Count& count : counts) {
      hits += count.hits;
      folded = std::clamp<std::int64_t>(
          folded + std::int64_t{count.hits} * log_hit_ + std::int64_t{count.misses} * log_miss_, log_min_,
          log_max_);
    }
    if (folded >= 0 && hits >= least_hits_) keys.push_back(key);
  }
  return keys;
}

std::string VoxelCounts::canonicalBytes() const {
  std::string bytes;
  for (const auto& [key, counts] : voxels_) {
    for (const std::int32_t part : {key.x, key.y, key.z}) putBytes(bytes, part);
    putBytes(bytes, static_cast<std::uint32_t>(counts.size()));
    for (const Count& count : counts) {
      putBytes(bytes, count.bucket);
      putBytes(bytes, count.hits);
      putBytes(bytes, count.misses);
    }
  }
  return bytes;
}

}  // namespace omnifleet::occupancy
