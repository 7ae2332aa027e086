#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "appearance/compass.h"
#include "dataset/dataset.h"
#include "dataset/trajectory_files.h"
#include "evaluation/shape.h"
#include "fleet_in_process/in_process.h"
#include "tests/experiments/fernandez/compass_range.h"
#include "tests/experiments/fernandez/pick.h"
#include "tests/experiments/fernandez/result.h"
#include "tests/raycast/room_recording.h"

namespace omnifleet::fernandez {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

/// A recording of a small decorated room, rendered once: 48 images 10 cm apart.
const std::string& recording() {
  static const std::string kFolder = [] {
    const std::string folder = ::testing::TempDir() + "/omnifleet_fernandez_" + std::to_string(::getpid());
    fs::remove_all(folder);
    raycast::FurnishedOptions options;
    options.seed = 3;
    options.frames = 48;
    options.step_min_m = options.step_max_m = 0.10;
    options.width_px = 640;
    options.height_px = 480;
    options.decorated = options.fast = true;
    raycast::recordFurnished(folder + "/recording", options);
    return folder + "/recording";
  }();
  return kFolder;
}

const ImageSet& images() {
  static const ImageSet kSet = ImageSet::load(recording());
  return kSet;
}

class RemoveRecording : public ::testing::Environment {
 public:
  void TearDown() override { fs::remove_all(fs::path(recording()).parent_path()); }
};
[[maybe_unused]] const auto* const kRemove = ::testing::AddGlobalTestEnvironment(new RemoveRecording);

TEST(FernandezTopology, LiteralMapFollowsEquations2To5) {
  const int k1 = 26, k2 = 20;
  const std::vector<Eigen::Vector2d> map = Relations(images(), Method::kLiteral, 2).layOut(k1, k2);
  ASSERT_EQ(map.size(), 24U);
  // Written out: D over all rows and k1 modules, the turn where the correlation of the phases is highest.
  Eigen::Vector2d at(0.0, 0.0);
  double heading_rad = 0.0;
  for (std::size_t i = 2; i < images().images.size(); i += 2) {
    const appearance::Signature &from = images().images[i - 2].rows, &to = images().images[i].rows;
    double squares = 0.0;
    for (int u = 0; u < 64; ++u)
      for (int v = 0; v < k1; ++v)
        squares += std::pow(double{to.modules(u, v)} - double{from.modules(u, v)}, 2);
    double best = -1e9, turn_rad = 0.0;
    const Eigen::ArrayXXf phases = to.phases(k2) - from.phases(k2);
    for (int column = 0; column < 512; ++column) {
      const double candidate_rad = 2.0 * M_PI * column / 512.0;
      double sum = 0.0;
      for (int u = 0; u < 64; ++u)
        for (int v = 0; v < k2; ++v) sum += std::cos(double{phases(u, v)} - (v + 1) * candidate_rad);
      if (sum > best) {
        best = sum;
        turn_rad = candidate_rad;
      }
    }
    heading_rad += turn_rad;
    at += std::sqrt(squares) * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad));
    // Modules are single precision: 1e-5 of a distance of some grey levels, over 24 steps.
    EXPECT_NEAR((map[i / 2] - at).norm(), 0.0, 1e-3) << i;
  }
}

TEST(FernandezStudy, OmnifleetIsCloserToTruthThanLiteralMethod) {
  const StudyResult result = study(images(), false);
  EXPECT_EQ(result.images, 48);
  EXPECT_NEAR(result.length_m, 4.82, 0.13);  // 47 steps from 10 cm up to the next 0.5 cm of the drive
  ASSERT_EQ(result.odometry.size(), 4U);
  const double literal = at(result, "literal", 1, 64, 64), compass = at(result, "omnifleet", 1, 64, 64),
               wheels = at(result, "omnifleet_wheels", 1, 64, 64);
  EXPECT_GT(literal, 0.0);
  EXPECT_LT(compass, literal);
  EXPECT_LT(wheels, compass);
  EXPECT_LT(wheels, 0.001);  // with true lengths up to 2 %, only headings of the compass are left
  EXPECT_LE(least(result, "literal", 1), literal);
  EXPECT_TRUE(std::isnan(at(result, "literal", 5, 64, 64)));
  EXPECT_TRUE(std::isnan(at(result, "literal", 1, 63, 64)));

  const std::string path = fs::path(recording()).parent_path() / "study.json";
  std::ofstream(path) << result.toJson();
  const StudyResult loaded = StudyResult::load(path);
  EXPECT_EQ(loaded.shape, result.shape);
  EXPECT_EQ(loaded.paths.at("literal").size(), 48U);
  std::ofstream(path) << "{}";
  EXPECT_THROW(StudyResult::load(path), std::runtime_error);
}

