// The overlay of hulls of Choi et al. 2014 §IV.4, compared with the prism fit.

#include <gtest/gtest.h>

#include "merger_scenes.h"
#include "outline/polygon_set.h"

namespace omnifleet::global_merger {
namespace {

using dataset::MapObject;
using namespace testing;  // NOLINT

MergerOptions hulls(double share, std::vector<std::string> observers = {}) {
  MergerOptions options;
  options.method = "hull";
  options.hull_share = share;
  options.observers = std::move(observers);
  return options;
}

/// The object whose outline covers most of a footprint.
const MapObject* covering(const std::vector<MapObject>& objects, const Polygon& footprint) {
  const MapObject* best = nullptr;
  double most = 0.0;
  for (const auto& object : objects) {
    const double shared = outline::area(outline::intersect({object.outline_m}, {footprint}));
    if (shared > most) best = &object, most = shared;
  }
  return best;
}

double areaOf(const std::vector<MapObject>& objects, const Polygon& footprint) {
  const MapObject* object = covering(objects, footprint);
  return object ? signedArea(object->outline_m) : 0.0;
}

TEST(Merger, HullOverlayCoversFootprintAndProjectedTop) {
  auto sim = arena({}, 11);
  const Sets sets = record(sim, 0.0, 4.0);
  Merger literal = merged(sets, sim.bodies(), hulls(0.5)), prism = merged(sets, sim.bodies());
  literal.finish();
  prism.finish();
  EXPECT_EQ(literal.outlines().size(), sim.obstacles().size());
  for (const auto& obstacle : sim.obstacles()) {
    const MapObject* hull = covering(literal.outlines(), obstacle.footprint_m);
    const MapObject* fit = covering(prism.outlines(), obstacle.footprint_m);
    ASSERT_TRUE(hull && fit);
    const double area = signedArea(obstacle.footprint_m);
    // Every exact silhouette contains the footprint, so the region common to any share of them does too, up
    // to the rounding to 0.1 mm.
    EXPECT_GT(outline::area(outline::intersect({hull->outline_m}, {obstacle.footprint_m})), 0.99 * area);
    EXPECT_GT(signedArea(hull->outline_m), 1.05 * area);
    EXPECT_LT(hull->height_m, 1e-9);  // the paper estimates no height
    const Eigen::Vector2d truth = centroid(obstacle.footprint_m);
    EXPECT_LT((fit->centroid_m - truth).norm(), (hull->centroid_m - truth).norm());
  }
}

TEST(Merger, HullOverlayShrinksWithRequiredShare) {
  auto sim = arena({}, 12);
  const Sets sets = record(sim, 0.0, 4.0);
  Merger all = merged(sets, sim.bodies(), hulls(0.0)), half = merged(sets, sim.bodies(), hulls(0.5)),
         common = merged(sets, sim.bodies(), hulls(1.0)),
         one = merged(sets, sim.bodies(), hulls(1.0, {"r1"}));
  for (Merger* merger : {&all, &half, &common, &one}) merger->finish();
  Eigen::Vector3d sums = Eigen::Vector3d::Zero();
  for (const auto& obstacle : sim.obstacles()) {
    const double united = areaOf(all.outlines(), obstacle.footprint_m),
                 most = areaOf(half.outlines(), obstacle.footprint_m),
                 shared = areaOf(common.outlines(), obstacle.footprint_m);
    EXPECT_GE(united, most);  // equal where only one stationary robot sees it
    EXPECT_GE(most, shared);
    sums += Eigen::Vector3d(united, most, shared);
    EXPECT_GT(shared, 0.99 * signedArea(obstacle.footprint_m));
  }
  EXPECT_GT(sums[0], 1.05 * sums[1]);
  EXPECT_GT(sums[1], 1.05 * sums[2]);
  // §IV.4: the maps of other robots remove what one robot cannot see behind objects.
  double by_one = 0.0, by_all = 0.0;
  for (const auto& obstacle : sim.obstacles()) {
    if (areaOf(one.outlines(), obstacle.footprint_m) == 0.0) continue;  // not visible to it
    by_one += areaOf(one.outlines(), obstacle.footprint_m);
    by_all += areaOf(common.outlines(), obstacle.footprint_m);
  }
  EXPECT_GT(by_one, by_all);
}

}  // namespace
}  // namespace omnifleet::global_merger
