// Tiles of map/outlines.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bus/topics.h"
#include "global_merger/outline_tiles.h"
#include "global_merger/structure_objects.h"

namespace omnifleet::services {
namespace {

using dataset::MapObject;
using global_merger::RejectedCandidate;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

MapObject box(std::uint64_t id, double x, double y) {
  MapObject object;
  object.id = id;
  object.outline_m = {{x - 0.2, y - 0.2}, {x + 0.2, y - 0.2}, {x + 0.2, y + 0.2}, {x - 0.2, y + 0.2}};
  object.centroid_m = {x, y};
  object.observations = 20;
  object.observers = {"r1", "r2"};
  return object;
}

MapObject wall(int number, double x, double y) {
  MapObject object = box(global_merger::kFirstStructureId + static_cast<std::uint64_t>(number), x, y);
  object.kind = "structure";
  return object;
}

std::vector<std::pair<int, int>> indices(const std::vector<v1::Outlines>& tiles) {
  std::vector<std::pair<int, int>> all;
  for (const v1::Outlines& tile : tiles) all.emplace_back(tile.tile_x(), tile.tile_y());
  return all;
}

TEST(OutlineTiles, ContainTheObjectsWhoseCentroidLiesInThem) {
  OutlineTiles tiles;
  const auto first = tiles.update({box(1, 0.5, 3.9), box(2, -0.1, -4.1), box(3, 3.9, 0.1)},
                                  {RejectedCandidate{{4.0, 0.0}, {}, 3}});
  ASSERT_THAT(indices(first), ElementsAre(std::pair(-1, -2), std::pair(0, 0), std::pair(1, 0)));
  EXPECT_EQ(first[0].objects().at(0).id(), 2u);
  EXPECT_THAT(first[1].objects(), SizeIs(2));
  EXPECT_THAT(first[2].objects(), IsEmpty());
  EXPECT_EQ(first[2].rejected().at(0).observations(), 3u);
  EXPECT_EQ(first[2].tile_m(), 4.0F);
}

TEST(OutlineTiles, ArePublishedOnlyWhenTheirContentChanges) {
  OutlineTiles tiles;
  tiles.update({box(1, 1, 1), box(2, 11, 1)}, {});
  EXPECT_THAT(tiles.update({box(1, 1, 1), box(2, 11, 1)}, {}), IsEmpty());
  EXPECT_THAT(indices(tiles.update({box(1, 1, 1), box(2, 11.001, 1)}, {})), ElementsAre(std::pair(2, 0)));
  EXPECT_THAT(indices(tiles.update({box(1, 1, 1), box(2, 11.001, 1)}, {RejectedCandidate{{1, 1}, {}, 3}})),
              ElementsAre(std::pair(0, 0)));
}

TEST(OutlineTiles, ArePublishedEmptyOnceWhenNothingIsLeft) {
  OutlineTiles tiles;
  tiles.update({box(1, 1, 1), box(2, 11, 1)}, {});
  const auto left = tiles.update({box(1, 1, 1)}, {});
  ASSERT_THAT(indices(left), ElementsAre(std::pair(2, 0)));
  EXPECT_THAT(left[0].objects(), IsEmpty());
  EXPECT_THAT(tiles.update({box(1, 1, 1)}, {}), IsEmpty());
  EXPECT_THAT(indices(tiles.update({box(1, 1, 1), box(2, 11, 1)}, {})), ElementsAre(std::pair(2, 0)));
}

/// Pieces of wall are numbered over the whole map.
TEST(OutlineTiles, StayTheSameWhenAWallElsewhereIsNew) {
  OutlineTiles tiles;
  tiles.update({wall(0, 1, 1), wall(1, 11, 1)}, {});
  const auto changed = tiles.update({wall(0, 1, 1), wall(1, 2, 1), wall(2, 11, 1)}, {});
  ASSERT_THAT(indices(changed), ElementsAre(std::pair(0, 0)));
  EXPECT_EQ(changed[0].objects().at(0).id(), 1'000'000u);
  EXPECT_EQ(changed[0].objects().at(1).id(), 1'000'001u);
}

TEST(OutlineTiles, AreAllPublishedAgainAfterClear) {
  OutlineTiles tiles;
  tiles.update({box(1, 1, 1), box(2, 11, 1), box(3, 21, 1)}, {});
  tiles.update({box(1, 1, 1), box(2, 11, 1)}, {});
  tiles.clear();
  EXPECT_THAT(indices(tiles.update({box(1, 1, 1), box(2, 11, 1)}, {})),
              ElementsAre(std::pair(0, 0), std::pair(2, 0)));
}

/// Ten rooms of 5 x 6 m with 17 objects each, as in the furnished rooms of tests/raycast. A robot changes
/// what it sees in one of them.
TEST(OutlineTiles, OfTenFurnishedRoomsTakeLessThan10kBPerUpdate) {
  std::vector<MapObject> objects;
  const auto add = [&](double x, double y) {
    MapObject object = wall(static_cast<int>(objects.size()), x, y);
    for (int i = 0; i < 4; ++i) object.outline_m.emplace_back(x, y + 0.1 * i);
    objects.push_back(object);
  };
  for (int room = 0; room < 10; ++room)
    for (int i = 0; i < 17; ++i) add(6.0 * room + 0.3 * i + 0.1, 0.35 * i);
  OutlineTiles tiles;
  const auto bytes = [](const std::vector<v1::Outlines>& samples) {
    std::size_t sum = 0;
    for (const v1::Outlines& sample : samples) sum += bus::describe<v1::Outlines>().size(&sample);
    return sum;
  };
  const std::size_t whole = bytes(tiles.update(objects, {}));
  EXPECT_GT(whole, 20'000u);
  for (std::size_t i = 0; i < 17; ++i) objects[i].centroid_m.x() += 0.001;
  EXPECT_LT(bytes(tiles.update(objects, {})), 5'000u);
}

}  // namespace
}  // namespace omnifleet::services
