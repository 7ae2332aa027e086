#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "occupancy/bearings.h"
#include "occupancy/voxel_counts.h"

namespace omnifleet::occupancy {
namespace {

/// A contribution at a random pose within 16 m × 8 m, five times the range of its rays.
Applied anywhere(std::mt19937& random, TimeNs time_ns) {
  const auto between = [&](int low, int high) {
    return std::uniform_int_distribution<std::int32_t>(low, high)(random);
  };
  auto contribution = std::make_shared<Contribution>();
  contribution->robot = "r1";
  contribution->acquired_ns = time_ns;
  contribution->camera_height_dmm = 5000;
  contribution->scan_origin = {300, -100};
  Applied what;
  what.at = {{between(-80'000, 80'000), between(-40'000, 40'000)}, between(-31'000, 31'000)};
  for (int i = 0; i < 90; ++i) {
    contribution->range_dmm.push_back(between(5'000, 30'000));
    what.roles.push_back(i % 7 == 0 ? RayRole::kNone : RayRole::kHit);
  }
  what.contribution = contribution;
  const VoxelKey here{what.at.position.x_dmm / 500, what.at.position.y_dmm / 500, 0};
  for (int i = 0; i < 20; ++i)
    what.voxels.push_back({here.x + between(-40, 40), here.y + between(-40, 40), between(1, 6)});
  std::sort(what.voxels.begin(), what.voxels.end());
  what.voxels.erase(std::unique(what.voxels.begin(), what.voxels.end()), what.voxels.end());
  return what;
}

// An existing voxel gets the misses of contributions added later; a new voxel gets the misses of all earlier
// ones. The sums are equal in every order only if none is left out.
TEST(VoxelCounts, IsIndependentOfOrderForDistantRobots) {
  std::mt19937 random(5);
  std::vector<Applied> all;
  for (int i = 0; i < 300; ++i) all.push_back(anywhere(random, i * 400'000'000LL));
  VoxelCounts reference{OccupancyOptions{}};
  for (const Applied& what : all) reference.add(what);
  EXPECT_GT(reference.canonicalBytes().size(), 100'000U);
  std::vector<std::size_t> order(all.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (int round = 0; round < 4; ++round) {
    std::shuffle(order.begin(), order.end(), random);
    VoxelCounts counts{OccupancyOptions{}};
    for (const std::size_t i : order) {
      counts.add(all[i]);
      if (i % 3 == 0) counts.remove(all[i]);
    }
    for (std::size_t i = 0; i < all.size(); i += 3) counts.add(all[i]);
    EXPECT_EQ(counts.canonicalBytes(), reference.canonicalBytes());
    for (const Applied& what : all) counts.remove(what);
    EXPECT_TRUE(counts.empty());
  }
}

TEST(Bearings, FindsLastBearingNotBeyondADirection) {
  std::mt19937 random(8);
  for (const std::uint32_t rays : {1U, 2U, 7U, 90U, 360U, 3600U}) {
    const Bearings bearings(rays);
    std::vector<PointDmm> vectors = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {30'000, -1}, {-30'000, -1}, {7, 7}};
    for (int i = 0; i < 2000; ++i)
      vectors.push_back({static_cast<std::int32_t>(random() % 60'001) - 30'000,
                         static_cast<std::int32_t>(random() % 60'001) - 30'000});
    for (const PointDmm& to : vectors) {
      if (to == PointDmm{}) continue;
      double turn = std::atan2(to.y_dmm, to.x_dmm) / (2.0 * M_PI);
      if (turn < 0.0) turn += 1.0;
      const double ray = turn * rays;
      const auto found = static_cast<double>(bearings.before(to));
      // The error of a direction of 30 bits is less than a thousandth of a ray.
      EXPECT_LE(found, ray + 1e-3) << rays << ": " << to.x_dmm << ", " << to.y_dmm;
      EXPECT_GT(found + 1.0, ray - 1e-3) << rays << ": " << to.x_dmm << ", " << to.y_dmm;
    }
  }
}

}  // namespace
}  // namespace omnifleet::occupancy
