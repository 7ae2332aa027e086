// Whether a candidate that some frames show and others do not is present, gone or was never there.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

#include "global_merger/merger.h"
#include "merger_scenes.h"

namespace omnifleet::global_merger {
namespace {

using dataset::MapObject;
using omnifleet::testing::boxPolygon;
using omnifleet::testing::SimRobot;
using namespace testing;  // NOLINT

/// Contributions of a fleet that sees a sixth object in some frames of r1, which drives away from it, and not
/// in the others. r2 and r3 stay two metres away.
class SixthObject : public ::testing::Test {
 protected:
  SixthObject() {
    obstacles_.push_back({boxPolygon({-1.05, 0.5}, 0.2, 0.2, 0.2), 0.15});
    FleetSim with = arena(noisy(), 22, obstacles_), without = arena(noisy(), 22);
    with_ = record(with, 0.0, 6.0);
    without_ = record(without, 0.0, 6.0);
    bodies_ = with.bodies();
  }
  /// r1 sees it in its first frames only.
  Sets seenIn(int frames) const {
    Sets sets = with_;
    for (std::size_t i = 0; i < sets.contributions.size(); ++i) {
      const bool sees = sets.contributions[i].robot == "r1" && frames-- > 0;
      if (!sees) sets.contributions[i] = without_.contributions[i];
    }
    return sets;
  }
  Merger map(const Sets& sets) const {
    Merger merger = merged(sets, bodies_);
    merger.finish();
    return merger;
  }

  std::vector<SimObstacle> obstacles_ = fiveObstacles();
  Sets with_, without_;
  std::map<std::string, RobotBody> bodies_;
};

/// As a low-contrast object in a dim corner is.
TEST_F(SixthObject, IsMappedIfMissedOnlyFromFarAway) {
  Merger merger = map(seenIn(12));
  EXPECT_EQ(score(merger.outlines(), obstacles_).matched, 6);
  EXPECT_EQ(score(merger.outlines(), obstacles_).extra, 0);
}

TEST_F(SixthObject, IsRejectedIfFloorIsSeenManyTimesAsOften) {
  Merger merger = map(seenIn(3));
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).matched, 5);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
}

/// The floor was seen as often as the object, and hardly more often. That does not count if the outlines are
/// sharp.
TEST_F(SixthObject, IsMappedFromFewViewsOnlyIfSharp) {
  for (const bool sharp : {true, false}) {
    const Sets seen = seenIn(8);
    Sets sets;
    for (std::size_t i = 0; i < seen.contributions.size() && sets.contributions.size() < 24; ++i) {
      if (seen.contributions[i].robot != "r1") continue;
      sets.contributions.push_back(seen.contributions[i]);
      sets.poses.push_back(seen.poses[i]);
      for (auto& view : sets.contributions.back().views)
        for (auto& sigma : view.sigma_dmm) sigma = static_cast<std::uint16_t>(sharp ? sigma : 8 * sigma);
    }
    Merger merger = map(sets);
    const auto isSixth = [&](const MapObject& object) {
      return (object.centroid_m - centroid(obstacles_.back().footprint_m)).norm() < 0.15;
    };
    const auto outlines = obstaclesOf(merger);
    EXPECT_EQ(std::any_of(outlines.begin(), outlines.end(), isSixth), sharp);
  }
}

/// A piece of a wall, seen in one frame: no ray goes beyond it.
TEST_F(SixthObject, IsRejectedIfSeenOnceAndMissedInPlainSight) {
  Sets sets = seenIn(1);
  const Eigen::Vector2d at_m = centroid(obstacles_.back().footprint_m);
  for (std::size_t i = 0; i < sets.contributions.size(); ++i) {
    auto& c = sets.contributions[i];
    const Eigen::Vector2d foot_m(c.scan_origin.x_dmm * 1e-4, c.scan_origin.y_dmm * 1e-4);
    const Eigen::Vector2d to_m = sets.poses[i].mapFromBase().inverse() * at_m - foot_m;
    const auto rays = static_cast<double>(c.range_dmm.size());
    const double middle = std::atan2(to_m.y(), to_m.x()) / (2.0 * M_PI) * rays;
    for (int k = -8; k <= 8; ++k) {
      const auto ray = static_cast<std::size_t>(std::lround(middle + k + 2.0 * rays)) % c.range_dmm.size();
      c.range_dmm[ray] = std::min<decltype(c.range_dmm)::value_type>(
          c.range_dmm[ray],
          static_cast<decltype(c.range_dmm)::value_type>(1e4 * std::max(0.2, to_m.norm() - 0.05)));
      c.label[ray] = RayLabel::kObstacle;
    }
  }
  Merger merger = map(sets);
  const auto isSixth = [&](const MapObject& object) { return (object.centroid_m - at_m).norm() < 0.15; };
  const auto outlines = obstaclesOf(merger);
  EXPECT_TRUE(std::none_of(outlines.begin(), outlines.end(), isSixth));
}

