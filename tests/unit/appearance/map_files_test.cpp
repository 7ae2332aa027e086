#include "appearance/map_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "dataset/atomic_file.h"
#include "tests/test_data.h"
#include "tests/unit/appearance/small_map.h"

namespace omnifleet::appearance {
namespace {

std::string problemOf(const std::string& path) {
  try {
    loadMap(path);
    return "";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

void write(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

class MapFiles : public testing::Test {
 protected:
  void SetUp() override {
    saveMap(path_, test::smallMap(9));
    graph_ = dataset::readFile(path_);
    signatures_ = dataset::readFile(path_ + ".signatures");
  }
  const test::TempFolder folder_;
  const std::string path_ = folder_ / "map.g2o";
  std::string graph_, signatures_;
};

TEST_F(MapFiles, ReturnWhatWasSaved) {
  const TopologicalMap map = test::smallMap(9);
  const SavedMap saved = loadMap(path_);
  EXPECT_EQ(saved.robot, "r1");
  EXPECT_EQ(saved.frame, "r1");
  EXPECT_EQ(saved.format, map.format());
  EXPECT_EQ(saved.scale.metric, map.scale().metric);
  EXPECT_EQ(saved.scale.metres, map.scale().metres);
  EXPECT_EQ(saved.scale.sigma_metres, map.scale().sigma_metres);
  ASSERT_EQ(saved.places.size(), 9u);
  for (std::size_t i = 0; i < saved.places.size(); ++i) {
    const Place &a = saved.places[i], &b = map.places()[i];
    EXPECT_EQ(a.frame_from_base.vector(), b.frame_from_base.vector());
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.acquired_ns, b.acquired_ns);
    EXPECT_EQ(a.sequence, b.sequence);
    EXPECT_EQ(a.metric, b.metric);
    EXPECT_EQ(a.signature.bytes, b.signature.bytes);
    EXPECT_EQ(a.signature.scale, b.signature.scale);
    ASSERT_EQ(a.links.size(), b.links.size());
    for (std::size_t k = 0; k < a.links.size(); ++k) {
      EXPECT_EQ(a.links[k].closes_loop, b.links[k].closes_loop);
      EXPECT_EQ(a.links[k].index, b.links[k].index);
      EXPECT_EQ(a.links[k].this_from_other.vector(), b.links[k].this_from_other.vector());
      // The file has the inverse.
      EXPECT_LT((a.links[k].covariance - b.links[k].covariance).norm(), 1e-9 * b.links[k].covariance.norm());
    }
  }
}

TEST_F(MapFiles, AreG2oText) {
  std::istringstream lines(graph_);
  int vertices = 0, edges = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string tag;
    fields >> tag;
    int numbers = 0;
    for (double value = 0.0; fields >> value;) ++numbers;
    if (tag == "VERTEX_SE2") {
      ++vertices;
      EXPECT_EQ(numbers, 4);
    } else if (tag == "EDGE_SE2") {
      ++edges;
      EXPECT_EQ(numbers, 11);  // two ids, a pose, the upper triangle of its information
    } else if (tag == "FIX") {
      EXPECT_EQ(numbers, 1);
    } else {
      EXPECT_EQ(tag, "#");  // comments
    }
  }
  EXPECT_EQ(vertices, 9);
  EXPECT_EQ(edges, 9);
}

TEST_F(MapFiles, AreRefusedWhenCutShort) {
  for (const bool graph : {true, false}) {
    const std::string file = graph ? path_ : path_ + ".signatures", &whole = graph ? graph_ : signatures_;
    for (std::size_t size = 0; size < whole.size(); size += 1 + size / 40) {
      write(file, whole.substr(0, size));
      ASSERT_THAT(problemOf(path_), testing::HasSubstr("the map is not read")) << file << " " << size;
    }
    for (std::size_t missing = 1; missing < 80; ++missing) {
      write(file, whole.substr(0, whole.size() - missing));
      ASSERT_THAT(problemOf(path_), testing::HasSubstr("the map is not read")) << file << " -" << missing;
    }
    write(file, whole);
  }
  EXPECT_EQ(problemOf(path_), "");
}

TEST_F(MapFiles, AreRefusedWhenOneByteDiffers) {
  for (const bool graph : {true, false}) {
    const std::string file = graph ? path_ : path_ + ".signatures", &whole = graph ? graph_ : signatures_;
    for (std::size_t at = 0; at < whole.size(); at += 7) {
      std::string altered = whole;
      altered[at] = static_cast<char>(altered[at] ^ 1);
      write(file, altered);
      ASSERT_THAT(problemOf(path_), testing::HasSubstr("the map is not read")) << file << " " << at;
    }
    write(file, whole);
  }
}

TEST_F(MapFiles, AreRefusedWhenTheyBelongToDifferentMaps) {
  saveMap(folder_ / "other.g2o", test::smallMap(9, 1));
  std::filesystem::copy_file(folder_ / "other.g2o.signatures", path_ + ".signatures",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(problemOf(path_), testing::HasSubstr("belongs to another map"));
}

TEST_F(MapFiles, NameMissingFile) {
  std::filesystem::remove(path_ + ".signatures");
  EXPECT_THAT(problemOf(path_), testing::HasSubstr("map.g2o.signatures"));
}

TEST(MapPicture, ShowsNodesLinksAndLoops) {
  const TopologicalMap map = test::smallMap(9);
  const cv::Mat3b picture = drawMap(map.places(), 400);
  EXPECT_LE(std::max(picture.cols, picture.rows), 402);
  int red = 0, green = 0;
  for (const cv::Vec3b& p : picture) {
    red += p[2] > 180 && p[0] < 100 && p[1] < 100 ? 1 : 0;    // the loop
    green += p[1] > 140 && p[0] < 100 && p[2] < 100 ? 1 : 0;  // headings
  }
  EXPECT_GT(red, 10);
  EXPECT_GT(green, 9 * 4);
  EXPECT_FALSE(drawMap({}, 400).empty());
}

}  // namespace
}  // namespace omnifleet::appearance
