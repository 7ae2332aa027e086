// The topological maps in the folder of a run. The g2o files are read by a reader of the test, everything
// that they cannot hold by appearance::loadMap().

#include "global_merger/place_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "appearance/map_files.h"
#include "tests/test_data.h"
#include "tests/unit/services/global_merger/place_samples.h"

namespace omnifleet::global_merger {
namespace {

namespace fs = std::filesystem;
using test::somePlace;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Key;
using ::testing::SizeIs;

class PlaceFilesOfARun : public ::testing::Test {
 protected:
  void add(const std::string& robot, std::uint32_t count, const std::string& frame, double revision_m = 0.0) {
    for (std::uint32_t i = 0; i < count; ++i) files_.add(somePlace(robot, i, frame, revision_m));
  }
  void save() { EXPECT_THAT(files_.save(out()), IsEmpty()); }
  std::string out() const { return folder_ / "out"; }
  std::string file(const std::string& name) const { return out() + "/" + name; }
  std::map<std::string, std::string> written() const { return test::filesBelow(out()); }
  test::G2oGraph graph(const std::string& name) const { return test::readG2o(file(name)); }

  test::TempFolder folder_;
  PlaceFiles files_;
};

TEST_F(PlaceFilesOfARun, AreNoneWithoutPlaces) {
  save();
  EXPECT_THAT(written(), IsEmpty());
}

TEST_F(PlaceFilesOfARun, LieInTheFolderOfTheirFrame) {
  add("r1", 4, "");
  add("r2", 3, "r2");
  save();
  EXPECT_THAT(written(), ElementsAre(Key("maps/r2/places/r2.g2o"), Key("maps/r2/places/r2.g2o.signatures"),
                                     Key("maps/r2/places/r2.png"), Key("places/r1.g2o"),
                                     Key("places/r1.g2o.signatures"), Key("places/r1.png")));
  EXPECT_FALSE(cv::imread(file("places/r1.png")).empty());
  EXPECT_FALSE(cv::imread(file("maps/r2/places/r2.png")).empty());
}

TEST_F(PlaceFilesOfARun, AreG2oWithImageNumbersAsIds) {
  add("r1", 4, "");
  Place last = somePlace("r1", 3, "");
  last.links.push_back({true, "r1", 0, {-0.3, -0.06, -0.15}, 0.25 * Eigen::Matrix3d::Identity()});
  files_.add(last);
  save();
  const test::G2oGraph graph = this->graph("places/r1.g2o");
  EXPECT_THAT(graph.others, IsEmpty());
  EXPECT_THAT(graph.ids(), ElementsAre(7u, 17u, 27u, 37u));
  EXPECT_THAT(graph.fixed, ElementsAre(7u));
  for (std::size_t i = 0; i < graph.vertices.size(); ++i) {
    const double n = static_cast<double>(i);
    EXPECT_EQ(graph.vertices[i].second, Eigen::Vector3d(0.1 * n, 0.02 * n, 0.05 * n));
  }
  ASSERT_THAT(graph.edges, SizeIs(4));
  for (std::size_t i = 0; i < 4; ++i) {
    const test::G2oGraph::Edge& edge = graph.edges[i];
    const bool loop = i == 3;
    EXPECT_EQ(edge.from, loop ? 37u : test::imageOf(static_cast<std::uint32_t>(i) + 1))
        << "from the later place";
    EXPECT_EQ(edge.to, loop ? 7u : test::imageOf(static_cast<std::uint32_t>(i)));
    // The pose and the inverse of the diagonal covariance.
    const std::vector<double> step{-0.1, 0.01 * static_cast<double>(i + 1), -0.05, 100.0, 0.0, 0.0, 25.0, 0.0,
                                   400.0},
        closing{-0.3, -0.06, -0.15, 4.0, 0.0, 0.0, 4.0, 0.0, 4.0};
    EXPECT_THAT(edge.values, ::testing::Pointwise(::testing::DoubleNear(1e-9), loop ? closing : step));
  }
}

TEST_F(PlaceFilesOfARun, AreReadBackWhole) {
  add("r1", 3, "");
  add("r2", 3, "r2");
  save();
  for (const std::string robot : {"r1", "r2"}) {
    const std::string frame = robot == "r1" ? "" : "r2";
    const auto map = appearance::loadMap(file(robot == "r1" ? "places/r1.g2o" : "maps/r2/places/r2.g2o"));
    EXPECT_EQ(map.robot, robot);
    EXPECT_EQ(map.frame, frame);
    EXPECT_TRUE(map.scale.metric);
    EXPECT_TRUE(map.format == test::smallFormat());
    ASSERT_THAT(map.places, SizeIs(3));
    for (std::uint32_t i = 0; i < 3; ++i) {
      const Place truth = somePlace(robot, i, frame), &got = map.places[i];
      EXPECT_EQ(got.acquired_ns, truth.acquired_ns);
      EXPECT_EQ(got.sequence, truth.sequence);
      EXPECT_EQ(got.frame_from_base.vector(), truth.frame_from_base.vector());
      EXPECT_EQ(got.covariance, truth.covariance);
      EXPECT_EQ(got.signature.bytes, truth.signature.bytes);
      EXPECT_EQ(got.signature.scale, truth.signature.scale);
      EXPECT_THAT(got.links, SizeIs(i > 0 ? 1 : 0));
    }
  }
}

TEST_F(PlaceFilesOfARun, HaveTheRevisedPoses) {
  add("r1", 5, "");
  save();
  const test::G2oGraph before = graph("places/r1.g2o");
  files_.add(somePlace("r1", 2, "", 0.5));
  files_.add(somePlace("r1", 4, "", 0.75));
  save();
  const test::G2oGraph after = graph("places/r1.g2o");
  ASSERT_EQ(after.ids(), before.ids());
  for (std::size_t i = 0; i < after.vertices.size(); ++i) {
    const double moved_m = i == 2 ? 0.5 : i == 4 ? 0.75 : 0.0;
    EXPECT_NEAR(after.vertices[i].second.y() - before.vertices[i].second.y(), moved_m, 1e-12) << i;
  }
  EXPECT_EQ(appearance::loadMap(file("places/r1.g2o")).places.size(), 5u);
}

TEST_F(PlaceFilesOfARun, MoveWithTheFrameOfTheRobot) {
  add("r2", 3, "r2");
  save();
  add("r2", 3, "", 2.0);  // matched: all places again, in map
  save();
  EXPECT_THAT(written(),
              ElementsAre(Key("places/r2.g2o"), Key("places/r2.g2o.signatures"), Key("places/r2.png")));
  EXPECT_FALSE(fs::exists(file("maps/r2/places")));
  EXPECT_NEAR(graph("places/r2.g2o").vertices[1].second.y(), 2.02, 1e-12);
  add("r2", 3, "r2");
  save();
  EXPECT_THAT(written(), ElementsAre(Key("maps/r2/places/r2.g2o"), Key("maps/r2/places/r2.g2o.signatures"),
                                     Key("maps/r2/places/r2.png")));
}

/// The localizer publishes the places of a matched robot a few at a time.
TEST_F(PlaceFilesOfARun, NeverMixFrames) {
  add("r2", 5, "r2");
  files_.add(somePlace("r2", 3, "", 2.0));
  files_.add(somePlace("r2", 4, "", 2.0));
  save();
  const test::G2oGraph graph = this->graph("places/r2.g2o");
  EXPECT_THAT(graph.ids(), ElementsAre(37u, 47u)) << "places that are still in the frame before are left out";
  EXPECT_THAT(graph.edges, SizeIs(1)) << "the link of place 3 ends at a place that is left out";
  EXPECT_EQ(graph.edges[0].from, 47u);
  EXPECT_EQ(graph.edges[0].to, 37u);
  EXPECT_THAT(appearance::loadMap(file("places/r2.g2o")).places, SizeIs(2));
}

TEST_F(PlaceFilesOfARun, LeaveOutPlaceOfAnotherFormat) {
  add("r1", 5, "");
  Place other = somePlace("r1", 2, "");
  other.format.camera = "ring 800x600";
  files_.add(other);
  save();
  const test::G2oGraph graph = this->graph("places/r1.g2o");
  EXPECT_THAT(graph.ids(), ElementsAre(7u, 17u, 37u, 47u));
  ASSERT_THAT(graph.edges, SizeIs(2)) << "1 to 0, 4 to 3";
  EXPECT_EQ(graph.edges[1].from, 47u);
  EXPECT_THAT(appearance::loadMap(file("places/r1.g2o")).places, SizeIs(4));
}

TEST_F(PlaceFilesOfARun, AreWholeAfterALostSample) {
  for (const std::uint32_t index : {2u, 3u, 5u}) files_.add(somePlace("r1", index, ""));
  save();
  const auto map = appearance::loadMap(file("places/r1.g2o"));
  ASSERT_THAT(map.places, SizeIs(3));
  EXPECT_EQ(map.places[2].sequence, test::imageOf(5));
  EXPECT_THAT(map.places[0].links, IsEmpty());
  EXPECT_THAT(map.places[1].links, SizeIs(1));
  EXPECT_THAT(map.places[2].links, IsEmpty());
}

TEST_F(PlaceFilesOfARun, LeaveOutLinksToOtherRobots) {
  add("r1", 2, "");
  Place linked = somePlace("r2", 1, "");
  linked.links.push_back({true, "r1", 0, {0.5, 0.5, 0.5}, Eigen::Matrix3d::Identity()});
  add("r2", 2, "");
  save();
  const std::string picture = dataset::readFile(file("places/r2.png"));
  files_.add(linked);
  save();
  EXPECT_TRUE(dataset::readFile(file("places/r2.png")) == picture);
  ASSERT_THAT(graph("places/r2.g2o").edges, SizeIs(1));
  EXPECT_EQ(graph("places/r2.g2o").edges[0].values[0], -0.1);
  EXPECT_THAT(appearance::loadMap(file("places/r2.g2o")).places[1].links, SizeIs(1));
}

TEST_F(PlaceFilesOfARun, AreMetricOnlyIfAllPlacesAre) {
  add("r1", 3, "");
  Place free = somePlace("r1", 1, "");
  free.metric = false;
  files_.add(free);
  save();
  EXPECT_FALSE(appearance::loadMap(file("places/r1.g2o")).scale.metric);
}

TEST_F(PlaceFilesOfARun, DoNotDependOnTheOrderOfArrival) {
  std::vector<Place> places;
  for (std::uint32_t i = 0; i < 8; ++i) {
    places.push_back(somePlace("r1", i, ""));
    places.push_back(somePlace("r2", i, "r2"));
  }
  for (const Place& place : places) files_.add(place);
  save();
  const auto expected = written();
  ASSERT_THAT(expected, SizeIs(6));
  std::mt19937 random(1);
  for (int run = 0; run < 5; ++run) {
    std::shuffle(places.begin(), places.end(), random);
    PlaceFiles shuffled;
    for (const Place& place : places) shuffled.add(place);
    const std::string other = folder_ / ("run" + std::to_string(run));
    EXPECT_THAT(shuffled.save(other), IsEmpty());
    EXPECT_TRUE(test::filesBelow(other) == expected) << run;
  }
}

TEST_F(PlaceFilesOfARun, ReportWhatCannotBeWrittenAndWriteTheRest) {
  add("r1", 3, "");
  add("r2", 3, "r2");
  fs::create_directories(out());
  std::ofstream(file("places")) << "a user's file\n";
  const std::vector<std::string> problems = files_.save(out());
  ASSERT_THAT(problems, SizeIs(1));
  EXPECT_THAT(problems[0], HasSubstr("out/places"));
  EXPECT_THAT(appearance::loadMap(file("maps/r2/places/r2.g2o")).places, SizeIs(3));
  EXPECT_EQ(dataset::readFile(file("places")), "a user's file\n");
}

TEST_F(PlaceFilesOfARun, AreRemovedWithoutTheFilesOfOthers) {
  add("r1", 3, "");
  add("r2", 3, "");
  save();
  std::ofstream(file("places/notes.txt")) << "a user's notes\n";
  PlaceFiles::remove("r1", file("places"));
  EXPECT_THAT(written(), ElementsAre(Key("places/notes.txt"), Key("places/r2.g2o"),
                                     Key("places/r2.g2o.signatures"), Key("places/r2.png")));
  fs::remove(file("places/notes.txt"));
  PlaceFiles::remove("r2", file("places"));
  EXPECT_FALSE(fs::exists(file("places"))) << "an empty folder goes as well";
}

/// An external localizer may publish places without signatures: no field of their format is set.
TEST_F(PlaceFilesOfARun, AreReadBackWithoutSignatures) {
  for (std::uint32_t i = 0; i < 3; ++i) {
    Place place = somePlace("r1", i, "");
    place.format = {};
    place.signature = {};
    files_.add(place);
  }
  save();
  const auto map = appearance::loadMap(file("places/r1.g2o"));
  EXPECT_EQ(map.format.camera, "");
  ASSERT_THAT(map.places, SizeIs(3));
  EXPECT_EQ(map.places[2].frame_from_base.vector(), somePlace("r1", 2).frame_from_base.vector());
  EXPECT_THAT(map.places[2].signature.bytes, IsEmpty());
}

}  // namespace
}  // namespace omnifleet::global_merger
