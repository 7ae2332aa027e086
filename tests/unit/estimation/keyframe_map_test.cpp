// Keyframes: selection of references for a frame, and poses by the graph.
#include "estimation/keyframe_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

using Id = KeyframeMap::Id;

constexpr double kScanSigma = 0.003;  // 1/m
constexpr double kLinkSigma = 0.02;   // m, of the relation between neighbours

Eigen::Matrix3d diagonal(double m, double rad) {
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

scan::LineScan roomScan(const Pose2& pose, std::mt19937& random) {
  scan::LineScan scan;
  scan.fit(scan::testing::furnishedRoom().scan(pose, kScanSigma, random));
  return scan;
}

KeyframeOptions narrow() {
  KeyframeOptions options;
  options.trust_m = 0.05;
  return options;
}

/// Keyframes without scans, related to their predecessors only.
struct BareChain {
  KeyframeMap map;
  std::vector<Pose2> truth;

  explicit BareChain(const KeyframeOptions& options = narrow()) : map(options) {}

  /// @param measured pose of the new keyframe in the one before it
  Id add(const Pose2& pose, const Pose2& measured, double sigma_m = kLinkSigma) {
    KeyframeMap::Held held;
    held.covariance = diagonal(truth.empty() ? 0.001 : sigma_m, truth.empty() ? 0.001 : 0.002);
    if (!truth.empty()) {
      held.previous = static_cast<Id>(map.size() - 1);
      held.previous_from_this = measured;
    }
    const Pose2 start = truth.empty() ? pose : map.pose(*held.previous) * measured;
    truth.push_back(pose);
    return map.add(start, {}, {}, held, {});
  }
  Id add(const Pose2& pose) { return add(pose, truth.empty() ? pose : truth.back().inverse() * pose); }

  double farthest() const {
    double most_m = 0.0;
    for (Id k = 0; k < map.size(); ++k)
      most_m = std::max(most_m, (map.pose(k).translation() - truth[k].translation()).norm());
    return most_m;
  }
};

/// `count` keyframes on a circle; the last one stands beside the first one. @param drift_m of each step,
/// along x of map
BareChain keyframeCircle(int count, const KeyframeOptions& options = narrow(), double drift_m = 0.0) {
  BareChain chain(options);
  for (int k = 0; k < count; ++k) {
    const double angle = 2.0 * M_PI * k / count;
    const Pose2 pose{0.6 * std::cos(angle), 0.6 * std::sin(angle), wrapAngle(angle + 0.5 * M_PI)};
    if (k == 0) {
      chain.add(pose);
      continue;
    }
    const Pose2 off{pose.x_m + drift_m, pose.y_m, pose.theta_rad};
    chain.add(pose, chain.truth.back().inverse() * off);
  }
  return chain;
}

bool contains(const std::vector<Id>& ids, Id id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

TEST(KeyframeMap, ReferencesEndWhereThePathIsTooUncertain) {
  const BareChain chain = keyframeCircle(16);
  const KeyframeMap& map = chain.map;
  const double trust_m2 = map.options().trust_m * map.options().trust_m, link_m2 = kLinkSigma * kLinkSigma;
  for (const Id from : {Id{0}, Id{7}, Id{15}}) {
    for (const double variance_m2 : {0.0, 0.001}) {
      const std::vector<Id> ids = map.references(from, variance_m2, map.pose(from), 100);
      for (Id k = 0; k < map.size(); ++k) {
        const double path_m2 = variance_m2 + link_m2 * std::abs(static_cast<double>(k) - from);
        EXPECT_EQ(contains(ids, k), path_m2 <= trust_m2) << from << " to " << k;
      }
    }
  }
  // The two ends of the open loop are neighbours in space, and no references of each other.
  EXPECT_LT((map.pose(0).translation() - map.pose(15).translation()).norm(), 0.3);
  EXPECT_FALSE(contains(map.references(15, 0.0, map.pose(15), 100), 0));
}

TEST(KeyframeMap, ReferencesTakeTheBestOfSeveralPaths) {
  BareChain chain = keyframeCircle(16);
  const auto isReference = [&](Id k) {
    return contains(chain.map.references(15, 0.0, chain.map.pose(15), 100), k);
  };
  ASSERT_FALSE(isReference(0) || isReference(1));
  chain.map.closeLoop(0, 15, chain.truth[0].inverse() * chain.truth[15], diagonal(kLinkSigma, 0.002));
  EXPECT_TRUE(isReference(0) && isReference(5)) << "six links of 2 cm are 4.9 cm";
  EXPECT_FALSE(isReference(6)) << "seven links are 5.3 cm";
  EXPECT_TRUE(isReference(9));
  EXPECT_FALSE(isReference(8));
}

TEST(KeyframeMap, ReferencesInMapNeedACertainPose) {
  const BareChain chain = keyframeCircle(16);
  const KeyframeMap& map = chain.map;
  const double trust_m2 = map.options().trust_m * map.options().trust_m;
  const auto known = [&](double variance_m2) {
    int count = 0;
    for (Id k = 0; k < map.size(); ++k)
      count += variance_m2 + 0.5 * map.covariance(k).topLeftCorner<2, 2>().trace() <= trust_m2 ? 1 : 0;
    return count;
  };
  ASSERT_GT(known(0.0), known(0.001));
  for (const double variance_m2 : {0.0, 0.001}) {
    const std::vector<Id> ids = map.references(variance_m2, map.pose(0));
    EXPECT_EQ(static_cast<int>(ids.size()), std::min(known(variance_m2), map.options().references));
  }
  EXPECT_TRUE(map.references(1.01 * trust_m2, map.pose(0)).empty());
}

/// Systematic errors and reach follow the noise and the ranges of the scans: twice as large a room has twice
/// as large a reach, and at twice the distance the same share of the noise.
TEST(KeyframeMap, ReachAndSystematicErrorsScaleWithTheScans) {
  const auto mapOf = [](double scale) {
    scan::testing::Scene room = scan::testing::furnishedRoom();
    for (Polygon& outline : room.outlines)
      for (auto& corner : outline) corner *= scale;
    std::mt19937 random(4);
    scan::LineScan scan;
    scan.fit(room.scan({}, kScanSigma / scale, random));  // σ of the range grows in proportion
    KeyframeMap map({});
    map.add({}, {}, scan, {}, {});
    return map;
  };
  const KeyframeMap small = mapOf(1.0), large = mapOf(2.0);
  EXPECT_NEAR(large.reachM(0), 2.0 * small.reachM(0), 0.02 * small.reachM(0));
  for (const double distance_m : {0.0, 0.5, 2.0}) {
    const Eigen::Vector3d a = small.systematic(0, distance_m).diagonal().cwiseSqrt(),
                          b = large.systematic(0, 2.0 * distance_m).diagonal().cwiseSqrt();
    EXPECT_NEAR(b.x(), 2.0 * a.x(), 0.05 * a.x()) << distance_m;
    EXPECT_NEAR(b.z(), a.z(), 0.05 * a.z()) << distance_m;
  }
  EXPECT_GT(small.systematic(0, 1.0)(0, 0), small.systematic(0, 0.0)(0, 0));
}

/// Many matches of one scan are no more certain than one match with a scan without noise.
TEST(KeyframeMap, PairsOfAScanShareItsNoise) {
  KeyframeOptions options;
  options.sigma_share = 0.0;
  options.spacing_m = 0.02;
  const auto sigma2 = [&](int neighbours, unsigned seed) {
    KeyframeMap map(options);
    std::mt19937 random(seed);
    const auto add = [&](const Pose2& pose) {
      KeyframeMap::Held held;
      held.covariance = diagonal(1e-6, 1e-6);
      std::vector<Id> known = map.all();
      if (map.size() < static_cast<std::size_t>(neighbours)) {
        known.clear();  // known absolutely
      } else {
        held.previous = 0;
        held.previous_from_this = map.pose(0).inverse() * pose;
      }
      return map.add(pose, {}, roomScan(pose, random), held, known);
    };
    for (int k = 0; k < neighbours; ++k) add({0.03 * k, 0.0, 0.0});
    return map.covariance(add({0.0, 0.1, 0.0}))(0, 0);
  };
  constexpr unsigned kSeeds = 40;  // each match has a scatter of its own
  double one = 0.0, eight = 0.0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    one += sigma2(1, seed) / kSeeds;
    eight += sigma2(8, seed) / kSeeds;
  }
  EXPECT_LT(eight, one);
  EXPECT_NEAR(eight / one, (1.0 + 1.0 / 8.0) / 2.0, 0.15) << "σ² (1 + 1/n)";
}

TEST(KeyframeMap, NearestAreSortedWithinReach) {
  KeyframeOptions options;
  options.reach = 0.8;
  const BareChain chain = keyframeCircle(16, options);
  const Pose2 at{0.5, 0.1, 0.0};
  const auto distance = [&](Id k) { return (chain.map.pose(k).translation() - at.translation()).norm(); };
  const std::vector<Id> within = chain.map.nearest(at, chain.map.all(), 100);
  EXPECT_TRUE(
      std::is_sorted(within.begin(), within.end(), [&](Id a, Id b) { return distance(a) < distance(b); }));
  for (Id k = 0; k < chain.map.size(); ++k)
    EXPECT_EQ(contains(within, k), distance(k) <= chain.map.reachM(k)) << k;
  ASSERT_GT(within.size(), 6U);
  const std::vector<Id> few = chain.map.nearest(at, chain.map.all(), 3);
  EXPECT_EQ(few, std::vector<Id>(within.begin(), within.begin() + 3));
  EXPECT_EQ(chain.map.nearest(at, chain.map.all()).size(), static_cast<std::size_t>(options.references));
  EXPECT_EQ(chain.map.nearest(at, {3, 2, 14}, 100).size(), 3U) << "only of the candidates";
  EXPECT_TRUE(chain.map.nearest(Pose2{5.0, 0.0, 0.0}, chain.map.all()).empty());
}

TEST(KeyframeMap, UnrelatedAreTheComplementWithinARadius) {
  const BareChain chain = keyframeCircle(16);
  for (const double radius_m : {0.3, 0.9, 5.0}) {
    const Pose2 at = chain.map.pose(15);
    const std::vector<Id> ids = chain.map.unrelated(15, 0.0004, at, radius_m),
                          known = chain.map.references(15, 0.0004, at, 100);
    for (Id k = 0; k < chain.map.size(); ++k) {
      const bool inside = (chain.map.pose(k).translation() - at.translation()).norm() <= radius_m;
      EXPECT_EQ(contains(ids, k), inside && !contains(known, k)) << k << " within " << radius_m << " m";
    }
  }
  EXPECT_TRUE(contains(chain.map.unrelated(15, 0.0, chain.map.pose(15), 0.3), 0)) << "a loop to close";
}

TEST(KeyframeMap, WantsFramesFarFromReferencesWithEnoughLines) {
  std::mt19937 random(1);
  KeyframeOptions options;
  options.spacing_m = 0.25;
  BareChain chain(options);
  chain.add({});
  chain.add({0.5, 0.0, 0.0});
  const scan::LineScan scan = roomScan({}, random);
  EXPECT_TRUE(chain.map.wants(Pose2{0.0, 0.26, 0.0}, {0, 1}, scan));
  EXPECT_FALSE(chain.map.wants(Pose2{0.0, 0.24, 0.0}, {0, 1}, scan));
  EXPECT_FALSE(chain.map.wants(Pose2{0.3, 0.0, 1.0}, {0, 1}, scan)) << "near the second one";
  EXPECT_TRUE(chain.map.wants(Pose2{0.3, 0.0, 1.0}, {0}, scan)) << "which is no reference here";
  EXPECT_TRUE(chain.map.wants(Pose2{}, {}, scan));
  options.min_lines = static_cast<int>(scan.lines());
  EXPECT_TRUE(KeyframeMap(options).wants(Pose2{}, {}, scan));
  ++options.min_lines;
  EXPECT_FALSE(KeyframeMap(options).wants(Pose2{}, {}, scan));
}

/// Keyframes along a path through the room with odometry errors of 3 cm and 1° per step.
KeyframeMap mapped(const std::vector<Pose2>& truth, bool with_pairs, const Pose2& base_from_scan = {}) {
  std::mt19937 random(5);
  KeyframeMap map{KeyframeOptions{}};
  for (std::size_t k = 0; k < truth.size(); ++k) {
    KeyframeMap::Held held;
    held.covariance = k == 0 ? diagonal(0.001, 0.0005) : diagonal(0.03, 0.02);
    const double direction = 2.0 * static_cast<double>(k);
    Pose2 start = truth[k];
    if (k > 0) {
      held.previous = static_cast<Id>(k - 1);
      held.previous_from_this = truth[k - 1].inverse() * truth[k] *
                                Pose2{0.03 * std::cos(direction), 0.03 * std::sin(direction), 0.017};
      start = map.pose(*held.previous) * held.previous_from_this;
    }
    KeyframeMap::Source source;
    source.base_from_scan = base_from_scan;
    map.add(start, source, roomScan(truth[k] * base_from_scan, random), held,
            with_pairs ? map.nearest(start, map.all(), 16) : std::vector<Id>{});
  }
  return map;
}

std::vector<Pose2> pathThroughTheRoom() {
  std::vector<Pose2> path;
  for (int k = 0; k < 10; ++k) {
    const double a = 0.45 * k;
    path.push_back({-0.2 + 0.7 * std::cos(a), 0.6 * std::sin(a) - 0.1, wrapAngle(a)});
  }
  return path;
}

double largestError(const KeyframeMap& map, const std::vector<Pose2>& truth) {
  double most_m = 0.0;
  for (Id k = 0; k < map.size(); ++k)
    most_m = std::max(most_m, (map.pose(k).translation() - truth[k].translation()).norm());
  return most_m;
}

TEST(KeyframeMap, MatchesNewKeyframesAgainstTheirNeighbours) {
  const std::vector<Pose2> truth = pathThroughTheRoom();
  EXPECT_GT(largestError(mapped(truth, false), truth), 0.03) << "odometry alone";
  // Single matches are exact to about 1 mm with this noise (0.003/m).
  EXPECT_LT(largestError(mapped(truth, true), truth), 0.003);
}

TEST(KeyframeMap, AllowsForTheMountOfTheScanner) {
  const std::vector<Pose2> truth = pathThroughTheRoom();
  const Pose2 mount{0.12, -0.08, 0.0};
  const KeyframeMap map = mapped(truth, true, mount);
  EXPECT_LT(largestError(map, truth), 0.003);
  const scan::Reference reference = map.reference(4);
  const Pose2 expected = map.pose(4) * mount;
  EXPECT_LT((reference.map_from_scan.translation() - expected.translation()).norm(), 1e-12);
  EXPECT_GT(reference.scan->lines(), 400U);
}

TEST(KeyframeMap, CorrectsDriftAfterLoopClosure) {
  BareChain chain = keyframeCircle(16, {}, 0.004);
  EXPECT_NEAR(chain.farthest(), 15 * 0.004, 1e-6) << "at the open end";
  const std::uint32_t revision = chain.map.revision();
  chain.map.closeLoop(0, 15, chain.truth[0].inverse() * chain.truth[15], diagonal(0.001, 0.001));
  // All steps have the same σ and the same drift, so the correction is distributed equally. Headings, which
  // are not exact either, take a part of it.
  EXPECT_LT(chain.farthest(), 0.006);
  EXPECT_GT(chain.map.revision(), revision) << "poses moved";
}

TEST(KeyframeMap, CovarianceGrowsAlongAChainAndDecreasesAfterLoopClosure) {
  BareChain chain = keyframeCircle(16);
  const auto variance = [&](Id k) { return chain.map.covariance(k).topLeftCorner<2, 2>().trace(); };
  std::vector<double> open;
  for (Id k = 0; k < chain.map.size(); ++k) open.push_back(variance(k));
  EXPECT_TRUE(std::is_sorted(open.begin(), open.end()));
  EXPECT_GT(open[15], 10.0 * open[1]);
  chain.map.closeLoop(0, 15, chain.truth[0].inverse() * chain.truth[15], diagonal(kLinkSigma, 0.002));
  for (Id k = 1; k < chain.map.size(); ++k) EXPECT_LT(variance(k), open[k]) << k;
  // Two paths of 1 and 15 links in parallel: 15/16 of one link, and little from the headings.
  EXPECT_NEAR(variance(15), 2.0 * 15.0 / 16.0 * kLinkSigma * kLinkSigma, 0.1 * variance(15));
}

}  // namespace
}  // namespace omnifleet::estimation