TEST(FernandezPaperOverlay, ReplayBuildsTheLiteralMapOfTheStudy) {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  ASSERT_NE(source, nullptr);
  services::InProcessRun run;
  run.dataset = recording();
  run.out = fs::path(recording()).parent_path() / "literal";
  run.overlays = {std::string(source) + "/config/papers/fernandez.yaml"};
  run.log_level = "off";
  services::runInProcess(run);
  std::vector<Eigen::Vector2d> nodes, truth;
  for (const dataset::G2oVertex& vertex : dataset::readG2o(run.out + "/places/r1.g2o").vertices) {
    nodes.push_back(vertex.pose.translation());
    truth.push_back(images().images.at(static_cast<std::size_t>(vertex.id)).truth.translation());
  }
  ASSERT_EQ(nodes.size(), images().images.size());  // every image is a node
  const std::vector<Eigen::Vector2d> expected = Relations(images(), Method::kLiteralMidway, 1).layOut(64, 64);
  // The same equations. The estimator sends D in single precision and solves for the poses, to 0.1 mm per
  // step.
  EXPECT_LT(evaluation::shapeDifference(nodes, expected), 1e-5);
  EXPECT_NEAR(evaluation::shapeDifference(nodes, truth), evaluation::shapeDifference(expected, truth), 1e-4);
}

TEST(FernandezPick, TakesImagesByDifferenceUntilTheNumberIsMet) {
  const std::string out = fs::path(recording()).parent_path() / "picked";
  const Picked picked = pickByDifference(recording(), out, 20);
  EXPECT_NEAR(picked.images, 20, 1);  // the number is a step function of the threshold
  const dataset::Dataset data = dataset::Dataset::open(out);
  EXPECT_EQ(static_cast<int>(data.robots.at(0).fisheye->rows.size()), picked.images);
  EXPECT_FALSE(data.robots.at(0).wheels.empty());
  const ImageSet set = ImageSet::load(out);
  ASSERT_EQ(static_cast<int>(set.images.size()), picked.images);
  for (std::size_t i = 1; i < set.images.size(); ++i)
    EXPECT_GT(appearance::difference(set.images[i - 1].pooled, set.images[i].pooled),
              picked.threshold - 1e-6);
}

ComparedPair pairAt(double distance_m, double error_deg, double confidence) {
  ComparedPair pair;
  pair.distance_m = distance_m;
  pair.omnifleet_error_rad = error_deg * M_PI / 180.0;
  pair.images_error_rad = 2.0 * pair.omnifleet_error_rad;
  pair.literal_error_rad = 10.0 * pair.omnifleet_error_rad;
  pair.confidence = confidence;
  pair.literal_difference = 0.1 * error_deg;
  pair.omnifleet_difference = 0.05 * error_deg;
  return pair;
}

TEST(FernandezCompassRange, BinsHoldQuantilesOfTheirOwnPairs) {
  std::vector<ComparedPair> pairs;
  // Errors of 11, 10, …, 1° at 0.3 to 0.4 m: median 6, 90 % at 10, 10 % at 2. Of these 1 and 2 are below 3°.
  for (int k = 11; k >= 1; --k) pairs.push_back(pairAt(0.3 + 0.009 * (11 - k), k, k <= 3 ? 0.95 : 0.2));
  pairs.push_back(pairAt(0.2999, 50.0, 0.05));
  pairs.push_back(pairAt(0.4, 70.0, 0.1));
  pairs.push_back(pairAt(1.0, 90.0, 0.99));  // beyond the last bin
  RangeOptions options;
  options.most_m = 1.0;
  const std::vector<DistanceBin> bins = binned(pairs, options);
  ASSERT_EQ(bins.size(), 10U);
  const DistanceBin& bin = bins[3];
  constexpr double kRounding = 1e-9;
  EXPECT_NEAR(bin.from_m, 0.3, kRounding);
  EXPECT_NEAR(bin.to_m, 0.4, kRounding);
  EXPECT_EQ(bin.pairs, 11);
  EXPECT_EQ(bin.omnifleet_right, 2);
  EXPECT_EQ(bin.literal_right, 0);  // 10° and more
  EXPECT_EQ(bin.usable, 11);
  EXPECT_EQ(bin.usable_right, 2);
  EXPECT_EQ(bin.sure, 3);
  EXPECT_EQ(bin.sure_right, 2);
  EXPECT_NEAR(bin.omnifleet_deg.low, 2.0, kRounding);
  EXPECT_NEAR(bin.omnifleet_deg.median, 6.0, kRounding);
  EXPECT_NEAR(bin.omnifleet_deg.high, 10.0, kRounding);
  EXPECT_NEAR(bin.images_deg.median, 12.0, kRounding);
  EXPECT_NEAR(bin.literal_deg.high, 100.0, kRounding);
  EXPECT_NEAR(bin.sure_deg.median, 2.0, kRounding);
  EXPECT_NEAR(bin.sure_deg.high, 2.8, kRounding);  // between 2 and 3
  EXPECT_NEAR(bin.literal_difference.low, 0.2, kRounding);
  EXPECT_NEAR(bin.omnifleet_difference.high, 0.5, kRounding);
  EXPECT_EQ(bins[2].pairs, 1);
  EXPECT_EQ(bins[2].usable, 0);
  EXPECT_NEAR(bins[2].omnifleet_deg.median, 50.0, kRounding);
  EXPECT_EQ(bins[4].usable, 1);
  EXPECT_NEAR(bins[4].omnifleet_deg.median, 70.0, kRounding);
  EXPECT_EQ(bins[9].pairs, 0);
  EXPECT_TRUE(std::isnan(bins[9].omnifleet_deg.median));
  EXPECT_THAT(toCsv(bins),
              HasSubstr("\n0.30,0.40,11,0,2,11,2,3,2,60.000,100.000,12.000,20.000,6.000,10.000,2.000,2.800,"
                        "0.2000,0.6000,1.0000,0.1000,0.3000,0.5000\n"));
}

