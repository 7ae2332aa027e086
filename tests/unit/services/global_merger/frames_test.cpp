// Robots whose poses are in a frame of their own: the common map, their own maps, trajectories and
// merge.json.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>

#include "dataset/atomic_file.h"
#include "global_merger/merge_report.h"
#include "global_merger/own_maps.h"
#include "merger_scenes.h"
#include "tests/test_data.h"

namespace omnifleet::global_merger {
namespace {

namespace fs = std::filesystem;
using namespace testing;  // NOLINT
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Pose2 kOwnFromMap{0.4, -0.3, 1.2};

/// The arena of three robots. Poses of r2 are in its own frame; `again` has them in the common frame, as the
/// localizer publishes them after a match.
struct ApartFleet {
  std::map<std::string, RobotBody> bodies;
  std::vector<PoseEstimate> samples;         ///< topic pose
  std::vector<PoseEstimate> samples_in_map;  ///< the same, all in the common frame
  Sets sets;                                 ///< with the poses of the samples (term 0)
  Sets sets_in_map;
  std::vector<occupancy::KeyframePose> again;  ///< of every sample of r2

  ApartFleet() {
    FleetSim sim = arena(noisy(), 31);
    bodies = sim.bodies();
    std::map<std::string, ContributionMaker> makers;
    for (double t = 0.0; t < 8.0; t += 0.2) {
      for (auto& seen : sim.at(t)) {
        PoseEstimate pose = seen.pose;
        pose.covariance = Eigen::Vector3d(4e-6, 4e-6, 1e-6).asDiagonal();
        samples_in_map.push_back(pose);
        if (pose.robot == "r2") {
          again.push_back(occupancy::makeKeyframePose(pose, 1, 7));
          pose.frame = "r2";
          pose.map_from_base = kOwnFromMap * pose.map_from_base;
        }
        samples.push_back(pose);
        auto made = makers.try_emplace(pose.robot, KeyframeOptions{}).first->second.make(seen.objects, pose);
        if (!made) continue;
        sets.contributions.push_back(made->contribution);
        sets_in_map.contributions.push_back(made->contribution);
        sets.poses.push_back(made->pose);
        sets_in_map.poses.push_back(occupancy::makeKeyframePose(samples_in_map.back()));
      }
    }
  }
};

/// What the service does with its samples.
struct Replica {
  explicit Replica(const std::map<std::string, RobotBody>& bodies)
      : common({}, {}, bodies), own({"r1", "r2", "r3"}, [bodies](const std::string& robot) {
          return Merger({}, {}, bodies, robot);
        }) {}
  void add(const occupancy::Contribution& contribution) {
    if (common.add(contribution)) own.add(contribution);
  }
  void add(const occupancy::KeyframePose& pose) {
    if (common.add(pose)) own.add(pose, common);
  }
  void add(const PoseEstimate& pose) {
    common.addTrajectory(pose);
    own.addTrajectory(pose, common);
  }
  template <typename Samples>
  void addAll(const Samples& samples) {
    for (const auto& sample : samples) add(sample);
  }
  void addAll(const Sets& sets) {
    addAll(sets.contributions);
    addAll(sets.poses);
  }
  std::vector<std::string> save(const std::string& out) {
    common.finish();
    own.finish();
    auto problems = common.saveAsFitted(out);
    for (const std::string& problem : own.save(common, out + "/maps")) problems.push_back(problem);
    return problems;
  }

  Merger common;
  OwnMaps own;
};

std::map<std::string, std::string> filesIn(const fs::path& folder) {
  std::map<std::string, std::string> all;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      all[fs::relative(entry.path(), folder).string()] = dataset::readFile(entry.path().string());
  return all;
}

Replica unmatched(const ApartFleet& fleet) {
  Replica replica(fleet.bodies);
  replica.addAll(fleet.samples);
  replica.addAll(fleet.sets);
  return replica;
}

class Frames : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { fleet_ = std::make_unique<ApartFleet>(); }
  static void TearDownTestSuite() { fleet_.reset(); }
  const ApartFleet& fleet() const { return *fleet_; }

