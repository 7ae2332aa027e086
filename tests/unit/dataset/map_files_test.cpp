#include "dataset/map_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "dataset/atomic_file.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Objects, ReadsAllPropertiesThatItWrites) {
  const test::TempFolder folder;
  MapObject box;
  box.id = 7;
  box.outline_m = {{0, 0}, {1, 0}, {1, 2}, {0, 2}};
  box.centroid_m = {0.5, 1.0};
  box.observations = 12;
  box.observers = {"r1", "r3"};
  box.height_m = 0.25;
  MapObject robot = box;
  robot.kind = "robot";
  robot.id = 9007199254740993u;  // exceeds the integers of a double
  robot.outline_m = {{0, 0}, {1, 0}, {1, 1}, {1e-9, 1}};
  robot.height_m = 0.0;
  writeObjects(folder / "objects.geojson", {box, robot});
  const std::vector<MapObject> back = readObjects(folder / "objects.geojson");
  ASSERT_EQ(back.size(), 2u);
  EXPECT_EQ(back[0].id, 7u);
  EXPECT_EQ(back[0].outline_m, box.outline_m);
  EXPECT_EQ(back[0].centroid_m, box.centroid_m);
  EXPECT_EQ(back[0].observations, 12);
  EXPECT_EQ(back[0].observers, box.observers);
  EXPECT_EQ(back[0].height_m, 0.25);
  EXPECT_EQ(back[1].kind, "robot");
  EXPECT_EQ(back[1].id, robot.id);
  EXPECT_EQ(back[1].outline_m[3], Eigen::Vector2d(0, 1)) << "coordinates are rounded to 1 µm";
  EXPECT_EQ(objectsText(back), objectsText({box, robot}));
}

TEST(Objects, WritesClosedCounterClockwiseRings) {
  MapObject object;
  object.outline_m = {{0, 0}, {0, 1}, {1, 1}};
  EXPECT_THAT(objectsText({object}), HasSubstr("[[[1.0,1.0],[0.0,1.0],[0.0,0.0],[1.0,1.0]]]"));
  EXPECT_THAT(objectsText({}), HasSubstr("\"features\""));
}

TEST(Objects, ReadsFilesOfOtherProgramsAndRejectsDamage) {
  const test::TempFolder folder;
  writeAtomic(
      folder / "m.geojson",
      R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":null,"geometry":{"type":"Point","coordinates":[1,2]}},
              {"type":"Feature","properties":{"id":"a"},"geometry":{"type":"MultiPolygon","coordinates":
              [[[[0,0],[2,0],[2,2],[0,2],[0,0]]],[[[5,5],[5,6],[6,6],[5,5]]]]}}]})");
  const auto objects = readObjects(folder / "m.geojson");
  ASSERT_EQ(objects.size(), 2u);
  EXPECT_EQ(objects[0].kind, "obstacle");
  EXPECT_EQ(objects[0].centroid_m, Eigen::Vector2d(1, 1));
  EXPECT_GT(signedArea(objects[1].outline_m), 0.0);
  const auto message = [&](const std::string& text) {
    writeAtomic(folder / "d.geojson", text);
    try {
      readObjects(folder / "d.geojson");
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message("{\"type\":\"Feature"), HasSubstr("d.geojson"));
  EXPECT_THAT(message("[1]"), HasSubstr("d.geojson"));
  EXPECT_THAT(message("{\"type\":\"FeatureCollection\"}"), HasSubstr("features"));
  EXPECT_THAT(
      message(
          R"({"type":"FeatureCollection","features":[{"geometry":{"type":"Polygon","coordinates":[[[0,0],[1,"x"]]]}}]})"),
      AllOf(HasSubstr("d.geojson"), HasSubstr("feature 1")));
  EXPECT_THROW(readObjects(folder / "none.geojson"), std::runtime_error);
}

/// An open wall and what is uncertain about a box.
MapObject someStructure() {
  MapObject wall;
  wall.id = 1000000;
  wall.kind = "structure";
  wall.outline_m = {{2, 1}, {0, 1}, {0, 0}};
  wall.centroid_m = {0.6, 0.8};
  wall.observations = 4;
  wall.observers = {"r2"};
  wall.covariance_m2 << 9e-6, 0, 0, 9e-6;
  return wall;
}

TEST(Objects, WritesStructureAsLineStringInItsOrder) {
  const std::string text = objectsText({someStructure()});
  EXPECT_THAT(text, AllOf(HasSubstr(R"("kind":"structure")"),
                          HasSubstr(R"("type":"LineString","coordinates":[[2.0,1.0],[0.0,1.0],[0.0,0.0]])")));
  EXPECT_THAT(text, Not(HasSubstr("Polygon")));
}

