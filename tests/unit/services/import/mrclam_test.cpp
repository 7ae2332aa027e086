// A small hand-written MRCLAM data set: the import of each of its files, and the messages about damaged
// files.
#include "import/mrclam.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "options/options.h"
#include "tests/test_data.h"

namespace omnifleet::import {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Two robots (subjects 1, 2; barcodes 5, 14) and two landmarks (6, 7; barcodes 72, 27).
class Mrclam : public ::testing::Test {
 protected:
  Mrclam() {
    put("Barcodes.dat", "# Subject #   Barcode #\n 1   5\n 2  14\n 6  72\n 7  27\n");
    put("Landmark_Groundtruth.dat", "6  1.5 -2.25  0.0001 0.0001\n7 -0.5  3.0  0.0001 0.0001\n");
    put("Robot1_Odometry.dat", "1000.000  0.2  0.5\n1000.200  0.1 -0.5\n1000.2004 0.3 0.0\n");
    put("Robot2_Odometry.dat", "1000.100  0.0  0.0\n");
    put("Robot1_Measurement.dat", "1000.050 72 2.5 0.25\n1000.050 14 1.25 -0.5\n1000.300 99 3.0 0.1\n");
    put("Robot2_Measurement.dat", "1000.150 5 1.0 3.0\n");
    put("Robot1_Groundtruth.dat", "999.9 1.0 2.0 0.5\n1000.0 1.1 2.0 0.6\n1000.1 1.2 2.0 7.0\n");
    put("Robot2_Groundtruth.dat", "1000.0 -1.0 0.0 -3.0\n");
  }

  void put(const std::string& name, const std::string& text) { std::ofstream(source_ / name) << text; }
  MrclamReport import(const MrclamOptions& options = {}) {
    return importMrclam(source_.path(), out(), options);
  }
  std::string out() const { return folder_ / "dataset"; }

  const test::TempFolder source_, folder_;
};

TEST_F(Mrclam, ConvertsOdometryToWheelSpeeds) {
  const MrclamReport report = import();
  EXPECT_EQ(report.robots, 2);
  EXPECT_EQ(report.odometry_rows, 4u);
  EXPECT_THAT(report.warnings, ElementsAre());
  const dataset::Dataset recording = dataset::Dataset::open(out());
  ASSERT_EQ(recording.robots.size(), 2u);
  const auto& r1 = recording.robots[0];
  EXPECT_EQ(r1.name, "r1");
  EXPECT_FALSE(r1.initial_pose);
  ASSERT_EQ(r1.wheels.size(), 3u);
  EXPECT_EQ(r1.wheels[0].time_ns, 1'000'000'000'000);
  EXPECT_EQ(r1.wheels[1].time_ns, 1'000'200'000'000);
  EXPECT_EQ(r1.wheels[2].time_ns, 1'000'200'400'000);
  // Unicycle: v = (l + r)/2, ω = (r − l)/separation.
  for (std::size_t i = 0; i < 3; ++i) {
    const std::array<double, 3> v{0.2, 0.1, 0.3}, w{0.5, -0.5, 0.0};
    EXPECT_NEAR(0.5 * (r1.wheels[i].left_mps + r1.wheels[i].right_mps), v[i], 1e-9);
    EXPECT_NEAR((r1.wheels[i].right_mps - r1.wheels[i].left_mps) / r1.body.wheel_separation_m, w[i], 1e-9);
  }
}

TEST_F(Mrclam, ResolvesBarcodesToLandmarksAndRobots) {
  const MrclamReport report = import();
  EXPECT_EQ(report.observations, 4u);
  EXPECT_EQ(report.unknown_barcodes, 1u);
  const dataset::Dataset recording = dataset::Dataset::open(out());
  const auto& seen = recording.robots[0].observations;
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_EQ(seen[0].id, "6");
  EXPECT_EQ(seen[0].time_ns, 1'000'050'000'000);
  EXPECT_DOUBLE_EQ(seen[0].range_m, 2.5);
  EXPECT_DOUBLE_EQ(seen[0].bearing_rad, 0.25);
  EXPECT_EQ(seen[1].id, "r2");
  EXPECT_EQ(seen[2].id, "barcode99");
  ASSERT_EQ(recording.robots[1].observations.size(), 1u);
  EXPECT_EQ(recording.robots[1].observations[0].id, "r1");
}

TEST_F(Mrclam, WritesTruthForEvaluationOnlyUnlessRequested) {
  import();
  EXPECT_TRUE(dataset::Dataset::open(out()).landmarks.empty());
  const auto truth = dataset::GroundTruth::load(out());
  ASSERT_EQ(truth.trajectories.at("r1").size(), 3u);
  EXPECT_NEAR(truth.trajectories.at("r1")[2].map_from_base.theta_rad, 7.0 - 2.0 * M_PI, 1e-8);
  ASSERT_EQ(truth.scene.size(), 2u);
  EXPECT_EQ(truth.scene[0].name, "6");
  EXPECT_NEAR(truth.scene[0].centroid_m.x(), 1.5, 1e-9);
  EXPECT_NEAR(truth.scene[0].centroid_m.y(), -2.25, 1e-9);

  MrclamOptions all;
  all.survey = all.initial_poses = true;
  import(all);
  const dataset::Dataset surveyed = dataset::Dataset::open(out());
  ASSERT_EQ(surveyed.landmarks.size(), 2u);
  EXPECT_EQ(surveyed.landmarks[1].name, "7");
  EXPECT_NEAR(surveyed.landmarks[1].position_m.y(), 3.0, 1e-9);
  // The last true pose at or before the first row of odometry, or else the first one after it.
  ASSERT_TRUE(surveyed.robots[0].initial_pose && surveyed.robots[1].initial_pose);
  EXPECT_NEAR(surveyed.robots[0].initial_pose->x_m, 1.1, 1e-9);
  EXPECT_NEAR(surveyed.robots[1].initial_pose->theta_rad, -3.0, 1e-9);
}

TEST_F(Mrclam, SkipsAndNamesDamagedRows) {
  put("Robot1_Odometry.dat", "1000.0 0.2 0.5\n1000.1 nan 0.5\n1000.2 0.2\n1000.3 0.2 0.1\n");
  put("Robot1_Measurement.dat", "1000.05 27 2.5 0.25\nnever 72 2.5 0.2\n");
  put("Landmark_Groundtruth.dat", "6  1.5 -2.25\n7 here there\n");
  const MrclamReport report = import();
  EXPECT_THAT(report.warnings,
              ::testing::UnorderedElementsAre(HasSubstr("Landmark_Groundtruth.dat:2: expected a subject"),
                                              HasSubstr("Robot1_Odometry.dat:2: expected a time"),
                                              HasSubstr("Robot1_Odometry.dat:3: expected a time"),
                                              HasSubstr("Robot1_Measurement.dat:2: expected a time")));
  const dataset::Dataset recording = dataset::Dataset::open(out());
  EXPECT_EQ(recording.robots[0].wheels.size(), 2u);
  EXPECT_EQ(report.landmarks, 1);
  ASSERT_EQ(recording.robots[0].observations.size(), 1u);
  EXPECT_EQ(recording.robots[0].observations[0].id, "7")
      << "it must still be a landmark, with unknown position";
}

TEST_F(Mrclam, RejectsUnusableInput) {
  put("Robot1_Odometry.dat", "no numbers\n");
  EXPECT_THROW(import(), options::Error);
  std::filesystem::remove(source_ / "Robot1_Odometry.dat");
  std::filesystem::remove(source_ / "Robot2_Odometry.dat");
  EXPECT_THROW(import(), options::Error);
  std::filesystem::remove(source_ / "Barcodes.dat");
  EXPECT_THROW(import(), options::Error);
  EXPECT_THROW(importMrclam(source_ / "nowhere", out(), {}), options::Error);
}

/// Runs the import program. @return exit code and output
std::pair<int, std::string> run(const std::string& arguments) {
  std::FILE* pipe = ::popen((std::string(OMNIFLEET_IMPORT_PROGRAM) + " " + arguments + " 2>&1").c_str(), "r");
  std::string output;
  std::array<char, 4096> chunk{};
  while (std::fgets(chunk.data(), chunk.size(), pipe)) output += chunk.data();
  const int status = ::pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, output};
}

