#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "figures.h"
#include "seed_run.h"
#include "table.h"

namespace omnifleet::choi {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

TEST(ChoiTable, ComputesSpreadWithoutNaN) {
  const Spread s = Spread::of({1.0, std::nan(""), 2.0, 6.0});
  EXPECT_EQ(s.seeds, 3);
  EXPECT_DOUBLE_EQ(s.mean, 3.0);
  EXPECT_DOUBLE_EQ(s.deviation, std::sqrt(7.0));  // (4 + 1 + 9) / 2
  EXPECT_DOUBLE_EQ(s.min, 1.0);
  EXPECT_DOUBLE_EQ(s.max, 6.0);
  EXPECT_TRUE(std::isnan(Spread::of({}).mean));
}

TEST(ChoiTable, ReportsMeansOverSeedsInCentimetres) {
  std::vector<SeedResult> results(2);
  for (std::size_t i = 0; i < 2; ++i) {
    results[i].seed = static_cast<std::uint32_t>(1000 + i);
    results[i].maps["omnifleet"] = {4, 4, 4, 4, 0.001 + 0.002 * static_cast<double>(i), 0.004, 0.0, 0.9};
    results[i].maps["literal"] = {4, 3, 0, 0, std::nan(""), std::nan(""), std::nan(""), std::nan("")};
    results[i].paths["omnifleet"] = {10, 0.0, 0.0, 0.0123, 0.0};
  }
  const std::string text = report(results);
  EXPECT_THAT(text, HasSubstr("2 seeds (1000 to 1001)"));
  EXPECT_THAT(text, HasSubstr("0.20 (0.14, 0.10-0.30)"));  // x error, omnifleet: 0.1 and 0.3 cm
  EXPECT_THAT(text, HasSubstr("omnifleet, against the exact truth"));
  EXPECT_THAT(text, HasSubstr("1.23"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("nan")));
}

/// Column after `word` in the first line that contains `line_with`.
std::size_t endColumn(const std::string& text, const std::string& line_with, const std::string& word) {
  const std::size_t at = text.find(line_with), begin = text.rfind('\n', at) + 1;
  return text.find(word, begin) + word.size() - begin;
}

TEST(ChoiTable, AlignsMeansWithTheirHeaders) {
  std::vector<SeedResult> results(1);
  results[0].maps["literal"] = {4, 4, 4, 4, 0.1234, 0.1, 0.1, 0.9};
  results[0].maps["omnifleet"] = {4, 4, 4, 4, 0.0567, 0.1, 0.1, 0.9};
  results[0].paths["ceiling"] = {9, 0.1, 0.2, 0.0321, 0.4};
  const std::string text = report(results), row = "x error of centroids";
  EXPECT_EQ(endColumn(text, row, "12.34 "), endColumn(text, "paper  ", "literal") + 1);
  EXPECT_EQ(endColumn(text, row, "5.67 "), endColumn(text, "paper  ", "omnifleet") + 1);
  EXPECT_EQ(endColumn(text, "distance error of the ceiling", "3.21 "),
            endColumn(text, "paper  ", "omnifleet") + 1);
}

TEST(ChoiResult, LoadsWhatWasSaved) {
  SeedResult result;
  result.seed = 7;
  result.settings = "some";
  result.maps["omnifleet"] = {5, 4, 3, 4, 0.01, std::nan(""), 0.03, 0.5};
  result.teams.push_back({"literal", 2, result.maps["omnifleet"]});
  result.paths["omnifleet"] = {9, 0.1, 0.2, 0.3, 0.4};
  result.robots_f1["static omnifleet"] = 0.99;
  const std::string file = ::testing::TempDir() + "/choi_result.json";
  result.save(file);
  const SeedResult back = SeedResult::load(file);
  EXPECT_EQ(back.seed, 7U);
  EXPECT_EQ(back.settings, "some");
  EXPECT_EQ(back.maps.at("omnifleet").paired, 4);
  EXPECT_TRUE(std::isnan(back.maps.at("omnifleet").y_m));
  EXPECT_EQ(back.teams.at(0).robots, 2);
  EXPECT_DOUBLE_EQ(back.teams.at(0).map.iou, 0.5);
  EXPECT_DOUBLE_EQ(back.paths.at("omnifleet").heading_rad, 0.4);
  EXPECT_DOUBLE_EQ(back.robots_f1.at("static omnifleet"), 0.99);
  EXPECT_THROW(SeedResult::load(file + ".missing"), std::runtime_error);
}

/// One seed as in scripts/experiments/choi.sh, with smaller images and a drive of two seconds.
TEST(ChoiExperiment, RunsSmallSeedFromEndToEnd) {
  const fs::path folder = fs::path(::testing::TempDir()) / "choi_experiment";
  fs::remove_all(folder);
  SeedOptions options;
  options.seed = 3;
  options.config = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config";
  options.folder = (folder / "3").string();
  options.figures = (folder / "figures").string();
  options.image_scale = 0.5;
  options.duration_s = 2.0;
  fs::create_directories(options.figures);
  const SeedResult result = runSeed(options, {[](const std::string&) {}});

  const MapScore& omnifleet = result.maps.at("omnifleet");
  EXPECT_EQ(omnifleet.found, omnifleet.truths);
  EXPECT_LT(std::hypot(omnifleet.x_m, omnifleet.y_m),
            0.02);  // half of the resolution; target 0.3 cm per axis
  const MapScore& literal = result.maps.at("literal");
  ASSERT_GT(literal.paired, 0);
  EXPECT_GT(std::hypot(literal.x_m, literal.y_m), std::hypot(omnifleet.x_m, omnifleet.y_m));
  EXPECT_EQ(result.teams.size(), 2U * 7U);                // three robots: seven teams, two methods
  EXPECT_EQ(result.paths.at("omnifleet").poses, 3 * 11);  // two seconds at 5 Hz
  EXPECT_LT(result.paths.at("omnifleet").distance_m, 0.02);
  EXPECT_EQ(result.paths.at("ceiling").poses, 3 * 11);
  EXPECT_LT(result.paths.at("ceiling").distance_m, 0.01);
  EXPECT_EQ(result.paths_ceiling.count("literal"), 1U);

  for (const char* name :
       {"fig04_labelling", "fig05_connection", "fig06_vectors", "fig08_corrected", "fig09_hulls",
        "fig11_information", "fig12_formation", "fig13_global_map", "fig14_static_room", "fig15_r1",
        "fig16_r2", "fig17_r3", "fig18_static_map", "fig20_snapshots", "fig21_paths", "fig22_path_errors"}) {
    const cv::Mat picture = cv::imread(options.figures + "/" + name + ".png");
    ASSERT_FALSE(picture.empty()) << name;
    cv::Scalar mean, deviation;
    cv::meanStdDev(picture, mean, deviation);
    EXPECT_GT(deviation[0], 5.0) << name << " is blank";
  }
  EXPECT_FALSE(fs::exists(folder / "3" / "work"));  // the work folder (hundreds of MB) is deleted
  drawTeams({result}, (folder / "robots.png").string());
  EXPECT_FALSE(cv::imread((folder / "robots.png").string()).empty());
  EXPECT_THAT(report({result}), HasSubstr("3 robots: found, %"));
}

}  // namespace
}  // namespace omnifleet::choi