TEST(Objects, WritesRejectedCandidatesAsPointsWithTheirReason) {
  const std::string text = objectsText({}, {{{1.5, -0.25}, "few_views", 7}});
  EXPECT_THAT(
      text,
      HasSubstr(
          R"({"type":"Feature","properties":{"kind":"rejected","reason":"few_views","observations":7},"geometry":{"type":"Point","coordinates":[1.5,-0.25]}})"));
}

TEST(Objects, WritesCovarianceAndQualityWhereKnown) {
  MapObject box;
  box.outline_m = {{0, 0}, {1, 0}, {1, 2}, {0, 2}};
  EXPECT_THAT(objectsText({box}), AllOf(Not(HasSubstr("covariance_m2")), Not(HasSubstr("quality"))));
  box.covariance_m2 << 4e-6, -1e-6, -1e-6, 2.5e-5;
  box.quality = {"low_contrast", "thin"};
  EXPECT_THAT(objectsText({box}), AllOf(HasSubstr(R"("covariance_m2":[4e-06,-1e-06,-1e-06,2.5e-05])"),
                                        HasSubstr(R"("quality":["low_contrast","thin"])")));
}

TEST(Objects, ReadsStructureAndSkipsRejectedCandidates) {
  const test::TempFolder folder;
  MapObject box;
  box.id = 7;
  box.outline_m = {{0, 0}, {1, 0}, {1, 2}, {0, 2}};
  writeObjects(folder / "objects.geojson", {box, someStructure()}, {{{1.5, -0.25}, "no_shape", 7}});
  const std::vector<MapObject> back = readObjects(folder / "objects.geojson");
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].kind, "obstacle");
  EXPECT_EQ(back[1].id, 1000000U);
  EXPECT_TRUE(back[1].isOpen());
  EXPECT_EQ(back[1].outline_m, someStructure().outline_m);
  EXPECT_EQ(back[1].observations, 4);
  EXPECT_EQ(back[1].observers, someStructure().observers);
}

TEST(Objects, MeasuresDistancesToOpenAndClosedOutlines) {
  const MapObject wall = someStructure();
  EXPECT_DOUBLE_EQ(wall.distanceTo({1.0, 0.5}), 0.5) << "between the ends there is no line";
  EXPECT_DOUBLE_EQ(wall.distanceTo({2.3, 1.4}), 0.5) << "beyond an end";
  EXPECT_DOUBLE_EQ(wall.distanceTo({0.0, 0.25}), 0.0);
  MapObject closed = wall;
  closed.kind = "obstacle";
  EXPECT_DOUBLE_EQ(closed.distanceTo({0.2, 0.8}), 0.0) << "inside";
}

OccupancyGrid someGrid() {
  OccupancyGrid grid;
  grid.width = 3;
  grid.height = 2;
  grid.resolution_m = 0.05;
  grid.origin_m = {-1.25, 2.5};
  grid.cells = {0, 100, -1, 50, 70, 10};
  return grid;
}

TEST(MapServer, WritesWhatMapServerReads) {
  const test::TempFolder folder;
  writeMapServer(folder / "map", someGrid());
  const cv::Mat image = cv::imread(folder / "map.pgm", cv::IMREAD_UNCHANGED);
  ASSERT_EQ(image.size(), cv::Size(3, 2));
  const std::vector<unsigned char> pixels(image.datastart, image.dataend);
  EXPECT_THAT(pixels, ::testing::ElementsAre(205, 0, 254, 254, 0, 205))
      << "the first row of the image is the last row of the map";
  EXPECT_THAT(readFile(folder / "map.yaml"), AllOf(HasSubstr("image: map.pgm"), HasSubstr("resolution: 0.05"),
                                                   HasSubstr("origin: [-1.25, 2.5, 0]")));
  const OccupancyGrid back = readMapServer(folder / "map.yaml");
  EXPECT_EQ(back.origin_m, someGrid().origin_m);
  EXPECT_THAT(back.cells, ::testing::ElementsAre(0, 100, -1, -1, 100, 0));
}

TEST(MapServer, RejectsInvalidGridAndImage) {
  const test::TempFolder folder;
  OccupancyGrid grid = someGrid();
  grid.cells.pop_back();
  EXPECT_THROW(writeMapServer(folder / "map", grid), std::invalid_argument);
  writeMapServer(folder / "map", someGrid());
  const std::string image = readFile(folder / "map.pgm");
  writeAtomic(folder / "map.pgm", image.substr(0, image.size() - 1));
  EXPECT_THROW(readMapServer(folder / "map.yaml"), std::runtime_error);
  writeAtomic(folder / "map.pgm", "P5\n-3 2\n255\n");
  EXPECT_THROW(readMapServer(folder / "map.yaml"), std::runtime_error);
  writeAtomic(folder / "map.pgm", "P2\n1 1\n255\n0");
  EXPECT_THROW(readMapServer(folder / "map.yaml"), std::runtime_error);
}

}  // namespace
}  // namespace omnifleet::dataset