/// It flickers until the end, as light on the floor does; no other robot observes it.
TEST_F(SixthObject, IsRejectedIfFloorIsSeenAsOftenFromAsNear) {
  Sets sets;
  int frame = 0;
  for (std::size_t i = 0; i < with_.contributions.size(); ++i) {
    if (with_.contributions[i].robot != "r1") continue;
    const bool sees = frame == 0 || (frame >= 15 && frame % 3 == 0) || frame == 29;
    sets.contributions.push_back(sees ? with_.contributions[i] : without_.contributions[i]);
    sets.poses.push_back(with_.poses[i]);
    ++frame;
  }
  EXPECT_EQ(frame, 30);
  const auto isSixth = [&](const MapObject& object) {
    return (object.centroid_m - centroid(obstacles_.back().footprint_m)).norm() < 0.15;
  };
  Merger merger = map(sets);
  const auto outlines = obstaclesOf(merger);
  EXPECT_TRUE(std::none_of(outlines.begin(), outlines.end(), isSixth));
}

/// Its track is lost and associated with a shadow nearby.
TEST_F(SixthObject, IsMappedIfItsTrackIsAssociatedWrongly) {
  Sets sets = with_;
  int frames = 0;
  for (auto& c : sets.contributions) {
    frames += c.robot == "r1" ? 1 : 0;
    const auto lost = [&](const auto& view) {
      return view.track_id == obstacles_.size() && (c.robot != "r1");
    };
    c.views.erase(std::remove_if(c.views.begin(), c.views.end(), lost), c.views.end());
    for (auto& view : c.views) {
      if (view.track_id != obstacles_.size() || frames <= 15) continue;
      view.position.x_dmm -= 2500;
      for (std::size_t k = 0; k < view.b_dmm.size(); ++k) {
        const double angle = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.b_dmm.size());
        view.b_dmm[k] +=
            static_cast<std::int32_t>(-2500.0 * std::cos(angle) + 400.0 * frames * std::sin(3.0 * angle));
      }
    }
  }
  Merger merger = map(sets);
  EXPECT_EQ(score(merger.outlines(), obstacles_).missed, 0);
}

/// A robot drives up to a sixth object, which it sees for four seconds. After that each frame is changed.
class LaterFrames : public ::testing::Test {
 protected:
  LaterFrames() {
    obstacles_.push_back({boxPolygon({-1.05, 0.5}, 0.2, 0.2, 0.2), 0.15});
    with_ = seen(obstacles_);
    without_ = seen(fiveObstacles());
  }
  static Sets seen(const std::vector<SimObstacle>& obstacles) {
    const SimRobot robot{"r1", [](double t) { return Pose2{0.4 - 0.2 * t, 0.3, 3.0}; }};
    FleetSim sim(obstacles, {robot}, noisy(), 22);
    return record(sim, 0.0, 6.0, 0.25);
  }
  using Later = std::function<void(occupancy::Contribution&, std::size_t)>;
  Merger mapWithLater(const Later& later) const {
    Sets sets = with_;
    for (std::size_t i = 0; i < sets.contributions.size(); ++i)
      if (sets.contributions[i].acquired_ns >= later_ns_) later(sets.contributions[i], i);
    Merger merger = merged(sets, {});
    merger.finish();
    return merger;
  }
  /// The floor is seen at its place.
  void showFloor(occupancy::Contribution& c, std::size_t frame) const { c = without_.contributions[frame]; }
  /// The ray ends there, but at an unidentified object.
  void hideTrack(occupancy::Contribution& c) const {
    const auto isSixth = [&](const auto& view) { return view.track_id == obstacles_.size(); };
    c.views.erase(std::remove_if(c.views.begin(), c.views.end(), isSixth), c.views.end());
    for (std::size_t ray = 0; ray < c.object.size(); ++ray) {
      if (c.object[ray] != obstacles_.size()) continue;
      c.object[ray] = 0;
      c.label[ray] = RayLabel::kUndecided;
    }
  }
  Eigen::Vector2d place() const { return centroid(obstacles_.back().footprint_m); }
  Later alternating() const {
    return [this](occupancy::Contribution& c, std::size_t frame) {
      frame % 2 == 0 ? hideTrack(c) : showFloor(c, frame);
    };
  }
  Later floorOnly() const {
    return [this](occupancy::Contribution& c, std::size_t frame) { showFloor(c, frame); };
  }

