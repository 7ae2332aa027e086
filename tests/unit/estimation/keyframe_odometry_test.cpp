// Wheels and scans have different clocks, which causes independent jitter of each frame. A chain of keyframes
// is simulated with such jitter and compared with closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "estimation/keyframe_map.h"

namespace omnifleet::estimation {
namespace {

using KeyframeId = KeyframeMap::Id;

constexpr double kJitter_rad = 0.02, kJitter_m = 0.004;
constexpr double kWayStep_m = 0.0005, kWayStep_rad = 0.0002;  // σ of the wheels between two keyframes
constexpr double kStart = 1e-4;                               // σ of the first keyframe, m and rad
constexpr int kLinks = 60;

Eigen::Matrix3d squaresOf(double m, double rad) {
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

Pose2 drawn(double m, double rad, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, 1.0);
  const double x = m * normal(random), y = m * normal(random);
  return {x, y, rad * normal(random)};
}

enum class Jitter { kOfFrames, kOfLinks };

/// How jitter enters a chain, and whether matches of neighbours relate its keyframes, too.
struct ChainSetup {
  Jitter jitter = Jitter::kOfFrames;
  std::optional<double> match_rad;  ///< σ of the turns by these matches
};

/// A path of kLinks steps of 0.3 m on a wide arc.
struct OdometryChain {
  KeyframeMap map;
  std::vector<Pose2> truth{Pose2{0.5, -0.3, 0.2}};

  OdometryChain(unsigned seed, const ChainSetup& setup, const KeyframeOptions& options = {}) : map(options) {
    std::mt19937 random(seed);
    map.setJitter(0, squaresOf(kJitter_m, kJitter_rad));
    KeyframeMap::Held first;
    first.covariance = squaresOf(kStart, kStart);
    map.add(truth[0], {}, {}, first, {});
    Pose2 frame_before = truth[0] * drawn(kJitter_m, kJitter_rad, random);
    for (int k = 1; k <= kLinks; ++k) {
      const Pose2 moved{0.3, 0.0, 0.03};
      truth.push_back(truth.back() * moved);
      const Pose2 frame = truth.back() * drawn(kJitter_m, kJitter_rad, random);
      const Pose2 by_wheels = frame_before.inverse() * frame * drawn(kWayStep_m, kWayStep_rad, random);
      const Pose2 by_match = moved * drawn(0.002, setup.match_rad.value_or(0.0), random);
      frame_before = frame;
      add(setup, by_wheels, by_match);
    }
  }

  void add(const ChainSetup& setup, const Pose2& by_wheels, const Pose2& by_match) {
    const auto previous = static_cast<KeyframeId>(map.size() - 1);
    const Eigen::Matrix3d way = squaresOf(kWayStep_m, kWayStep_rad),
                          link = way + 2.0 * squaresOf(kJitter_m, kJitter_rad);
    KeyframeMap::Held held;
    if (setup.jitter == Jitter::kOfFrames) held.odometry = KeyframeMap::Odometry{previous, by_wheels, way};
    if (setup.match_rad) {
      held.previous = previous;
      held.previous_from_this = by_match;
      held.covariance = squaresOf(0.002, *setup.match_rad);
    } else if (setup.jitter == Jitter::kOfLinks) {
      held.previous = previous;
      held.previous_from_this = by_wheels;
      held.covariance = link;
    }
    const KeyframeId id = map.add(map.pose(previous) * by_wheels, {}, {}, held, {});
    if (setup.match_rad && setup.jitter == Jitter::kOfLinks) map.closeLoop(previous, id, by_wheels, link);
  }

  double headingError() const {
    return wrapAngle(map.pose(static_cast<KeyframeId>(kLinks)).theta_rad - truth.back().theta_rad);
  }
  double headingSigma(KeyframeId k = kLinks) const { return std::sqrt(map.covariance(k)(2, 2)); }
};

/// Root mean square over seeds of the heading error at the end, and of the σ that the map states there.
struct EndOfChain {
  double error_rad = 0.0, sigma_rad = 0.0;

