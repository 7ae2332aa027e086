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

VoxelCounts::Viewpoint VoxelCounts::viewpointOf(const Applied& what) {
  return {scanOrigin(*what.contribution, what.at), what.contribution->camera_height_dmm,
          directionOf(turnFromDmrad(what.at.theta_dmrad))};
}

bool VoxelCounts::keyOf(const SurfacePoint& point, const Contribution& contribution, const IntegerPose& at,
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

/// Whether the floor that the centre of the voxel would hide was seen, by the rays on both sides of it.
bool VoxelCounts::seesThrough(const Observer& observer, const VoxelKey& key) const {
  const Viewpoint& viewpoint = observer.viewpoint;
  const Applied& what = *observer.what;
  const std::int64_t half = resolution_dmm_ / 2;
  const std::int64_t below = viewpoint.height_dmm - (key.z * resolution_dmm_ + half);
  const std::int64_t x = key.x * resolution_dmm_ + half - viewpoint.foot.x_dmm,
                     y = key.y * resolution_dmm_ + half - viewpoint.foot.y_dmm;
  if (below <= 0 || std::max(std::abs(x), std::abs(y)) >= max_range_dmm_) return false;
  const std::int64_t away = integerSqrt(x * x + y * y);
  const std::int64_t hidden = away * viewpoint.height_dmm / below + resolution_dmm_;  // tolerance of one cell
  if (away == 0 || hidden >= max_range_dmm_) return false;
  const PointDmm in_base =
      unrotate(viewpoint.heading, {static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)});
  const std::size_t rays = what.roles.size();
  if (rays == 0) return false;
  if (bearings_.size() != rays) bearings_ = Bearings(rays);
  const std::size_t before = bearings_.before(in_base);
  for (const std::size_t i : {before, (before + 1) % rays}) {
    if (what.roles[i] == RayRole::kNone || what.roles[i] == RayRole::kHitOnly ||
        what.roles[i] == RayRole::kHitBeyond || rangeOf(*what.contribution, i, what.cuts) <= hidden)
      return false;
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

void VoxelCounts::create(const VoxelKey& key) {
  const auto [voxel, is_new] = voxels_.try_emplace(key);
  if (!is_new) return;
  const std::int64_t half = resolution_dmm_ / 2;
  const auto [column, row] = tileOf(key.x * resolution_dmm_ + half, key.y * resolution_dmm_ + half);
  for (std::int64_t x = column - 1; x <= column + 1; ++x) {
    for (auto tile = observers_.lower_bound({x, row - 1});
         tile != observers_.end() && tile->first <= Tile{x, row + 1}; ++tile) {
      for (const Observer& observer : tile->second)
        if (seesThrough(observer, key)) change(voxel->second, bucketOf(*observer.what), 0, 1);
    }
  }
}

void VoxelCounts::add(const Applied& what) {
  for (const VoxelKey& key : what.voxels) create(key);
  const Observer observer{&what, viewpointOf(what)};
  count(observer, 1);
  observers_[tileOf(observer.viewpoint.foot.x_dmm, observer.viewpoint.foot.y_dmm)].push_back(observer);
}

void VoxelCounts::remove(const Applied& what) {
  const Observer observer{&what, viewpointOf(what)};
  auto& here = observers_[tileOf(observer.viewpoint.foot.x_dmm, observer.viewpoint.foot.y_dmm)];
  const auto found =
      std::find_if(here.begin(), here.end(), [&](const Observer& other) { return other.what == &what; });
  if (found != here.end()) here.erase(found);
  count(observer, -1);
}

/// Adds (`sign` +1) or removes (−1) the hits and misses of a contribution.
void VoxelCounts::count(const Observer& observer, int sign) {
  const Applied& what = *observer.what;
  const auto reach = static_cast<std::int32_t>(max_range_dmm_ / resolution_dmm_ + 1);
  const auto column = static_cast<std::int32_t>(floorDivide(observer.viewpoint.foot.x_dmm, resolution_dmm_)),
             row = static_cast<std::int32_t>(floorDivide(observer.viewpoint.foot.y_dmm, resolution_dmm_));
  auto voxel = voxels_.lower_bound({column - reach, row - reach, INT32_MIN});
  while (voxel != voxels_.end() && voxel->first.x <= column + reach) {
    const VoxelKey& key = voxel->first;
    if (std::abs(key.y - row) > reach) {  // skip to the first row within reach
      voxel = voxels_.lower_bound({key.y < row ? key.x : key.x + 1, row - reach, INT32_MIN});
      continue;
    }
    const bool hit = std::binary_search(what.voxels.begin(), what.voxels.end(), key);
    if (hit || seesThrough(observer, key))
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