TEST_F(Mrclam, ProgramReadsFoldersAndArchivesAndNamesInvalidOnes) {
  const auto [code, output] = run(source_.path() + " " + out());
  EXPECT_EQ(code, 0) << output;
  EXPECT_THAT(output,
              HasSubstr("2 robots, 2 landmarks, 4 rows of odometry, 4 observations, 1 of unknown barcodes"));
  const std::string archive = folder_ / "set.tar.gz";
  ASSERT_EQ(std::system(("tar -czf " + archive + " -C " + source_.path() + " .").c_str()), 0);
  EXPECT_EQ(run(archive + " " + (folder_ / "from_archive")).first, 0);
  EXPECT_EQ(dataset::Dataset::open(folder_ / "from_archive").robots.size(), 2u);

  std::filesystem::resize_file(archive, 60);
  const auto [cut, why] = run(archive + " " + (folder_ / "from_cut"));
  EXPECT_EQ(cut, 2);
  EXPECT_THAT(why, HasSubstr("set.tar.gz"));
  EXPECT_EQ(run("/nowhere/at/all " + (folder_ / "from_nowhere")).first, 2);
  const std::string again =
      folder_ / "from_archive";  // an import without --survey must remove the survey of an earlier one
  EXPECT_THAT(run(source_.path() + " " + again + " --survey").second, HasSubstr("--force"));
  EXPECT_EQ(run(source_.path() + " " + again + " --survey --force").first, 0);
  EXPECT_FALSE(dataset::Dataset::open(again).landmarks.empty());
  EXPECT_EQ(run(source_.path() + " " + again + " --force").first, 0);
  EXPECT_TRUE(dataset::Dataset::open(again).landmarks.empty());
  EXPECT_EQ(run(source_.path() + " " + out() + " --wheel-separation 0").first, 2);
  EXPECT_EQ(run("").first, 2);
}

}  // namespace
}  // namespace omnifleet::import