TEST(FernandezCompassRange, DistancesOnAnEdgeBelongToTheUpperBin) {
  for (std::size_t k = 0; k < 30; ++k) {
    EXPECT_EQ(binOf(0.1 * static_cast<double>(k), 0.1), k);
    EXPECT_EQ(binOf(0.1 * static_cast<double>(k) + 0.0999, 0.1), k);
  }
}

TEST(FernandezCompassRange, ChoosesEqualPairsWithinTheBoundsForEqualSeeds) {
  RangeOptions options;
  options.most_m = 0.6;
  options.most_pairs = 20;
  const std::vector<ImagePair> pairs = choosePairs(images(), options);
  EXPECT_EQ(pairs, choosePairs(images(), options));
  std::vector<int> of_bin(6, 0);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    ASSERT_LT(pairs[i].first, pairs[i].second);
    EXPECT_FALSE(i > 0 && pairs[i] == pairs[i - 1]);  // sorted, so equal pairs are neighbours
    const auto at = [&](std::size_t k) { return images().images[k].truth.translation(); };
    const double distance_m = (at(pairs[i].second) - at(pairs[i].first)).norm();
    ASSERT_LT(distance_m, 0.6);
    ++of_bin[binOf(distance_m, 0.1)];
  }
  EXPECT_LE(*std::max_element(of_bin.begin(), of_bin.end()), 20);
  EXPECT_EQ(of_bin[1], 20);  // 47 pairs of successive images are 10 cm apart
  options.seed = 2;
  EXPECT_FALSE(pairs == choosePairs(images(), options));
}

TEST(FernandezCompassRange, ErrorsAndDifferencesGrowWithTheDistance) {
  RangeOptions options;
  options.most_m = 0.9;
  const std::vector<DistanceBin> bins =
      binned(comparePairs(images(), choosePairs(images(), options)), options);
  const DistanceBin &near = bins[1], &far = bins[8];
  ASSERT_GE(near.pairs, 40);
  ASSERT_GE(far.pairs, 20);
  EXPECT_LT(near.omnifleet_deg.median, 0.25);  // as docs/results.md asks per step
  EXPECT_LT(near.omnifleet_deg.median, near.literal_deg.median);
  EXPECT_LT(near.omnifleet_deg.median, far.omnifleet_deg.median);
  EXPECT_LT(near.omnifleet_difference.median, far.omnifleet_difference.median);
  EXPECT_LT(near.literal_difference.median, far.literal_difference.median);
  const std::string path = fs::path(recording()).parent_path() / "range.png";
  drawCompassRange(bins, path);
  EXPECT_GT(fs::file_size(path), 10'000U);
}

TEST(FernandezReport, GivesMedianAndWorstOfEachMethod) {
  std::vector<SeedFigures> seeds(3);
  for (std::size_t k = 0; k < 3; ++k) {
    StudyResult result;
    result.images = 200;
    result.terms = {26, 64};
    result.shape["literal"] = {Surface{{0.5, 0.5}, {0.5, 0.01 * static_cast<double>(k + 1)}}};
    result.odometry = {0.1};
    seeds[k].sets[1].study = result;
    seeds[k].sets[1].runs["omnifleet"] = {0.0003, 0.0004, 0.01, 200};
  }
  const std::string text = report(seeds);
  EXPECT_THAT(text, HasSubstr("3 seeds"));
  EXPECT_THAT(text, HasSubstr("0.02000 (0.03000)"));
  EXPECT_THAT(text, HasSubstr("0.000400 (0.000400)"));
  EXPECT_THAT(text, Not(HasSubstr("nan")));
  EXPECT_THAT(text, Not(HasSubstr("Set 2")));
  EXPECT_THAT(rows(seeds[0]), HasSubstr("0.01000"));
}

}  // namespace
}  // namespace omnifleet::fernandez
