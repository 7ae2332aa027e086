// Places found in exact scans of polygons; the truth is the pose of the simulated scan.
#include "scan/place_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "room_scans.h"

namespace omnifleet::scan {
namespace {

constexpr double kScanNoise = 0.003;  // 1/m
constexpr double kDegree = M_PI / 180.0;

/// The references with their scans.
struct Surveyed {
  std::deque<LineScan> scans;
  std::vector<Reference> references;

  Surveyed(const testing::Scene& scene, const std::vector<Pose2>& poses) {
    std::mt19937 random(99);
    for (const Pose2& pose : poses) {
      scans.emplace_back();
      scans.back().fit(scene.scan(pose, kScanNoise, random, 360));
      references.push_back({&scans.back(), pose});
    }
  }
};

/// Poses in the furnished room, clear of its boxes.
const std::vector<Pose2> kRoomPoses = {{0.0, 0.0, 0.0},  {-1.8, -0.6, 1.0}, {-1.5, 0.8, 2.0},
                                       {1.2, -1.2, 3.0}, {1.9, 1.5, -2.0},  {-0.4, 1.4, -1.0},
                                       {0.2, -1.5, 0.5}, {1.4, 0.3, 1.5}};

LineScan scanAt(const testing::Scene& scene, const Pose2& pose, std::mt19937& random) {
  LineScan scan;
  scan.fit(scene.scan(pose, kScanNoise, random, 360));
  return scan;
}

double distance(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm();
}
double turn(const Pose2& a, const Pose2& b) {
  return std::abs(wrapAngle(a.theta_rad - b.theta_rad));
}

/// Somewhere in the furnished room, at least 0.25 m from everything.
Pose2 somewhere(const testing::Scene& room, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (;;) {
    const Pose2 pose{2.2 * unit(random), 1.7 * unit(random), M_PI * unit(random)};
    double nearest = 10.0;
    for (std::size_t k = 1; k < room.outlines.size(); ++k)
      nearest = std::min(nearest, distanceTo(room.outlines[k], pose.translation()));
    if (nearest > 0.25) return pose;
  }
}

TEST(PlaceSearch, FindsRandomPosesInARoom) {
  const testing::Scene room = testing::furnishedRoom();
  const Surveyed surveyed(room, kRoomPoses);
  PlaceSearch search;
  search.setReferences(surveyed.references);
  std::mt19937 random(1);
  for (int k = 0; k < 20; ++k) {
    const Pose2 truth = somewhere(room, random);
    const auto found = search.search(scanAt(room, truth, random), {0.3, -0.2, 0.5}, 4.0, M_PI);
    ASSERT_FALSE(found.empty()) << k;
    EXPECT_LT(std::abs(found[0].map_from_scan.x_m - truth.x_m), 0.05) << k;  // a cell
    EXPECT_LT(std::abs(found[0].map_from_scan.y_m - truth.y_m), 0.05) << k;
    EXPECT_LT(turn(found[0].map_from_scan, truth), 2.0 * kDegree) << k;
    EXPECT_GT(found[0].score, 0.8) << k;
    EXPECT_GT(found[0].known, 0.9) << k;
    if (found.size() > 1) {
      EXPECT_LT(found[1].score, found[0].score - 0.05)
          << k;  // turned by 180°: the walls fit, the boxes do not
    }
  }
}

TEST(PlaceSearch, ReportsBothPlacesInASymmetricRoom) {
  const testing::Scene rectangle{{{{-2.5, -1.5}, {2.5, -1.5}, {2.5, 1.5}, {-2.5, 1.5}}}};
  const Surveyed surveyed(rectangle, {{0.0, 0.0, 0.0}, {1.5, 0.7, 1.0}, {-1.2, -0.4, 2.0}});
  PlaceSearch search;
  search.setReferences(surveyed.references);
  std::mt19937 random(2);
  const Pose2 truth{0.9, -0.4, 0.7}, turned{-0.9, 0.4, 0.7 - M_PI};
  const auto found = search.search(scanAt(rectangle, truth, random), {}, 4.0, M_PI);
  ASSERT_GE(found.size(), 2U);
  const bool first_is_truth = distance(found[0].map_from_scan, truth) < 1.0;
  const Pose2 &first = first_is_truth ? truth : turned, &second = first_is_truth ? turned : truth;
  EXPECT_LT(distance(found[0].map_from_scan, first), 0.08);
  EXPECT_LT(turn(found[0].map_from_scan, first), 2.0 * kDegree);
  EXPECT_LT(distance(found[1].map_from_scan, second), 0.08);
  EXPECT_LT(turn(found[1].map_from_scan, second), 2.0 * kDegree);
  EXPECT_LT(found[0].score - found[1].score, 0.05);
  for (std::size_t k = 2; k < found.size(); ++k) EXPECT_LT(found[k].score, found[1].score - 0.05) << k;
}

TEST(PlaceSearch, FindsAScanWithFortyPercentOfItsBeamsBlocked) {
  const testing::Scene room = testing::furnishedRoom();
  const Surveyed surveyed(room, kRoomPoses);
  PlaceSearchOptions options;
  options.min_score = 0.4;  // 0.6 of the beams remain, and blocked ones count against the place
  PlaceSearch search(options);
  search.setReferences(surveyed.references);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int k = 0; k < 5; ++k) {
    const Pose2 truth = somewhere(room, random);
    Boundary boundary = room.scan(truth, kScanNoise, random, 360);
    for (float& inverse : boundary.inverse_m)
      if (unit(random) < 0.4) inverse /= static_cast<float>(0.3 + 0.6 * unit(random));
    LineScan scan;
    scan.fit(boundary);
    const auto found = search.search(scan, {}, 4.0, M_PI);
    ASSERT_FALSE(found.empty()) << k;
    EXPECT_LT(distance(found[0].map_from_scan, truth), 0.08) << k;
    EXPECT_LT(turn(found[0].map_from_scan, truth), 3.0 * kDegree) << k;  // steps of 1°, fewer beams
    EXPECT_LT(found[0].score, 0.75) << k << ": the blocked beams count";
  }
}

TEST(PlaceSearch, GivesAScanOfAnotherRoomAClearlyLowerScore) {
  const testing::Scene room = testing::furnishedRoom();
  const Surveyed surveyed(room, kRoomPoses);
  const testing::Scene other{{{{-1.6, -1.2}, {1.6, -1.2}, {2.1, 1.7}, {0.0, 2.6}, {-1.6, 1.4}}}};
  PlaceSearchOptions options;
  options.min_score = 0.4;
  PlaceSearch search(options);
  search.setReferences(surveyed.references);
  std::mt19937 random(4);
  for (int k = 0; k < 3; ++k) {
    const auto own = search.search(scanAt(room, somewhere(room, random), random), {}, 4.0, M_PI);
    const auto strange =
        search.search(scanAt(other, {-0.5 + 0.2 * k, 0.1 * k, 1.0 * k}, random), {}, 4.0, M_PI);
    ASSERT_FALSE(own.empty());
    EXPECT_GT(own[0].score, 0.8) << k;
    if (!strange.empty()) {
      EXPECT_LT(strange[0].score, 0.65) << k;
    }
  }
}

TEST(PlaceSearch, StaysWithinItsReach) {
  const testing::Scene room = testing::furnishedRoom();
  const Surveyed surveyed(room, kRoomPoses);
  PlaceSearchOptions options;
  options.min_score = 0.3;
  options.margin = 0.5;
  PlaceSearch search(options);
  search.setReferences(surveyed.references);
  std::mt19937 random(5);
  const Pose2 truth{-0.6, 0.4, 0.8};
  const LineScan scan = scanAt(room, truth, random);
  const auto check = [&](const Pose2& start, double reach_m, double reach_rad) {
    const auto found = search.search(scan, start, reach_m, reach_rad);
    for (const PlaceCandidate& candidate : found) {
      EXPECT_LE(distance(candidate.map_from_scan, start), reach_m + 1e-9);
      EXPECT_LE(turn(candidate.map_from_scan, start), reach_rad + 1e-9);
    }
    return !found.empty() && distance(found[0].map_from_scan, truth) < 0.08 &&
           turn(found[0].map_from_scan, truth) < 2.0 * kDegree;
  };
  EXPECT_TRUE(check(truth * Pose2{0.5, 0.0, 0.3}, 0.6, 0.4));
  EXPECT_FALSE(check(truth * Pose2{0.5, 0.0, 0.3}, 0.4, 0.4)) << "the truth is farther";
  EXPECT_FALSE(check(truth * Pose2{0.5, 0.0, 0.3}, 0.6, 0.2)) << "the truth is turned more";
  EXPECT_TRUE(check(truth * Pose2{0.01, 0.0, 0.01}, 0.0, 0.0)) << "the start alone";
}

TEST(PlaceSearch, GivesTheSameResultTwice) {
  const testing::Scene room = testing::furnishedRoom();
  const Surveyed surveyed(room, kRoomPoses);
  PlaceSearchOptions options;
  options.margin = 0.3;
  PlaceSearch search(options), reused(options);
  search.setReferences(surveyed.references);
  reused.setReferences({surveyed.references[0]});
  reused.setReferences(surveyed.references);  // the buffers keep nothing of the first references
  std::mt19937 random(6);
  for (int k = 0; k < 3; ++k) {
    const LineScan scan = scanAt(room, somewhere(room, random), random);
    const auto first = search.search(scan, {}, 4.0, M_PI), second = reused.search(scan, {}, 4.0, M_PI);
    ASSERT_EQ(first.size(), second.size());
    ASSERT_FALSE(first.empty());
    for (std::size_t i = 0; i < first.size(); ++i) {
      EXPECT_EQ(first[i].map_from_scan.vector(), second[i].map_from_scan.vector());
      EXPECT_EQ(first[i].score, second[i].score);
    }
  }
}

/// Branch and bound loses no leaf: the best of all leaves, evaluated one by one, is the first candidate. The
/// search centres lie off the true pose, and the search may cut everything just below the best leaf: a bound
/// that is a little too low loses it.
TEST(PlaceSearch, FindsTheBestOfAllLeaves) {
  constexpr int kReach = 6;  // cells
  constexpr double kTurn = 0.2;
  const testing::Scene room = testing::furnishedRoom();
  PlaceSearchOptions options;
  options.beams = options.min_beams = 15;  // few beams: a wrong window of one of them shows
  options.through_weight = 0.0;  // the bounds ignore it: scores are closest to their bounds without it
  constexpr double kRounding = 1e-5;
  // The whole room, and a part of it with much unknown space.
  for (const std::size_t count : {kRoomPoses.size(), std::size_t{1}}) {
    const Surveyed surveyed(room,
                            {kRoomPoses.begin(), kRoomPoses.begin() + static_cast<std::ptrdiff_t>(count)});
    std::mt19937 random(7);
    for (int k = 0; k < 15; ++k) {
      const Pose2 truth = somewhere(room, random), start = truth * Pose2{0.35, 0.1, 0.3};
      const LineScan scan = scanAt(room, truth, random);
      PlaceSearch search(options);
      search.setReferences(surveyed.references);
      const double step = search.headingStep(scan);
      ASSERT_GT(step, 0.0);
      double best = 0.0;
      const int turns = static_cast<int>(kTurn / step);
      for (int h = -turns; h <= turns; ++h) {
        for (int y = -kReach; y <= kReach; ++y) {
          for (int x = -kReach; x <= kReach; ++x) {
            const Pose2 leaf{start.x_m + x * options.cell_m, start.y_m + y * options.cell_m,
                             start.theta_rad + h * step};
            if (x * x + y * y <= kReach * kReach) best = std::max(best, search.evaluate(scan, leaf).score);
          }
        }
      }
      PlaceSearchOptions strict = options;
      strict.min_score = best - kRounding;
      PlaceSearch cutting(strict);
      cutting.setReferences(surveyed.references);
      const auto found = cutting.search(scan, start, (kReach + 1e-6) * options.cell_m, kTurn);
      ASSERT_FALSE(found.empty()) << k << ", best leaf " << best;
      EXPECT_NEAR(found[0].score, best, kRounding) << k;
    }
  }
}

TEST(PlaceSearch, GivesNothingWithoutReferences) {
  std::mt19937 random(8);
  const testing::Scene room = testing::furnishedRoom();
  const LineScan scan = scanAt(room, {}, random), blank;
  PlaceSearch search;
  EXPECT_TRUE(search.empty());
  EXPECT_TRUE(search.search(scan, {}, 4.0, M_PI).empty());
  search.setReferences({});
  EXPECT_TRUE(search.empty());
  search.setReferences({{&blank, {}}, {nullptr, {}}});
  EXPECT_TRUE(search.empty()) << "no beams";
  search.setReferences(Surveyed(room, kRoomPoses).references);  // the scans need not outlive the call
  EXPECT_FALSE(search.empty());
  EXPECT_FALSE(search.search(scan, {}, 4.0, M_PI).empty());
  EXPECT_TRUE(search.search(blank, {}, 4.0, M_PI).empty());
  search.setReferences({});
  EXPECT_TRUE(search.search(scan, {}, 4.0, M_PI).empty()) << "the old grid is gone";
}

TEST(PlaceSearch, IgnoresBeamsAndPosesThatAreNotNumbers) {
  const testing::Scene room = testing::furnishedRoom();
  Surveyed surveyed(room, kRoomPoses);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  surveyed.references.push_back({&surveyed.scans[0], {nan, 0.0, 0.0}});
  PlaceSearch search;
  search.setReferences(surveyed.references);
  std::mt19937 random(9);
  const Pose2 truth{-0.6, 0.4, 0.8};
  Boundary boundary = room.scan(truth, kScanNoise, random, 360);
  for (std::size_t i = 0; i < 360; i += 5) boundary.inverse_m[i] = std::nanf("");
  boundary.inverse_m[1] = std::numeric_limits<float>::infinity();
  boundary.inverse_m[2] = 1e-30f;
  boundary.inverse_m[3] = -1.0f;
  LineScan scan;
  scan.fit(boundary);
  const auto found = search.search(scan, {}, 4.0, M_PI);
  ASSERT_FALSE(found.empty());
  EXPECT_LT(distance(found[0].map_from_scan, truth), 0.08);
  EXPECT_TRUE(search.search(scan, {nan, 0.0, 0.0}, 4.0, M_PI).empty());
  EXPECT_TRUE(search.search(scan, {}, nan, M_PI).empty());
  EXPECT_TRUE(search.search(scan, {1e30, 0.0, 0.0}, 4.0, M_PI).empty());
  EXPECT_EQ(search.evaluate(scan, {0.0, nan, 0.0}).score, 0.0);
}

TEST(PlaceSearch, LowersTheScoreOfBeamsThatPassAWall) {
  // Two rooms side by side; the scan's room is longer than the one that the references saw.
  const testing::Scene shorter{{{{-2.0, -1.5}, {2.0, -1.5}, {2.0, 1.5}, {-2.0, 1.5}}}},
      longer{{{{-2.0, -1.5}, {4.0, -1.5}, {4.0, 1.5}, {-2.0, 1.5}}}};
  const Surveyed surveyed(shorter, {{0.0, 0.0, 0.0}, {1.0, 0.5, 1.0}});
  std::mt19937 random(10);
  const LineScan scan = scanAt(longer, {}, random);
  PlaceSearchOptions options;
  PlaceSearch strict(options);
  options.through_weight = 0.0;
  PlaceSearch tolerant(options);
  strict.setReferences(surveyed.references);
  tolerant.setReferences(surveyed.references);
  // Beams within atan(1.5 / 2) of the long direction pass the wall at x = 2: 20 %.
  EXPECT_GT(tolerant.evaluate(scan, {}).score - strict.evaluate(scan, {}).score, 0.08);
  EXPECT_LT(strict.evaluate(scan, {}).known, 0.85);
  EXPECT_NEAR(strict.evaluate(surveyed.scans[0], {}).score, tolerant.evaluate(surveyed.scans[0], {}).score,
              0.01);
}

TEST(PlaceSearch, GivesNothingBeyondItsLimitOfNodes) {
  const testing::Scene room = testing::furnishedRoom();
  const Surveyed surveyed(room, kRoomPoses);
  std::mt19937 random(11);
  const LineScan scan = scanAt(room, {-0.6, 0.4, 0.8}, random);
  PlaceSearchOptions options;
  options.max_nodes = 1000;
  PlaceSearch search(options);
  search.setReferences(surveyed.references);
  EXPECT_TRUE(search.search(scan, {}, 4.0, M_PI).empty()) << "the roots alone are more";
  EXPECT_FALSE(search.search(scan, {-0.6, 0.4, 0.8}, 0.1, 0.1).empty());
}

TEST(PlaceSearchOptions, NamesAnUnknownKey) {
  const auto section = options::Section::parse("{cell_m: 0.1, most: 2}", "test.yaml");
  const PlaceSearchOptions read = PlaceSearchOptions::read(section);
  EXPECT_EQ(read.cell_m, 0.1);
  EXPECT_EQ(read.most, 2);
  EXPECT_THROW(PlaceSearchOptions::read(options::Section::parse("{cells_m: 0.1}", "test.yaml")),
               options::Error);
  EXPECT_THROW(PlaceSearchOptions::read(options::Section::parse("{levels: 1}", "test.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::scan
