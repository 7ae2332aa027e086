// Rugs, sheets, tape: flat markings are no obstacles.

#include "global_merger/floor_markings.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "merger_scenes.h"

namespace omnifleet::global_merger {
namespace {

using omnifleet::testing::boxPolygon;
using namespace testing;  // NOLINT

int occupiedIn(const Merger& merger, const Polygon& footprint_m) {
  int cells = 0;
  for (double x = -0.2; x < 0.2; x += 0.05)
    for (double y = -0.2; y < 0.2; y += 0.05) {
      const Eigen::Vector2d at_m = centroid(footprint_m) + Eigen::Vector2d(x, y);
      cells +=
          distanceTo(footprint_m, at_m) < 0.05 && merger.map().at(at_m) == occupancy::CellClass::kOccupied;
    }
  return cells;
}

TEST(FloorMarkings, LeaveNoOutlineAndNoOccupiedCells) {
  auto obstacles = fiveObstacles();
  obstacles.push_back({boxPolygon({0.3, 0.35}, 0.35, 0.25, 0.2), 0.002});
  FleetSim sim = arena(noisy(), 21, obstacles);
  Sets sets = record(sim, 0.0, 3.0);
  for (std::size_t i = 0; i < sets.contributions.size();
       i += 4) {  // a piece of the marking, for which nothing can be fitted
    auto& c = sets.contributions[i];
    const auto isMarking = [&](const auto& view) { return view.track_id == obstacles.size(); };
    c.views.erase(std::remove_if(c.views.begin(), c.views.end(), isMarking), c.views.end());
    std::replace(c.object.begin(), c.object.end(), static_cast<std::uint16_t>(obstacles.size()),
                 std::uint16_t{99});
  }
  Merger merger = merged(sets, sim.bodies());
  EXPECT_GT(occupiedIn(merger, obstacles.back().footprint_m), 3) << "not known to be flat before the end";
  merger.finish();
  ASSERT_EQ(merger.rejected().size(), 1U);
  EXPECT_LT((merger.rejected()[0].at_m - centroid(obstacles.back().footprint_m)).norm(), 0.05);
  EXPECT_EQ(merger.rejected()[0].reason, Reason::kFlat);
  EXPECT_EQ(occupiedIn(merger, obstacles.back().footprint_m), 0);
  EXPECT_GT(occupiedIn(merger, obstacles.front().footprint_m), 3);
  const Score s = score(merger.outlines(), fiveObstacles());
  EXPECT_EQ(s.missed, 0);
  EXPECT_EQ(s.extra, 0);
  MergerOptions all;
  all.flat_m = 0.0;
  Merger without = merged(sets, sim.bodies(), all);
  without.finish();
  EXPECT_EQ(score(without.outlines(), obstacles).matched, 6);  // without the rule the marking is mapped
}

/// Tracks of a robot at the origin: one ends in the marking, one slightly before its edge, one half in it,
/// one behind it. One is seen twice: in the marking and, later, elsewhere.
TEST(FloorMarkings, OwnTracksThatAlwaysEndInsideThem) {
  const std::vector<Polygon> markings_m{boxPolygon({1.0, 0.0}, 0.4, 3.0, 0.0)};
  occupancy::ContributionStore store;
  const auto add = [&](TimeNs time_ns, const std::vector<std::pair<std::uint16_t, double>>& tracks) {
    occupancy::Contribution seen;
    seen.robot = "r1";
    seen.acquired_ns = time_ns;
    seen.range_dmm.assign(360, 20000);
    seen.label.assign(360, RayLabel::kFloorEnd);
    seen.object.assign(360, 0);
    std::size_t ray = 0;
    for (const auto& [track, range_m] : tracks) {  // each on two bearings, within 20° of the axis
      for (int k = 0; k < 2; ++k, ++ray) {
        seen.range_dmm[ray] = static_cast<std::int32_t>(range_m * 1e4);
        seen.label[ray] = RayLabel::kObstacle;
        seen.object[ray] = track;
      }
    }
    store.add(seen);
    occupancy::KeyframePose pose;
    pose.robot = "r1";
    pose.acquired_ns = time_ns;
    pose.valid = true;
    store.add(pose);
  };
  add(1, {{1, 0.9}, {2, 0.78}, {3, 1.1}, {3, 1.9}, {4, 1.5}, {5, 1.0}});
  add(2, {{5, 0.5}});
  using Track = std::pair<std::string, std::uint16_t>;
  EXPECT_EQ(tracksOfFloorMarkings(markings_m, store), (std::set<Track>{{"r1", 1}, {"r1", 2}}));
  EXPECT_TRUE(tracksOfFloorMarkings({}, store).empty());
}

}  // namespace
}  // namespace omnifleet::global_merger
