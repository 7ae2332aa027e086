// Places of driving robots. A kidnapped robot in a known room is relocalized, and its places are linked.
// Places of different cameras are not compared.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "estimation/estimator.h"
#include "tests/unit/appearance/textured_room.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kBetween_ns = 200000000;
constexpr std::size_t kKidnapped = 70;  // frame of the kidnapping
constexpr std::size_t kNever = 999;     // no kidnapping

struct KidnappedRun {
  std::vector<Pose2> truth;
  std::vector<PoseEstimate> poses;
  std::map<std::uint32_t, Place> places;
};

/// Drives a circle in the furnished room, is kidnapped to the room `other`, and drives on. The wheels do not
/// measure the kidnapping. Every second frame has the signature of the wallpaper.
KidnappedRun driveKidnapped(const scan::testing::Scene& other, unsigned wallpaper,
                            std::size_t kidnapped = kKidnapped) {
  KidnappedRun run;
  std::mt19937 random(11);
  RobotSetup setup;
  setup.name = "r1";
  setup.body.radius_m = 0.1;
  setup.body.wheel_separation_m = 0.2;
  setup.initial_pose = Pose2{0.2, -1.2, 0.0};
  FleetEstimator estimator({setup}, {});
  const appearance::PanoramaOptions options;
  appearance::SignatureMaker maker(test::roomUnwrapper(options), {});
  const test::TexturedRoom first(5), second(wallpaper);
  const Pose2 step{0.06, 0.0, 0.08};
  Pose2 truth = *setup.initial_pose;
  for (std::size_t i = 0; i < 150; ++i) {
    if (i == kidnapped)
      truth = {0.9, -0.6, 1.6};
    else if (i > 0)
      truth = truth * step;
    Objects frame;
    frame.robot = "r1";
    frame.acquired_ns = static_cast<TimeNs>(i + 1) * kBetween_ns;
    frame.sequence = static_cast<std::uint32_t>(i);
    frame.boundary = (i < kidnapped ? scan::testing::furnishedRoom() : other).scan(truth, 0.003, random);
    frame.motion.valid = i > 0;
    frame.motion.since_ns = frame.acquired_ns - kBetween_ns;
    if (i != kidnapped) frame.motion.previous_from_current = step;
    frame.motion.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-5).asDiagonal();
    if (i % 2 == 0) {
      const auto signature = maker.compute((i < kidnapped ? first : second).panorama(truth, options));
      frame.appearance.format = maker.format();
      frame.appearance.signature = appearance::store(signature);
    }
    run.truth.push_back(truth);
    run.poses.push_back(estimator.process(frame.acquired_ns, {&frame}, {}).front());
    if (estimator.refineDue()) estimator.refine();
    for (const Place& place : estimator.takePlaces()) run.places[place.index] = place;
  }
  return run;
}

bool isRelocalized(const KidnappedRun& run) {
  return std::any_of(run.poses.begin(), run.poses.end(),
                     [](const PoseEstimate& pose) { return pose.event == PoseEvent::kRelocalized; });
}

std::vector<PlaceLink> loopsOf(const KidnappedRun& run, std::uint32_t* index) {
  std::vector<PlaceLink> loops;
  for (const auto& [i, place] : run.places) {
    for (const PlaceLink& link : place.links) {
      if (!link.closes_loop) continue;
      loops.push_back(link);
      *index = i;
    }
  }
  return loops;
}

TEST(PlaceLinks, RelocalizedRobotLinksItsPlaces) {
  const KidnappedRun run = driveKidnapped(scan::testing::furnishedRoom(), 5);
  ASSERT_TRUE(isRelocalized(run));
  EXPECT_LT((run.poses.back().map_from_base.translation() - run.truth.back().translation()).norm(), 0.02);
  std::uint32_t index = 0;
  const std::vector<PlaceLink> loops = loopsOf(run, &index);
  ASSERT_EQ(loops.size(), 1u);
  const Place& place = run.places.at(index);
  ASSERT_LT(loops[0].index, index);
  const Place& other = run.places.at(loops[0].index);
  EXPECT_EQ(loops[0].robot, "r1");
  EXPECT_GE(place.sequence, kKidnapped);
  EXPECT_LT(other.sequence, kKidnapped);
  const Pose2 truth = run.truth[place.sequence].inverse() * run.truth[other.sequence],
              off = loops[0].this_from_other.inverse() * truth;
  EXPECT_LT(off.translation().norm(), 0.02);  // some σ of two scan matches
  EXPECT_LT(std::abs(off.theta_rad), 0.02);
}