  explicit EndOfChain(const ChainSetup& setup) {
    constexpr unsigned kSeeds = 12;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
      const OdometryChain chain(seed, setup);
      error_rad += chain.headingError() * chain.headingError() / kSeeds;
      sigma_rad += chain.headingSigma() * chain.headingSigma() / kSeeds;
    }
    error_rad = std::sqrt(error_rad);
    sigma_rad = std::sqrt(sigma_rad);
  }
};

TEST(KeyframeOdometry, JitterOfFramesDoesNotAddUpInTheCovariance) {
  const OdometryChain frames(1, {}), links(1, {Jitter::kOfLinks, {}});
  for (const KeyframeId k : {KeyframeId{1}, KeyframeId{10}, KeyframeId{kLinks}}) {
    const double way = kStart * kStart + k * kWayStep_rad * kWayStep_rad, jitter = kJitter_rad * kJitter_rad;
    // Those of the first and of this frame; against those of both ends of every link. Robust weights of the
    // solution leave 1 %.
    EXPECT_NEAR(frames.headingSigma(k), std::sqrt(way + 2.0 * jitter), 0.02 * kJitter_rad) << k;
    EXPECT_NEAR(links.headingSigma(k), std::sqrt(way + 2.0 * k * jitter), 0.02 * links.headingSigma(k)) << k;
  }
}

TEST(KeyframeOdometry, JitterCountsTwiceAmongReferencesHoweverManyKeyframesLieBetween) {
  KeyframeOptions options;
  options.trust_m = 2.0 * kJitter_m;  // √2 jitter σ for two frames; √8 for four links
  const OdometryChain frames(1, {}, options), links(1, {Jitter::kOfLinks, {}}, options);
  const auto references = [](const OdometryChain& chain) {
    return chain.map.references(KeyframeId{kLinks}, 0.0, chain.map.pose(kLinks)).size();
  };
  EXPECT_EQ(references(frames), 5U);  // 0 to 1.2 m away; scans without lines reach 1.3 m
  EXPECT_LT(references(links), 4U);
}

TEST(KeyframeOdometry, StatedCovarianceOfAChainMatchesItsErrors) {
  const EndOfChain end({});
  // √2 jitter σ. The rms of 12 errors varies by 20 %.
  EXPECT_NEAR(end.sigma_rad, std::sqrt(2.0) * kJitter_rad, 0.1 * kJitter_rad);
  EXPECT_NEAR(end.error_rad / end.sigma_rad, 1.0, 0.4);
}

/// Matches of neighbours with σ 0.01 rad walk by 0.01·√60 = 0.077 rad: 3.9 jitter σ. The odometry holds them
/// if its jitter is that of frames. In independent links it counts for no more than 2·0.02² against 0.01².
TEST(KeyframeOdometry, HoldsTheHeadingOfAChainOfMatches) {
  const EndOfChain frames({Jitter::kOfFrames, 0.01}), links({Jitter::kOfLinks, 0.01});
  EXPECT_LT(frames.error_rad, 1.3 * kJitter_rad);
  EXPECT_GT(links.error_rad, 2.5 * frames.error_rad);
  EXPECT_NEAR(frames.error_rad / frames.sigma_rad, 1.0, 0.4);
  EXPECT_LT(frames.sigma_rad, 0.4 * links.sigma_rad);
}

TEST(KeyframeOdometry, JitterLearntLaterAppliesToEarlierKeyframes) {
  OdometryChain chain(1, {});
  chain.map.setJitter(0, squaresOf(0.1 * kJitter_m, 0.1 * kJitter_rad));
  chain.map.setJitter(1, squaresOf(10.0, 1.0));  // another robot's
  chain.map.closeLoop(0, 1, chain.map.pose(0).inverse() * chain.map.pose(1), squaresOf(10.0, 10.0));
  const double way = kStart * kStart + kLinks * kWayStep_rad * kWayStep_rad;
  const double expected = std::sqrt(way + 0.02 * kJitter_rad * kJitter_rad);
  EXPECT_NEAR(chain.headingSigma(), expected, 0.1 * expected);
}

TEST(KeyframeOdometry, ReferencesEndWhereOdometryIsTooUncertain) {
  KeyframeOptions options;
  options.reach = 100.0;
  options.trust_m = 0.01;
  KeyframeMap map(options);
  KeyframeMap::Held held;
  held.covariance = squaresOf(kStart, kStart);
  map.add({}, {}, {}, held, {});
  for (KeyframeId k = 0; k < 20; ++k) {
    held.odometry = KeyframeMap::Odometry{k, Pose2{0.3, 0.0, 0.0}, squaresOf(0.003, 0.001)};
    map.add({0.3 * (k + 1.0), 0.0, 0.0}, {}, {}, held, {});
  }
  // Eleven links of 9 mm² are within 100 mm².
  EXPECT_EQ(map.references(0, 0.0, Pose2{}, 100).size(), 12U);
}

}  // namespace
}  // namespace omnifleet::estimation