  std::vector<SimObstacle> obstacles_ = fiveObstacles();
  Sets with_, without_;
  TimeNs later_ns_ = 4000000000;
};

/// A box of the floor's colour is upright according to its many views. At close range, where it touches
/// another object in the image, it may be classified as the shadow of that object.
TEST_F(LaterFrames, KeepUprightObjectIfRaysStillEndThere) {
  Merger merger = mapWithLater(alternating());
  EXPECT_EQ(score(merger.outlines(), obstacles_).matched, 6);
  ASSERT_EQ(flagged(merger, Quality::kLowContrast).size(), 1U) << "the floor seen there must be reported";
  EXPECT_LT((flagged(merger, Quality::kLowContrast)[0] - place()).norm(), 0.05);
  EXPECT_TRUE(merger.rejected().empty());
}

TEST_F(LaterFrames, RemoveUprightObjectIfOnlyFloorIsSeen) {
  Merger merger = mapWithLater(floorOnly());
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).matched, 5);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
  EXPECT_TRUE(flagged(merger, Quality::kLowContrast).empty());
  ASSERT_EQ(merger.rejected().size(), 1U);
  EXPECT_EQ(merger.rejected()[0].reason, Reason::kFloorSeen);
}

/// Views that no upright body explains: a pattern, a shadow.
TEST_F(LaterFrames, RemovePatternEvenIfRaysStillEndThere) {
  for (auto& c : with_.contributions)
    for (auto& view : c.views)
      for (std::size_t k = 0; view.track_id == obstacles_.size() && k < view.b_dmm.size(); ++k)
        view.b_dmm[k] += (c.acquired_ns / 200000000 + static_cast<TimeNs>(k / 4)) % 2 == 0 ? 300 : -300;
  Merger merger = mapWithLater(alternating());
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).matched, 5);
  EXPECT_EQ(score(merger.outlines(), fiveObstacles()).extra, 0);
  EXPECT_TRUE(flagged(merger, Quality::kLowContrast).empty());
}

/// A candidate without a single shape is reported if the floor was seen there less often than the candidate.
TEST_F(LaterFrames, ReportShapelessCandidateUnlessMostlyFloor) {
  for (auto& c : with_.contributions) {
    for (auto& view : c.views) {
      const auto n = view.b_dmm.size();
      const auto contact = static_cast<std::size_t>(std::min_element(view.b_dmm.begin(), view.b_dmm.end()) -
                                                    view.b_dmm.begin());
      for (std::size_t k = 3; view.track_id == obstacles_.size() && k + 2 < n; ++k)
        view.sigma_dmm[(contact + k) % n] = 0;  // only one face of it is seen
    }
  }
  const auto isListed = [&](const Merger& merger, Reason reason) {
    return std::any_of(merger.rejected().begin(), merger.rejected().end(),
                       [&](const RejectedCandidate& rejected) {
                         return rejected.reason == reason && (rejected.at_m - place()).norm() < 0.3;
                       });
  };
  EXPECT_TRUE(isListed(mapWithLater(alternating()), Reason::kFloorSeen));
  later_ns_ = 2600000000;
  EXPECT_TRUE(mapWithLater(floorOnly()).rejected().empty());
  // The top face of an object whose sides look like the floor: parallax gives its height, whatever is seen
  // below.
  for (auto& c : with_.contributions) {
    for (auto& view : c.views) {
      if (view.track_id != obstacles_.size()) continue;
      view.height_dmm = 2000;
      view.height_sigma_dmm = 100;
    }
  }
  EXPECT_TRUE(isListed(mapWithLater(floorOnly()), Reason::kTopFaceOnly));
}