TEST(PlaceLinks, RoomWithEqualWallsCausesNoRelocalization) {
  scan::testing::Scene other = scan::testing::furnishedRoom();
  other.outlines.resize(1);
  other.outlines.push_back({{-2.5, 1.4}, {-1.3, 1.4}, {-1.3, 2.0}, {-2.5, 2.0}});
  other.outlines.push_back({{0.1, -2.0}, {1.3, -2.0}, {1.3, -1.5}, {0.1, -1.5}});
  other.outlines.push_back({{-1.6, -0.3}, {-1.3, -0.3}, {-1.3, 0.0}, {-1.6, 0.0}});
  const KidnappedRun run = driveKidnapped(other, 5);  // the same wallpaper: the compass agrees
  EXPECT_FALSE(isRelocalized(run));
  std::uint32_t index = 0;
  EXPECT_TRUE(loopsOf(run, &index).empty());
}

// The second robot has panoramas of another size, or of the same one.
std::vector<Message> findingsOfTwoPanoramas(bool same_size) {
  std::vector<RobotSetup> setups(2);
  for (std::size_t r = 0; r < 2; ++r) {
    setups[r].name = r == 0 ? "r1" : "r2";
    setups[r].body.radius_m = 0.1;
    setups[r].body.wheel_separation_m = 0.2;
    setups[r].initial_pose = Pose2{-1.0 + 2.0 * static_cast<double>(r), 0.0, 0.0};
  }
  FleetEstimator estimator(setups, {});
  appearance::PanoramaOptions options, small;
  small.rows = options.rows / 2;
  const test::TexturedRoom room(5);
  Appearance seen[2];
  for (std::size_t r = 0; r < 2; ++r) {
    const appearance::PanoramaOptions& size = r == 0 || same_size ? options : small;
    appearance::SignatureMaker maker(test::roomUnwrapper(size), {});
    seen[r].format = maker.format();
    seen[r].signature = appearance::store(maker.compute(room.panorama(*setups[r].initial_pose, size)));
  }
  const Pose2 step{0.06, 0.0, 0.08};
  std::vector<Message> findings;
  for (std::size_t i = 0; i < 40; ++i) {
    Objects frames[2];
    for (std::size_t r = 0; r < 2; ++r) {
      Objects& frame = frames[r];
      frame.robot = setups[r].name;
      frame.acquired_ns = static_cast<TimeNs>(i + 1) * kBetween_ns;
      frame.sequence = static_cast<std::uint32_t>(i);
      frame.motion.valid = i > 0;
      frame.motion.since_ns = frame.acquired_ns - kBetween_ns;
      frame.motion.previous_from_current = step;
      frame.motion.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-5).asDiagonal();
      frame.appearance = seen[r];
    }
    estimator.process(frames[0].acquired_ns, {&frames[0], &frames[1]}, {});
    if (estimator.refineDue()) estimator.refine();
    for (Message& finding : estimator.takeFindings()) findings.push_back(std::move(finding));
  }
  return findings;
}

TEST(Places, OfAnotherPanoramaSizeAreReportedOnce) {
  EXPECT_TRUE(findingsOfTwoPanoramas(true).empty());
  const std::vector<Message> findings = findingsOfTwoPanoramas(false);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].code, ErrorCode::kPlacesIncomparable);
  EXPECT_EQ(findings[0].text.substr(0, 3), "r2:") << findings[0].text;
  EXPECT_NE(findings[0].text.find("rows"), std::string::npos) << findings[0].text;
}

TEST(PlaceLinks, ReturningRobotLinksItsPlacesOnce) {
  const KidnappedRun run = driveKidnapped(scan::testing::furnishedRoom(), 5, kNever);
  std::uint32_t index = 0;
  const std::vector<PlaceLink> loops = loopsOf(run, &index);
  // A circle is 79 frames, so 39 places: 150 frames are 35 places after the first return.
  ASSERT_GE(loops.size(), 1u);
  ASSERT_LE(loops.size(), 2u);
  const Place &place = run.places.at(index), &other = run.places.at(loops.back().index);
  EXPECT_GE(place.sequence, other.sequence + 60);
  const Pose2 truth = run.truth[place.sequence].inverse() * run.truth[other.sequence],
              off = loops.back().this_from_other.inverse() * truth;
  EXPECT_LT(truth.translation().norm(), 0.35);
  EXPECT_LT(off.translation().norm(), 0.02);
  EXPECT_LT(std::abs(off.theta_rad), 0.02);
}

}  // namespace
}  // namespace omnifleet::estimation
