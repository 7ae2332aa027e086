// Selection of keyframes, and the files of a map.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "dataset/atomic_file.h"
#include "merger_scenes.h"

namespace omnifleet::global_merger {
namespace {

namespace fs = std::filesystem;
using namespace testing;  // NOLINT

// --- keyframes ---

omnifleet::testing::FleetSim::Frame frameAt(double t, double x) {
  FleetSim sim({}, {{"r1", [x](double) { return Pose2{x, 0, 0}; }}}, {});
  return sim.at(t).front();
}

TEST(ContributionMaker, SelectsKeyframesByDistanceAndTime) {
  KeyframeOptions options;
  options.distance_m = 0.10;
  options.rotation_rad = 0.2;
  options.interval_s = 1.0;
  ContributionMaker maker(options);
  const auto make = [&](double t, double x) {
    const auto frame = frameAt(t, x);
    return maker.make(frame.objects, frame.pose).has_value();
  };
  EXPECT_TRUE(make(0.0, 0.0));
  EXPECT_FALSE(make(0.1, 0.5));   // too soon
  EXPECT_FALSE(make(0.3, 0.05));  // not far enough
  EXPECT_TRUE(make(0.4, 0.12));
  EXPECT_FALSE(make(0.4, 0.9));  // same time as the keyframe before
  EXPECT_FALSE(make(1.3, 0.12));
  EXPECT_TRUE(make(1.5, 0.12));  // at rest
}

TEST(ContributionMaker, MakesFewKeyframesAtRestUnlessObjectsChange) {
  ContributionMaker maker({});
  const auto standing = frameAt(0.0, 0.0);
  const auto make = [&](double t, const std::vector<Track>& tracks) {
    Objects objects = standing.objects;
    PoseEstimate pose = standing.pose;
    objects.acquired_ns = pose.acquired_ns = standing.objects.acquired_ns + static_cast<TimeNs>(t * 1e9);
    objects.tracks = tracks;
    return maker.make(objects, pose).has_value();
  };
  Track box;
  box.id = 1;
  box.visible = true;
  box.position_m = {1.0, 0.0};
  int first_minute = 0, second_hour = 0;
  for (double t = 0; t < 7200; t += 0.25) {
    const int made = make(t, {box}) ? 1 : 0;
    first_minute += t < 60 ? made : 0;
    second_hour += t >= 3600 ? made : 0;
  }
  EXPECT_GE(first_minute, 20);
  EXPECT_LE(second_hour, 360 + 1);  // one in 10 s
  // An object that appears, moves, changes its kind or vanishes is contributed at once, and again soon after.
  Track second = box, moved = box, known = box;
  second.id = 2;
  moved.position_m.x() += 0.1;
  known.kind = ObjectKind::kObstacle;
  double t = 7200;
  for (const auto& tracks : {std::vector<Track>{box, second}, {box}, {moved}, {box}, {known}, {}}) {
    t += 9.75;
    EXPECT_TRUE(make(t, tracks)) << t;
    EXPECT_TRUE(make(t + 0.5, tracks)) << t;
  }
}

TEST(ContributionMaker, RejectsInvalidSamples) {
  ContributionMaker maker({});
  auto frame = frameAt(0.0, 0.0);
  frame.objects.state = FrameState::kDark;
  EXPECT_FALSE(maker.make(frame.objects, frame.pose));
  frame.objects.state = FrameState::kOk;
  frame.pose.valid = false;
  EXPECT_FALSE(maker.make(frame.objects, frame.pose));
  frame.pose.valid = true;
  frame.pose.map_from_base.x_m = std::nan("");
  EXPECT_FALSE(maker.make(frame.objects, frame.pose));
  frame.pose.map_from_base.x_m = 1.0;
  frame.pose.acquired_ns += 1;
  EXPECT_FALSE(maker.make(frame.objects, frame.pose));
  frame.pose.acquired_ns -= 1;
  const auto made = maker.make(frame.objects, frame.pose);
  ASSERT_TRUE(made);
  EXPECT_EQ(made->pose.position.x_dmm, 10000);
  EXPECT_EQ(made->contribution.range_dmm.size(), 360U);
}

// --- saving ---

class Saving : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("omnifleet-merger-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  Merger full(unsigned seed) {
    auto sim = arena(noisy(), seed);
    Merger merger = merged(record(sim, 0.0, 8.0), sim.bodies());
    for (double t = 0.0; t < 8.0; t += 0.2) {
      for (const auto& frame : sim.at(t)) merger.addTrajectory(frame.pose);
    }
    merger.finish();
    return merger;
  }
  std::map<std::string, std::string> contents(const fs::path& folder) const {
    std::map<std::string, std::string> all;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file())
        all[fs::relative(entry.path(), folder).string()] = dataset::readFile(entry.path().string());
    }
    return all;
  }
  fs::path folder_;
};

TEST_F(Saving, WritesCovariancesWithTheirDatum) {
  Merger merger = full(14);
  PoseEstimate pose;
  pose.robot = "r9";
  pose.valid = true;
  for (const std::uint32_t datum : {1U, 2U}) {
    pose.acquired_ns = datum * 1'000'000'000;
    pose.covariance = datum * 1e-4 * Eigen::Matrix3d::Identity();
    pose.datum = datum;
    merger.addTrajectory(pose);
  }
  EXPECT_TRUE(merger.save(folder_.string()).empty());
  const auto rows = dataset::readCovariances((folder_ / "covariances/r9.csv").string(), nullptr);
  ASSERT_EQ(rows.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(rows[i].datum, i + 1);
    EXPECT_NEAR(rows[i].covariance(1, 1), static_cast<double>(i + 1) * 1e-4, 1e-12);
  }
}