  test::TempFolder folder_;

 private:
  static std::unique_ptr<ApartFleet> fleet_;
};
std::unique_ptr<ApartFleet> Frames::fleet_;

TEST_F(Frames, RobotInItsOwnFrameLeavesNoTraceInTheCommonMap) {
  Replica replica = unmatched(fleet()), without(fleet().bodies);
  EXPECT_THAT(replica.save(folder_ / "with"), ::testing::IsEmpty());
  const auto isOther = [](const auto& sample) { return sample.robot != "r2"; };
  for (const auto& sample : fleet().samples)
    if (isOther(sample)) without.add(sample);
  for (const auto& sample : fleet().sets.contributions)
    if (isOther(sample)) without.add(sample);
  for (const auto& sample : fleet().sets.poses)
    if (isOther(sample)) without.add(sample);
  EXPECT_THAT(without.save(folder_ / "without"), ::testing::IsEmpty());
  auto with = filesIn(folder_ / "with");
  for (auto file = with.begin(); file != with.end();)
    file = file->first.rfind("maps/", 0) == 0 ? with.erase(file) : std::next(file);
  EXPECT_EQ(with, filesIn(folder_ / "without"));
  EXPECT_EQ(with.count("trajectories/r1.tum"), 1U);
}

TEST_F(Frames, OwnMapEqualsTheMapOfTheRobotAlone) {
  Replica replica = unmatched(fleet()), alone(fleet().bodies);
  EXPECT_THAT(replica.save(folder_ / "with"), ::testing::IsEmpty());
  const auto of = [](auto sample) {
    sample.frame.clear();
    return sample;
  };
  for (const auto& sample : fleet().samples)
    if (sample.robot == "r2") alone.add(of(sample));
  for (const auto& sample : fleet().sets.contributions)
    if (sample.robot == "r2") alone.add(sample);
  for (const auto& sample : fleet().sets.poses)
    if (sample.robot == "r2") alone.add(of(sample));
  EXPECT_THAT(alone.save(folder_ / "alone"), ::testing::IsEmpty());
  auto own = filesIn(folder_ / "with/maps/r2"), expected = filesIn(folder_ / "alone");
  EXPECT_THAT(own.at("map.yaml"), HasSubstr("frame: \"r2\""));
  EXPECT_THAT(own.at("objects.geojson"), HasSubstr("\"frame\": \"r2\""));
  EXPECT_FALSE(dataset::readObjects(folder_ / "with/maps/r2/objects.geojson").empty());
  EXPECT_EQ(dataset::objectsText(dataset::readObjects(folder_ / "with/maps/r2/objects.geojson")),
            dataset::objectsText(dataset::readObjects(folder_ / "alone/objects.geojson")));
  for (const char* file : {"map.yaml", "objects.geojson", "map.png"}) {  // these state the frame
    EXPECT_EQ(own.erase(file), 1U);
    expected.erase(file);
  }
  EXPECT_EQ(own, expected);
  EXPECT_EQ(
      own.count("trajectories/r2.tum") + own.count("covariances/r2.csv") + own.count("localization/r2.csv"),
      3U);
}

TEST_F(Frames, MatchedRobotIsInTheCommonMapAsIfItHadAlwaysBeen) {
  Replica replica = unmatched(fleet());
  replica.addAll(fleet().again);
  Merger at_once({}, {}, fleet().bodies);
  for (const auto& sample : fleet().sets_in_map.contributions) at_once.add(sample);
  for (const auto& sample : fleet().sets_in_map.poses) at_once.add(sample);
  for (const auto& pose : fleet().again) at_once.add(pose);
  EXPECT_EQ(occupancy::hexText(replica.common.map().hash()), occupancy::hexText(at_once.map().hash()));
  for (const auto& sample : fleet().samples_in_map) at_once.addTrajectory(sample);
  replica.common.finish();
  at_once.finish();
  EXPECT_EQ(text(replica.common), text(at_once));
  EXPECT_EQ(replica.common.map().octreeBytes(), at_once.map().octreeBytes());
}

TEST_F(Frames, TrajectoryOfMatchedRobotIsWhollyInTheCommonFrame) {
  Replica replica = unmatched(fleet());
  EXPECT_EQ(replica.common.trajectories().count("r2"), 0U);
  PoseEstimate later = fleet().samples_in_map.back();  // after the match: published in the common frame
  later.robot = "r2";
  later.acquired_ns += 1'000'000'000;
  later.map_from_base = {0.5, 0.6, 0.7};
  later.datum = 3;
  replica.add(later);
  replica.addAll(fleet().again);
  const auto trajectory = replica.common.trajectories().at("r2");
  std::vector<PoseEstimate> expected;
  for (const auto& sample : fleet().samples_in_map)
    if (sample.robot == "r2") expected.push_back(sample);
  ASSERT_EQ(trajectory.poses.size(), expected.size() + 1);
  ASSERT_EQ(trajectory.covariances.size(), trajectory.poses.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(trajectory.poses[i].time_ns, expected[i].acquired_ns);
    // Keyframe poses are rounded to 0.1 mm per axis.
    EXPECT_LT(
        (trajectory.poses[i].map_from_base.translation() - expected[i].map_from_base.translation()).norm(),
        7.2e-5);
    // σ of 2 mm and 1 mrad; rounding to 0.1 mm and 0.1 mrad adds 1/12 of a unit's square.
    EXPECT_NEAR(trajectory.covariances[i].covariance(0, 0), 4e-6 + 1e-8 / 12, 1e-12);
    EXPECT_NEAR(trajectory.covariances[i].covariance(2, 2), 1e-6 + 1e-8 / 12, 1e-12);
    EXPECT_EQ(trajectory.covariances[i].datum, 3U) << "of the poses after the match";
  }
  EXPECT_EQ(trajectory.poses.back().map_from_base.vector(), later.map_from_base.vector());
}

TEST_F(Frames, PosesInTheCommonFrameStayCausal) {
  Merger merger({}, {}, {});
  PoseEstimate pose;
  pose.robot = "r2";
  const auto add = [&](TimeNs time_ns, double x_m, const std::string& frame) {
    pose.acquired_ns = time_ns;
    pose.valid = true;
    pose.frame = frame;
    pose.map_from_base.x_m = x_m;
    merger.addTrajectory(pose);
  };
  const auto correct = [&](TimeNs time_ns, double x_m, std::uint32_t revision) {
    pose.acquired_ns = time_ns;
    pose.frame.clear();
    pose.map_from_base.x_m = x_m;
    merger.add(occupancy::makeKeyframePose(pose, 1, revision));
  };
  add(10, 9.0, "r2");
  add(20, 9.1, "r2");
  add(30, 1.3, "");
  add(30, 7.7, "");    // not causal
  add(30, 7.8, "r2");  // likewise: the pose of this time is known
  add(40, 9.9, "r3");  // the frame of another robot: no place here
  correct(10, 1.1, 1);
  correct(10, 1.15, 2);  // the one that the map uses
  correct(30, 8.8, 2);   // a later correction does not change what was known at that time
  const auto poses = merger.trajectories().at("r2").poses;
  ASSERT_EQ(poses.size(), 2U) << "poses that are not published again have no place in the map";
  EXPECT_NEAR(poses[0].map_from_base.x_m, 1.15, 1e-9);
  EXPECT_EQ(poses[1].map_from_base.x_m, 1.3);
  EXPECT_EQ(merger.localization().at("r2").size(), 4U);
}

TEST_F(Frames, ResultsAreIndependentOfOrder) {
  Replica reference = unmatched(fleet());
  reference.addAll(fleet().again);
  EXPECT_TRUE(reference.save(folder_ / "reference").empty());
  std::vector<occupancy::KeyframePose> poses = fleet().sets.poses;
  poses.insert(poses.end(), fleet().again.begin(), fleet().again.end());
  std::mt19937 random(5);
  std::shuffle(poses.begin(), poses.end(), random);
  Replica replica(fleet().bodies);
  replica.addAll(poses);
  replica.addAll(fleet().samples);
  replica.addAll(fleet().sets.contributions);
  EXPECT_TRUE(replica.save(folder_ / "shuffled").empty());
  EXPECT_EQ(filesIn(folder_ / "shuffled"), filesIn(folder_ / "reference"));
}

/// The map of a robot begins with what was received before its first pose in its own frame.
TEST_F(Frames, OwnMapIsIndependentOfOrder) {
  Replica early = unmatched(fleet()), late(fleet().bodies);
  late.addAll(fleet().sets.contributions);
  late.addAll(fleet().sets.poses);
  late.addAll(fleet().samples);
  EXPECT_TRUE(early.save(folder_ / "early").empty());
  EXPECT_TRUE(late.save(folder_ / "late").empty());
  EXPECT_EQ(filesIn(folder_ / "early"), filesIn(folder_ / "late"));
  EXPECT_TRUE(fs::exists(folder_ / "early/maps/r2/map.bt"));
}

TEST_F(Frames, OwnMapHasTheStatesBeforeTheFirstPose) {
  Replica replica(fleet().bodies);
  PoseEstimate pose;
  pose.robot = "r2";
  replica.add(pose);  // no pose yet
  EXPECT_TRUE(replica.save(folder_ / "out").empty());
  EXPECT_TRUE(fs::exists(folder_ / "out/localization/r2.csv")) << "it may still turn out to be in map";
  pose.acquired_ns = 5;
  pose.valid = true;
  pose.frame = "r2";
  replica.add(pose);
  EXPECT_TRUE(replica.save(folder_ / "out").empty());
  EXPECT_EQ(dataset::readLocalization(folder_ / "out/maps/r2/localization/r2.csv").size(), 2U);
  EXPECT_FALSE(fs::exists(folder_ / "out/localization/r2.csv"));
  EXPECT_FALSE(fs::exists(folder_ / "out/trajectories/r2.tum"));
}

TEST_F(Frames, MatchedRobotHasNoMapOfItsOwn) {
  Replica replica = unmatched(fleet());
  EXPECT_TRUE(replica.save(folder_ / "out").empty());
  EXPECT_TRUE(fs::exists(folder_ / "out/maps/r2/trajectories/r2.tum"));
  EXPECT_FALSE(fs::exists(folder_ / "out/maps/r1"));
  std::ofstream(folder_ / "out/maps/r2/notes.txt") << "a user's notes\n";
  replica.addAll(fleet().again);
  EXPECT_TRUE(replica.save(folder_ / "out").empty());
  EXPECT_TRUE(fs::exists(folder_ / "out/trajectories/r2.tum"));
  EXPECT_TRUE(fs::exists(folder_ / "out/localization/r2.csv"));
  std::vector<std::string> left;
  for (const auto& [name, content] : filesIn(folder_ / "out/maps")) left.push_back(name);
  EXPECT_THAT(left, ElementsAre("r2/notes.txt")) << "the merger has not written it";
  fs::remove(folder_ / "out/maps/r2/notes.txt");
  EXPECT_TRUE(replica.save(folder_ / "out").empty());
  EXPECT_FALSE(fs::exists(folder_ / "out/maps"));
}

/// Names of robots come from the network and become names of folders.
TEST_F(Frames, UnlistedRobotHasNoMapOfItsOwn) {
  Replica replica(fleet().bodies);
  for (auto pose : fleet().sets.poses) {
    pose.robot = pose.frame = "../r9";
    replica.add(pose);
  }
  EXPECT_TRUE(replica.own.maps().empty());
}

/// What nobody could classify and has the body of a robot that may stand anywhere is that robot.
TEST_F(Frames, RobotInItsOwnFrameIsNoObstacleForOthers) {
  SimOptions options = noisy();
  options.robots_are = ObjectKind::kUnknown;
  FleetSim sim({},
               {{"r1",
                 [](double t) {
                   return Pose2{0.1 * t, 0.0, 0.2 * t};
                 }},
                {"r2",
                 [](double) {
                   return Pose2{0.4, 0.9, 0.0};
                 }}},
               options, 3);
  Sets sets = record(sim, 0.0, 8.0);
  for (auto& pose : sets.poses)
    if (pose.robot == "r2") pose.frame = "r2", pose.position.x_dmm += 30000;
  Merger merger = merged(sets, sim.bodies());
  merger.finish();
  EXPECT_TRUE(obstaclesOf(merger).empty());
}

// --- merge.json ---

TEST_F(Frames, MergeReportHasTheLatestAlignmentOfEachRobot) {
  const Replica replica = unmatched(fleet());
  std::map<std::string, Alignment> alignments;
  Alignment& r1 = alignments["r1"];
  r1 = {"r1", 0, AlignmentStatus::kAnchored, "", "initial pose", 1.0, {}, {}};
  Alignment& r2 = alignments["r2"];
  r2 = {"r2", 12'500'000'000, AlignmentStatus::kMatched, "", "3 shared places", 0.9, {1.0, -2.0, 0.5}, {}};
  // Axes of σ 3 mm and 4 mm, turned by 45°.
  r2.covariance.topLeftCorner<2, 2>() << 12.5e-6, 3.5e-6, 3.5e-6, 12.5e-6;
  r2.covariance(2, 2) = 4e-6;
  alignments["r3"] = {"r3", 0, AlignmentStatus::kRefused, "r3", "other furniture", 0.2, {1, 1, 1}, {}};
  alignments["r9"].robot = "r9";  // not in the fleet
  const dataset::MergeReport report = mergeReport({"r1", "r2", "r3", "r4"}, alignments, replica.common);
  ASSERT_EQ(report.size(), 4U);
  EXPECT_EQ(report.at("r1").frame, "map");
  EXPECT_FALSE(report.at("r1").map_from_frame);
  EXPECT_EQ(report.at("r2").status, AlignmentStatus::kMatched);
  EXPECT_EQ(report.at("r2").map_from_frame->vector(), Eigen::Vector3d(1.0, -2.0, 0.5));
  EXPECT_NEAR(report.at("r2").sigma->x(), 0.004, 1e-12);  // the larger axis
  EXPECT_NEAR(report.at("r2").sigma->y(), 0.002, 1e-12);
  EXPECT_EQ(report.at("r2").time_s, 12.5);
  EXPECT_EQ(report.at("r3").frame, "r3");
  EXPECT_FALSE(report.at("r3").map_from_frame) << "a refused relation is none";
  EXPECT_EQ(report.at("r4").status, AlignmentStatus::kUndecided);
  EXPECT_THAT(report.at("r4").reason, HasSubstr("no sample"));
  EXPECT_EQ(report.at("r4").frame, "");
}

TEST_F(Frames, MergeReportSaysWhatTheLocalizerDidNotReport) {
  Replica replica = unmatched(fleet());
  PoseEstimate without_pose;
  without_pose.robot = "r4";
  replica.add(without_pose);
  const auto report = mergeReport({"r1", "r2", "r4"}, {}, replica.common);
  EXPECT_EQ(report.at("r1").status, AlignmentStatus::kAnchored);
  EXPECT_THAT(report.at("r1").reason, HasSubstr("the localizer reported no alignment"));
  EXPECT_FALSE(report.at("r1").score) << "nobody measured one";
  EXPECT_EQ(report.at("r2").status, AlignmentStatus::kUndecided);
  EXPECT_EQ(report.at("r2").frame, "r2");
  EXPECT_THAT(report.at("r4").reason, HasSubstr("no valid pose"));
  replica.addAll(fleet().again);
  EXPECT_EQ(mergeReport({"r2"}, {}, replica.common).at("r2").frame, "map");
}

}  // namespace
}  // namespace omnifleet::global_merger