/// An object that merges with another one in every view of one robot: its outline changes with the part that
/// is assigned to it.
TEST_F(LaterFrames, ListMergedObjectIfItsViewsDisagreeSlightly) {
  const auto seen = [&](double off_dmm, std::uint16_t solidity) {
    Sets sets = with_;
    for (auto& c : sets.contributions) {
      for (auto& view : c.views) {
        if (view.track_id != obstacles_.size()) continue;
        view.solidity_permille = solidity;
        const double to = c.acquired_ns / 250000000 % 2 == 0 ? off_dmm : -off_dmm;
        for (std::size_t k = 0; k < view.b_dmm.size(); ++k)
          if (view.b_dmm[k] > 0) view.b_dmm[k] += static_cast<std::int32_t>(to);
      }
    }
    Merger merger = merged(sets, {});
    merger.finish();
    EXPECT_EQ(score(merger.outlines(), obstacles_).matched, 6) << off_dmm << " " << solidity;
    return flagged(merger, Quality::kDisagreeing);
  };
  const auto disagreeing = seen(150.0, 850);
  ASSERT_EQ(disagreeing.size(), 1U);
  EXPECT_LT((disagreeing[0] - place()).norm(), 0.1);
  EXPECT_TRUE(seen(150.0, 1000).empty()) << "seen alone";
  EXPECT_EQ(seen(300.0, 1000).size(), 1U) << "seen alone, but the views disagree";
  EXPECT_TRUE(seen(0.0, 850).empty()) << "merged, but the views agree";
}

/// One object, seen by a robot at rest at the origin. `spoil(track, scan)` changes each of its frames.
template <typename Spoil>
std::vector<dataset::MapObject> outlinesOfOne(const std::vector<double>& times_s, Spoil spoil) {
  FleetSim sim({{circlePolygon({1.2, 0.1}, 0.14, 48), 0.4}}, {SimRobot{"r1", [](double) { return Pose2{}; }}},
               {});
  Sets sets;
  ContributionMaker maker({});
  for (const double t : times_s) {
    auto frame = sim.at(t).front();
    spoil(frame.objects.tracks.front(), frame.objects.scan);
    const auto made = maker.make(frame.objects, frame.pose);
    if (!made) continue;
    sets.contributions.push_back(made->contribution);
    sets.poses.push_back(made->pose);
  }
  MergerOptions options;
  options.least_seen = 0.0;  // it is seen from one side
  Merger merger = merged(sets, sim.bodies(), options);
  merger.finish();
  return obstaclesOf(merger);
}

/// A candidate that is cut behind another object in every view is a piece of that object. A candidate cut by
/// the edge of the view is an object.
TEST(Merger, RejectsPieceAlwaysCutBehindAnObject) {
  const auto cut = [](Track& track, Scan&) { track.truncated = true; };
  const auto behind = [](Track& track, Scan& scan) {
    track.truncated = true;
    for (float& range : scan.range_m) range = std::min(range, 0.7F);
  };
  EXPECT_EQ(outlinesOfOne({0.0, 0.5, 1.0, 1.5}, cut).size(), 1U);
  EXPECT_EQ(outlinesOfOne({0.0, 0.5, 1.0, 1.5}, behind).size(), 0U);
  EXPECT_EQ(outlinesOfOne({0.0}, cut).size(), 0U) << "seen once, and cut";
  EXPECT_EQ(outlinesOfOne({0.0}, [](Track&, Scan&) {}).size(), 1U);
}

/// Views that no upright body explains show no object, unless there are many.
TEST(Merger, RejectsFewViewsThatNoUprightBodyExplains) {
  FleetSim sim = arena(noisy(), 22);
  const Sets few = record(sim, 0.0, 1.0), many = record(sim, 0.0, 12.0);
  MergerOptions strict;
  strict.seldom_rms_m = 1e-5;  // less than the noise
  for (const auto& [sets, options, expected] :
       {std::tuple(&few, MergerOptions{}, 5U), std::tuple(&few, strict, 0U), std::tuple(&many, strict, 5U)}) {
    Merger merger = merged(*sets, sim.bodies(), options);
    merger.finish();
    EXPECT_EQ(obstaclesOf(merger).size(), expected);
  }
}

}  // namespace
}  // namespace omnifleet::global_merger