TEST_F(Saving, WritesStatesOfAllPoseSamplesInOrderOfTime) {
  Merger merger({}, {}, {});
  PoseEstimate pose;
  pose.robot = "r9";
  const auto add = [&](TimeNs time_ns, bool valid, LocalizationState state, PoseEvent event, double sigmas) {
    pose.acquired_ns = time_ns;
    pose.valid = valid;
    pose.state = state;
    pose.event = event;
    pose.correction_sigmas = sigmas;
    merger.addTrajectory(pose);
  };
  add(10, false, LocalizationState::kUnlocated, PoseEvent::kNone, 0.0);
  pose.used.add(Source::kScan);
  pose.rejected.add(Source::kWheels);
  add(30, true, LocalizationState::kRelocalized, PoseEvent::kRelocalized, 7.5);
  pose.used = pose.rejected = {};
  add(20, false, LocalizationState::kLost, PoseEvent::kNone, 0.0);
  add(20, true, LocalizationState::kLocalized, PoseEvent::kCorrected, 9.0);  // not causal
  add(30, true, LocalizationState::kLocalized, PoseEvent::kNone, 0.0);
  EXPECT_TRUE(merger.save(folder_.string()).empty());
  EXPECT_EQ(dataset::readFile((folder_ / "localization/r9.csv").string()),
            "#timestamp [ns],state,event,correction [sigma],used,rejected\n"
            "10,unlocated,none,0,none,none\n20,lost,none,0,none,none\n"
            "30,relocalized,relocalized,7.5,scan,wheels\n");
  const auto trajectory = merger.trajectories().at("r9");
  ASSERT_EQ(trajectory.poses.size(), 2U);
  EXPECT_EQ(trajectory.covariances.size(), 2U);
  EXPECT_EQ(trajectory.poses[0].time_ns, 20) << "the first valid pose of this time";
}

TEST_F(Saving, WritesStatesOfRobotThatWasNeverLocalized) {
  Merger merger({}, {}, {});
  PoseEstimate pose;
  pose.robot = "r9";
  merger.addTrajectory(pose);
  EXPECT_TRUE(merger.save(folder_.string()).empty());
  EXPECT_EQ(dataset::readLocalization((folder_ / "localization/r9.csv").string()).size(), 1U);
  EXPECT_FALSE(fs::exists(folder_ / "trajectories/r9.tum"));
}

TEST_F(Saving, WritesAllFilesReadably) {
  Merger merger = full(14);
  EXPECT_TRUE(merger.save(folder_.string()).empty());
  EXPECT_EQ(dataset::readObjects((folder_ / "objects.geojson").string()).size(), 5U);
  EXPECT_EQ(dataset::readMapServer((folder_ / "map.yaml").string()).cells,
            merger.map().grid(merger.outlines()).cells);
  EXPECT_EQ(dataset::readTum((folder_ / "trajectories/r2.tum").string()).size(), 40U);
  EXPECT_EQ(dataset::readFile((folder_ / "map.bt").string()), merger.map().octreeBytes(merger.outlines()));
  const cv::Mat picture = cv::imread((folder_ / "map.png").string());
  EXPECT_GT(picture.cols, 800);
  EXPECT_LT(picture.cols, 2000);
  if (const char* keep = std::getenv("OMNIFLEET_KEEP_PICTURE"))
    fs::copy_file(folder_ / "map.png", keep, fs::copy_options::overwrite_existing);
}

TEST_F(Saving, IsReproducibleByteForByte) {
  Merger a = full(15), b = full(15);
  ASSERT_TRUE(a.save((folder_ / "a").string()).empty());
  ASSERT_TRUE(b.save((folder_ / "b").string()).empty());
  EXPECT_EQ(contents(folder_ / "a"), contents(folder_ / "b"));
}

TEST_F(Saving, ReportsFailedFileAndKeepsTheOthers) {
  Merger merger = full(16);
  ASSERT_TRUE(merger.save(folder_.string()).empty());
  const auto before = contents(folder_);
  fs::remove(folder_ / "map.bt");
  fs::create_directory(folder_ / "map.bt");  // cannot be replaced by a file
  std::ofstream(folder_ / "map.bt" / "x") << "x";
  const auto problems = merger.save(folder_.string());
  ASSERT_EQ(problems.size(), 1U);
  EXPECT_NE(problems.front().find("map.bt"), std::string::npos);
  auto after = contents(folder_);
  EXPECT_EQ(after.at("objects.geojson"), before.at("objects.geojson"));
  EXPECT_EQ(after.at("map.png"), before.at("map.png"));
}

TEST_F(Saving, WritesAnEmptyMap) {
  Merger merger({}, {}, {});
  merger.finish();
  EXPECT_THAT(merger.save(folder_.string()), ::testing::IsEmpty());
  EXPECT_TRUE(dataset::readObjects((folder_ / "objects.geojson").string()).empty());
}

}  // namespace
}  // namespace omnifleet::global_merger
