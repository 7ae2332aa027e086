#include "evaluate/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "appearance/map_files.h"
#include "dataset/atomic_file.h"
#include "dataset/writer.h"
#include "tests/test_data.h"

namespace omnifleet::evaluate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kShift_m = 0.02;

dataset::MapObject box(std::uint64_t id, double x, double y) {
  dataset::MapObject object;
  object.id = id;
  object.outline_m = {{x - 0.1, y - 0.1}, {x + 0.1, y - 0.1}, {x + 0.1, y + 0.1}, {x - 0.1, y + 0.1}};
  object.centroid_m = {x, y};
  return object;
}

dataset::RobotMerge mergeRow(AlignmentStatus status, const std::string& frame, const std::string& reason) {
  dataset::RobotMerge row;
  row.status = status;
  row.frame = frame;
  row.reason = reason;
  return row;
}

/// A recording with ground truth, and a run with an error of 2 cm in x.
class Evaluate : public ::testing::Test {
 protected:
  void SetUp() override {
    dataset::RobotRecording r1;
    r1.name = "r1";
    r1.body = {0.15, {}, 0.3, 0.26};
    dataset::writeDatasetYaml(recording_, {r1});
    lens::CameraModel camera;
    camera.image_width_px = camera.image_height_px = 8;
    camera.focal_px = {3, 3};
    dataset::ImageStreamWriter frames(recording_, "r1/fisheye", camera);
    std::vector<dataset::StampedPose> truth, estimate;
    appearance::SavedMap places;
    places.robot = "r1";
    places.frame = "map";
    for (int i = 0; i < 10; ++i) {
      const Pose2 pose{0.1 * i, 0.02 * i * i, 0.05 * i};
      truth.push_back({i * 100, pose});
      estimate.push_back({i * 100, Pose2{pose.x_m + kShift_m, pose.y_m, pose.theta_rad}});
      Place place;
      place.robot = "r1";
      place.index = place.sequence = static_cast<std::uint32_t>(i);
      place.acquired_ns = i * 100;
      place.frame_from_base = {2 * pose.x_m, 2 * pose.y_m, 0};
      places.places.push_back(place);
      frames.writeMissing(i * 100);
    }
    dataset::writeTruthTrajectory(recording_, "r1", truth);
    dataset::writeTruthScene(recording_, {box(0, 1, 1), box(1, -1, 0)});
    dataset::writeTum(out_ + "/trajectories/r1.tum", estimate);
    appearance::saveMap(out_ + "/places/r1.g2o", places);
    dataset::writeObjects(out_ + "/objects.geojson", {box(7, 1 + kShift_m, 1), box(8, 3, 3)});
    dataset::writeAtomic(out_ + "/tracks/r1.csv", "#t,track,kind,x,y\n0,1,obstacle,1,1\n");
  }

  test::TempFolder folder_;
  const std::string recording_ = folder_ / "recording", out_ = folder_ / "out";
};

TEST_F(Evaluate, RefusesATopologicalMapThatIsCutShortOrAltered) {
  const std::string path = out_ + "/places/r1.g2o", text = dataset::readFile(path);
  const auto expectRefused = [&] {
    try {
      evaluateRun(out_, recording_);
      FAIL() << "the map must be refused";
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("places/r1.g2o"), std::string::npos) << error.what();
    }
  };
  dataset::writeAtomic(path, text.substr(0, text.find("VERTEX_SE2 5")));
  expectRefused();
  std::string altered = text;
  altered[text.find("VERTEX_SE2 5") + 13] = '7';
  dataset::writeAtomic(path, altered);
  expectRefused();
  dataset::writeAtomic(path, text);
  EXPECT_EQ(evaluateRun(out_, recording_).robots[0].places, 10);
  std::filesystem::remove(path + ".signatures");
  expectRefused();
}

TEST_F(Evaluate, MeasuresInsertedErrors) {
  const Report report = evaluateRun(out_, recording_);
  ASSERT_TRUE(report.map);
  EXPECT_EQ(report.map->matches.size(), 1u);
  EXPECT_NEAR(report.map->x_error_m, kShift_m, 1e-9);
  EXPECT_EQ(report.map->missed.size(), 1u);
  EXPECT_EQ(report.map->falsely_found.size(), 1u);
  ASSERT_EQ(report.robots.size(), 1u);
  const RobotReport& r1 = report.robots[0];
  EXPECT_EQ(r1.frames, 10);
  EXPECT_EQ(r1.path.poses, 10);
  EXPECT_NEAR(r1.path.distance_m, kShift_m, 1e-8);
  EXPECT_LT(r1.ate_m.rmse, 1e-8) << "alignment removes a shift";
  ASSERT_TRUE(r1.places_shape_difference);
  EXPECT_NEAR(*r1.places_shape_difference, 0.0, 1e-9) << "the shape difference is invariant to scale";
  ASSERT_TRUE(r1.shape_difference);
  EXPECT_NEAR(*r1.shape_difference, 0.0, 1e-9) << "the shape difference is invariant to a shift";
  ASSERT_TRUE(report.kinds);
  EXPECT_EQ(report.kinds->obstacle.right, 1);
}

TEST_F(Evaluate, RejectsRunOfAnotherRecording) {
  dataset::writeTum(out_ + "/trajectories/r3.tum", std::vector<dataset::StampedPose>{{0, Pose2{}}});
  try {
    evaluateRun(out_, recording_);
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("r3.tum"), HasSubstr("has no robot 'r3'")));
  }
}

TEST_F(Evaluate, ReportsSameValuesInTableAndJson) {
  const Report report = evaluateRun(out_, recording_);
  EXPECT_THAT(table(report), AllOf(HasSubstr("found 1 of 2, missed 1, false 1"), HasSubstr("2.00 /  0.00 cm"),
                                   HasSubstr("10/10"), HasSubstr("missed, at (-1.00, 0.00) m"),
                                   HasSubstr("false, at (3.00, 3.00) m")));
  const auto json = nlohmann::json::parse(metricsJson(report));
  EXPECT_NEAR(json["map"]["x_error_m"].get<double>(), kShift_m, 1e-9);
  EXPECT_EQ(json["map"]["missed"], nlohmann::json::array({1}));
  EXPECT_EQ(json["map"]["false"], nlohmann::json::array({8}));
  EXPECT_TRUE(json["map"]["distances_error_m"].is_null()) << "one match gives no pair of distances";
  EXPECT_NEAR(json["paths"]["r1"]["distance_m"].get<double>(), kShift_m, 1e-8);
  EXPECT_EQ(json["paths_mean"]["robots"], 1);
  EXPECT_EQ(json["kinds"]["obstacle"]["f1"], 1.0);
}

TEST_F(Evaluate, ComparesCovariancesWithErrors) {
  EXPECT_FALSE(evaluateRun(out_, recording_).robots[0].consistency) << "the run has no covariances";
  EXPECT_EQ(metricsJson(evaluateRun(out_, recording_)).find("nees"), std::string::npos);
  std::vector<dataset::StampedCovariance> rows;
  for (int i = 0; i < 10; ++i)
    rows.push_back({i * 100, Eigen::Vector3d(kShift_m, kShift_m, 0.01).cwiseAbs2().asDiagonal()});
  dataset::writeCovariances(out_ + "/covariances/r1.csv", rows);
  const Report report = evaluateRun(out_, recording_);
  ASSERT_TRUE(report.robots[0].consistency);
  EXPECT_EQ(report.robots[0].consistency->samples, 10);
  EXPECT_NEAR(report.robots[0].consistency->mean, 1.0, 1e-6) << "the error is one σ in one direction";
  const auto json = nlohmann::json::parse(metricsJson(report));
  EXPECT_NEAR(json["paths"]["r1"]["consistency"]["nees_mean"].get<double>(), 1.0, 1e-6);
  EXPECT_EQ(json["paths_mean"]["consistency"]["samples"], 10);
  EXPECT_THAT(table(report), HasSubstr("NEES"));
}

TEST_F(Evaluate, GroupsErrorsByLocalizationState) {
  EXPECT_FALSE(evaluateRun(out_, recording_).robots[0].localization) << "the run has no states";
  EXPECT_THAT(table(evaluateRun(out_, recording_)), ::testing::Not(HasSubstr("States")));
  EXPECT_EQ(metricsJson(evaluateRun(out_, recording_)).find("localization"), std::string::npos);
  // Of ten frames seven are localized, one is a relocalization, one is odometry, one has no row.
  std::vector<dataset::StampedLocalization> rows;
  for (int i = 0; i < 9; ++i) rows.push_back({i * 100, LocalizationState::kLocalized, PoseEvent::kNone, 0.0});
  rows[2].state = LocalizationState::kOdometryOnly;
  rows[3] = {300, LocalizationState::kRelocalized, PoseEvent::kRelocalized, 8.0};
  rows[6].event = rows[8].event = PoseEvent::kLoopClosed;
  rows[6].correction_sigmas = 14.25;
  rows[8].correction_sigmas = 3.5;
  for (std::size_t i = 0; i < 9; ++i) rows[i].used.add(i < 3 ? Source::kScan : Source::kWheels);
  rows[4].rejected.add(Source::kScan);
  dataset::writeLocalization(out_ + "/localization/r1.csv", rows);
  const Report report = evaluateRun(out_, recording_);
  ASSERT_TRUE(report.robots[0].localization);
  EXPECT_THAT(table(report),
              HasSubstr("  r1         localized 70.0 % (2.00 / 2.00 cm, 0.00 / 0.00°), odometry_only 10.0 % "
                        "(2.00 / 2.00 cm, 0.00 / 0.00°), lost 0.0 %, relocalized 10.0 % (2.00 / 2.00 cm, "
                        "0.00 / 0.00°), no pose sample 10.0 %; events: relocalized 1, loop_closed 2, "
                        "largest correction 14.2 σ\n"));
  EXPECT_THAT(table(report), HasSubstr("  r1         wheels 66.7 %, scan 33.3 % (rejected 11.1 %)\n"));
  const auto json = nlohmann::json::parse(metricsJson(report))["paths"]["r1"]["localization"];
  EXPECT_EQ(json["sources"].size(), 2u);
  EXPECT_NEAR(json["sources"]["scan"]["rejected"].get<double>(), 1.0 / 9.0, 1e-12);
  EXPECT_EQ(json["frames"], 10);
  EXPECT_EQ(json["without_state"], 1);
  EXPECT_EQ(json["states"].size(), 5u);
  EXPECT_EQ(json["states"]["localized"]["frames"], 7);
  EXPECT_NEAR(json["states"]["localized"]["share"].get<double>(), 0.7, 1e-12);
  EXPECT_NEAR(json["states"]["odometry_only"]["max_m"].get<double>(), kShift_m, 1e-8);
  EXPECT_TRUE(json["states"]["lost"]["mean_m"].is_null()) << "no frame";
  EXPECT_EQ(json["events"].size(), 2u);
  EXPECT_EQ(json["events"]["loop_closed"]["count"], 2);
  EXPECT_EQ(json["events"]["loop_closed"]["largest_correction_sigmas"], 14.25);
}

TEST_F(Evaluate, ReportsDamagedLocalizationFile) {
  dataset::writeAtomic(out_ + "/localization/r1.csv", "0,lost,none,0\n100,unknown_state,none,0\n");
  const Report report = evaluateRun(out_, recording_);
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_THAT(report.warnings[0], AllOf(HasSubstr("localization/r1.csv:2"), HasSubstr("row ignored")));
  EXPECT_EQ(report.robots[0].localization->states.at(LocalizationState::kLost).frames, 1);
  EXPECT_THAT(table(report), HasSubstr("events: none"));
  dataset::writeAtomic(out_ + "/localization/r1.csv", "0,lost\n");
  EXPECT_THROW(evaluateRun(out_, recording_), std::runtime_error) << "no row is usable";
  dataset::writeAtomic(out_ + "/localization/r1.csv", "#timestamp [ns],state,event,correction [sigma]\n");
  EXPECT_FALSE(evaluateRun(out_, recording_).robots[0].localization) << "a file without rows";
}

TEST_F(Evaluate, ReportsFreeSpaceOutsideWalls) {
  EXPECT_FALSE(evaluateRun(out_, recording_).free_space) << "the run has no grid";
  dataset::OccupancyGrid grid;
  grid.width = grid.height = 100;
  grid.origin_m = {-2.5, -2.5};
  grid.cells.assign(10000, 0);
  dataset::writeMapServer(out_ + "/map", grid);
  EXPECT_FALSE(evaluateRun(out_, recording_).free_space->outside_m2) << "the truth has no room";
  dataset::writeTruthRoom(recording_, {{-2, -2}, {2, -2}, {2, 2}, {-2, 2}});
  const Report report = evaluateRun(out_, recording_);
  EXPECT_NEAR(report.free_space->outside_m2.value(), 25.0 - 16.0, 1e-9);
  EXPECT_NEAR(report.free_space->in_obstacles_m2, 2 * 0.04, 1e-9) << "two boxes of 20 cm, cells of 5 cm";
  const auto json = nlohmann::json::parse(metricsJson(report));
  EXPECT_NEAR(json["free_space"]["behind_walls_m2"].get<double>(), 9.0, 1e-9);
  EXPECT_THAT(table(report), HasSubstr("outside the walls   9.00 m²"));
}

// The true box 0 spans x and y from 0.9 m to 1.1 m. Its left side is occupied, as are two cells 5 m away.
TEST_F(Evaluate, ReportsCellsAtTrueFaces) {
  EXPECT_FALSE(evaluateRun(out_, recording_).cells) << "the run has no grid";
  EXPECT_THAT(table(evaluateRun(out_, recording_)), ::testing::Not(HasSubstr("Cells")));
  dataset::OccupancyGrid grid;
  grid.width = grid.height = 160;
  grid.origin_m = {-2.525, -2.525};
  grid.cells.assign(25600, -1);
  for (const int row : {69, 70}) grid.cells[row * 160 + 68] = 100;     // around (0.9, 0.95) and (0.9, 1.0)
  for (const int row : {140, 141}) grid.cells[row * 160 + 140] = 100;  // around (4.5, 4.5)
  dataset::writeMapServer(out_ + "/map", grid);
  const Report report = evaluateRun(out_, recording_);
  ASSERT_TRUE(report.cells);
  EXPECT_EQ(report.cells->occupied, 4);
  EXPECT_EQ(report.cells->obstacles.within_2cm, 0.5);
  EXPECT_GT(report.cells->obstacles.seen, 0) << "the robot starts 1.4 m from the box";
  const std::string text = table(report);
  EXPECT_THAT(text, HasSubstr("Cells       occupied 4; of these, 0 fill known outlines"));
  EXPECT_THAT(text,
              HasSubstr("of a true face 50.0 %, within 2 cm 50.0 % (obstacles 50.0 %, structure - %)\n"));
  EXPECT_THAT(text, HasSubstr("free area wrong - %;")) << "no free cell";
  const auto json = nlohmann::json::parse(metricsJson(report))["cells"];
  EXPECT_EQ(json["occupied"], 4);
  EXPECT_EQ(json["inside_outlines"], 0);
  EXPECT_EQ(json["obstacles"]["within_2cm"], 0.5);
  EXPECT_EQ(json["all"]["within_5cm"], 0.5);
  EXPECT_EQ(json["all"]["seen_points"], report.cells->all.seen);
  EXPECT_EQ(json["crossed"], report.cells->crossed);
  EXPECT_DOUBLE_EQ(json["occupied_per_crossed"].get<double>(), 4.0 / report.cells->crossed);
  EXPECT_TRUE(json["structure"]["within_2cm"].is_null()) << "the truth has no room";
  dataset::writeMerge(out_ + "/merge.json",
                      {{"r1", mergeRow(AlignmentStatus::kRefused, "r1", "look-alike")}});
  EXPECT_EQ(evaluateRun(out_, recording_).cells->obstacles.seen, 0)
      << "what a robot in its own frame sees is not in the common map";
  EXPECT_TRUE(json["free_wrong"].is_null());
}

// The demo records the truth of a simulated run, without images.
TEST_F(Evaluate, CountsFacesSeenInARecordingWithoutSensors) {
  dataset::OccupancyGrid grid;
  grid.width = grid.height = 160;
  grid.origin_m = {-2.525, -2.525};
  grid.cells.assign(25600, -1);
  dataset::writeMapServer(out_ + "/map", grid);
  std::filesystem::remove_all(recording_ + "/r1");
  EXPECT_GT(evaluateRun(out_, recording_).cells->obstacles.seen, 0);
  dataset::RobotRecording r1, r2;
  r1.name = "r1";
  r2.name = "r2";
  r1.body = r2.body = {0.15, {}, 0.3, 0.26};
  dataset::writeDatasetYaml(recording_, {r1, r2});
  lens::CameraModel camera;
  camera.image_width_px = camera.image_height_px = 8;
  camera.focal_px = {3, 3};
  dataset::ImageStreamWriter(recording_, "r2/fisheye", camera).writeMissing(0);
  EXPECT_EQ(evaluateRun(out_, recording_).cells->obstacles.seen, 0)
      << "r1 is parked beside a robot with a camera";
}

// A path along x, of which every other point lies 1 cm aside: (x, 0) against (x, ±d). With Σx² = S over 10
// points and M = AᵀC of (S, Σx·±d; 0, 0) only the first singular value differs from zero, so that
// μ = 1 − (S² + (Σx·±d)²) / (S (S + 10 d²)).
TEST_F(Evaluate, ReportsShapeDifferenceOfTrajectory) {
  std::vector<dataset::StampedPose> truth, estimate;
  double s = 0.0, mixed = 0.0;
  for (int i = 0; i < 10; ++i) {
    const double x = 0.1 * (i - 4.5), d = i % 2 == 0 ? 0.01 : -0.01;
    truth.push_back({i * 100, Pose2{x, 0.0, 0.0}});
    estimate.push_back({i * 100, Pose2{x, d, 0.0}});
    s += x * x;
    mixed += x * d;
  }
  dataset::writeTruthTrajectory(recording_, "r1", truth);
  dataset::writeTum(out_ + "/trajectories/r1.tum", estimate);
  const double expected = 1.0 - (s * s + mixed * mixed) / (s * (s + 10 * 1e-4));
  const Report report = evaluateRun(out_, recording_);
  EXPECT_NEAR(report.robots[0].shape_difference.value(), expected, 1e-12);
  const auto json = nlohmann::json::parse(metricsJson(report));
  EXPECT_NEAR(json["paths"]["r1"]["shape_difference"].get<double>(), expected, 1e-12);
  EXPECT_NEAR(json["paths_mean"]["shape_difference"].get<double>(), expected, 1e-12);
  EXPECT_THAT(table(report), AllOf(HasSubstr("shape\n"), HasSubstr(" 0.001174\n")));
  EXPECT_NEAR(expected, 0.001174, 5e-7) << "as printed";
}

TEST_F(Evaluate, ComparesRobotInItsOwnFrameAfterAlignment) {
  EXPECT_THAT(table(evaluateRun(out_, recording_)), ::testing::Not(HasSubstr("Frames")));
  const Report before = evaluateRun(out_, recording_);
  auto own = dataset::flat(dataset::readTum(out_ + "/trajectories/r1.tum"));
  for (auto& pose : own) pose.map_from_base = Pose2{3.0, -7.0, 2.0} * pose.map_from_base;
  own[4].map_from_base.x_m += 0.03;  // an error that no rigid motion explains
  dataset::writeTum(out_ + "/maps/r1/trajectories/r1.tum", own);
  std::filesystem::remove(out_ + "/trajectories/r1.tum");
  dataset::writeMerge(out_ + "/merge.json",
                      {{"r1", mergeRow(AlignmentStatus::kUndecided, "r1", "no shared place")}});
  const Report report = evaluateRun(out_, recording_);
  const RobotReport& r1 = report.robots[0];
  EXPECT_EQ(r1.path.poses, 0) << "it is not in the common map";
  ASSERT_TRUE(r1.own_frame);
  EXPECT_EQ(r1.own_frame->poses, 10);
  EXPECT_GT(r1.own_frame->max_m, 0.02);
  EXPECT_LT(r1.own_frame->max_m, 0.03) << "the alignment spreads the error of one pose";
  EXPECT_GT(r1.shape_difference.value(), 1e-5);
  EXPECT_THAT(table(report),
              AllOf(HasSubstr("Frames\n  r1         undecided, in its own frame: no shared place\n"),
                    HasSubstr("in its own frame, 10 poses after rigid alignment: "),
                    ::testing::Not(HasSubstr("has no trajectory"))));
  const auto json = nlohmann::json::parse(metricsJson(report));
  EXPECT_EQ(json["frames"]["r1"]["status"], "undecided");
  EXPECT_EQ(json["frames"]["r1"]["frame"], "r1");
  EXPECT_TRUE(json["frames"]["r1"]["score"].is_null());
  EXPECT_EQ(json["paths"]["r1"]["own_frame_aligned"]["poses"], 10);
  EXPECT_TRUE(json["paths"]["r1"]["distance_m"].is_null());
  EXPECT_EQ(json["paths_mean"]["robots"], 0);
  EXPECT_EQ(before.robots[0].path.poses, 10);
}

TEST_F(Evaluate, ComparesMatchedRobotInTheCommonMap) {
  auto row = mergeRow(AlignmentStatus::kMatched, "map", "3 shared places");
  row.score = 0.875;
  dataset::writeMerge(out_ + "/merge.json", {{"r1", row}, {"r9", row}});
  const Report report = evaluateRun(out_, recording_);
  EXPECT_EQ(report.robots[0].path.poses, 10);
  EXPECT_FALSE(report.robots[0].own_frame);
  EXPECT_THAT(table(report), HasSubstr("Frames\n  r1         matched, score 0.88: 3 shared places\n"));
  EXPECT_NEAR(nlohmann::json::parse(metricsJson(report))["frames"]["r1"]["score"].get<double>(), 0.875,
              1e-12);
}

TEST_F(Evaluate, ReportsDamagedMergeFile) {
  dataset::writeAtomic(out_ + "/merge.json", "{\"robots\": {");
  EXPECT_THROW(evaluateRun(out_, recording_), std::runtime_error);
}

TEST_F(Evaluate, NamesMissingResults) {
  std::filesystem::remove(out_ + "/trajectories/r1.tum");
  const Report report = evaluateRun(out_, recording_);
  EXPECT_FALSE(report.robots[0].has_trajectory);
  EXPECT_THAT(table(report), HasSubstr("has no trajectory"));
  std::filesystem::remove(out_ + "/objects.geojson");
  EXPECT_THROW(evaluateRun(out_, recording_), std::runtime_error);
  EXPECT_THROW(evaluateRun(folder_ / "nowhere", recording_), options::Error);
  std::filesystem::remove_all(recording_ + "/groundtruth");
  EXPECT_THROW(evaluateRun(out_, recording_), options::Error);
}

/// Two robots on arcs with exact wheels, and three named landmarks. The run is in an arbitrary frame.
class FreeFrame : public ::testing::Test {
 protected:
  static constexpr double kSpeed_mps = 0.2, kTurn_radps = 0.1, kSeparation_m = 0.3;
  const Pose2 map_from_truth{0.7, -1.3, 2.1};

  static Pose2 truth(const Pose2& initial, double t) {
    const double a = kTurn_radps * t, r = kSpeed_mps / kTurn_radps;
    return initial * Pose2{r * std::sin(a), r * (1.0 - std::cos(a)), a};
  }
  static dataset::MapObject landmark(std::uint64_t id, const std::string& name, const Eigen::Vector2d& at) {
    dataset::MapObject object = box(id, at.x(), at.y());
    object.name = name;
    return object;
  }

  void SetUp() override {
    std::vector<dataset::RobotRecording> robots;
    for (const auto& [name, initial] : initial_poses_) {
      dataset::RobotRecording robot;
      robot.name = name;
      robot.body = {0.15, {}, 0.3, kSeparation_m};
      robots.push_back(robot);
      std::vector<dataset::StampedPose> exact, run;
      dataset::WheelsWriter wheels(recording_, name);
      dataset::ObservationsWriter observations(recording_, name);
      for (int i = 0; i <= 100; ++i) {
        const TimeNs time = i * 100'000'000LL;
        exact.push_back({time, truth(initial, 0.1 * i)});
        run.push_back({time, map_from_truth * exact.back().map_from_base});
        const double half_mps = 0.5 * kTurn_radps * kSeparation_m;
        wheels.write({time, kSpeed_mps - half_mps, kSpeed_mps + half_mps});
        observations.write({time, "a", 1.0, 0.0});
      }
      dataset::writeTruthTrajectory(recording_, name, exact);
      dataset::writeTum(out_ + "/trajectories/" + name + ".tum", run);
    }
    dataset::writeDatasetYaml(recording_, robots);
    std::vector<dataset::MapObject> scene, found;
    for (const auto& [name, at] : places_) {
      scene.push_back(landmark(scene.size(), name, at));
      found.push_back(landmark(10 + found.size(), name, map_from_truth * at));
    }
    found[1].centroid_m += Eigen::Vector2d(0.03, 0.04);
    found.erase(found.begin());
    found.push_back(landmark(20, "unlisted", {5, 5}));
    dataset::writeTruthScene(recording_, scene);
    dataset::writeObjects(out_ + "/objects.geojson", found);
  }

  const std::vector<std::pair<std::string, Pose2>> initial_poses_{{"r1", {0, 0, 0}}, {"r2", {1, -1, 1.5}}};
  const std::vector<std::pair<std::string, Eigen::Vector2d>> places_{
      {"a", {1, 1}}, {"b", {-2, 0}}, {"c", {0, 3}}};
  test::TempFolder folder_;
  const std::string recording_ = folder_ / "recording", out_ = folder_ / "out";
};

TEST_F(FreeFrame, AlignsWholeRunByOneRigidMotion) {
  const Report report = evaluateRun(out_, recording_, Frame::kFree);
  ASSERT_TRUE(report.truth_from_map);
  const Pose2 back = *report.truth_from_map * map_from_truth;
  EXPECT_LT(back.translation().norm(), 1e-7);  // files have nine decimals
  EXPECT_LT(std::abs(back.theta_rad), 1e-7);
  ASSERT_EQ(report.robots.size(), 2u);
  for (const RobotReport& robot : report.robots) {
    EXPECT_EQ(robot.path.poses, 101);
    EXPECT_LT(robot.path.max_m, 1e-7) << robot.name;
    EXPECT_LT(robot.path.heading_rad, 1e-7) << robot.name;
  }
  EXPECT_THAT(table(report), HasSubstr("the run is aligned to the truth"));
  EXPECT_NEAR(nlohmann::json::parse(metricsJson(report))["truth_from_map"][2].get<double>(),
              -map_from_truth.theta_rad, 1e-6);
}

TEST_F(FreeFrame, KeepsErrorsOfFrameWithoutAlignment) {
  const Report report = evaluateRun(out_, recording_);
  EXPECT_FALSE(report.truth_from_map);
  EXPECT_GT(report.robots[0].path.distance_m, 1.0);
}

TEST_F(FreeFrame, KeepsErrorBetweenRobotsAfterAlignment) {
  std::vector<dataset::StampedPose> off;
  for (const auto& pose : dataset::flat(dataset::readTum(out_ + "/trajectories/r2.tum")))
    off.push_back({pose.time_ns, Pose2{0.2, 0, 0} * pose.map_from_base});
  dataset::writeTum(out_ + "/trajectories/r2.tum", off);
  const Report report = evaluateRun(out_, recording_, Frame::kFree);
  double sum_m = 0.0;
  for (const RobotReport& robot : report.robots) sum_m += robot.path.distance_m;
  EXPECT_GT(sum_m, 0.1);  // 20 cm between the robots; a common rotation may hide part of it
}

// The first twenty poses have another reference than the rest.
TEST_F(FreeFrame, ComparesCovariancesInTheirDatum) {
  for (const auto& initial : initial_poses_) {
    const std::string trajectory = out_ + "/trajectories/" + initial.first + ".tum";
    auto poses = dataset::flat(dataset::readTum(trajectory));
    std::vector<dataset::StampedCovariance> rows;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      if (i < 20) poses[i].map_from_base = Pose2{0.5, 0.2, 0.3} * poses[i].map_from_base;
      rows.push_back({poses[i].time_ns, 1e-4 * Eigen::Matrix3d::Identity(), i < 20 ? 1u : 2u});
    }
    dataset::writeTum(trajectory, poses);
    dataset::writeCovariances(out_ + "/covariances/" + initial.first + ".csv", rows);
  }
  const Report report = evaluateRun(out_, recording_, Frame::kFree);
  for (const RobotReport& robot : report.robots) {
    ASSERT_TRUE(robot.consistency);
    EXPECT_LT(robot.consistency->mean, 1e-6);
    EXPECT_GT(robot.path.max_m, 0.3) << "paths are compared in the frame of the run";
  }
  const Report same = evaluateRun(out_, recording_, Frame::kSame);
  EXPECT_GT(same.robots[0].consistency->mean, 100.0) << "a run with a fixed map frame is not aligned";
}

TEST_F(FreeFrame, AlignsPosesBeforeGroupingByState) {
  const auto poses = dataset::readTum(out_ + "/trajectories/r2.tum");
  std::vector<dataset::StampedLocalization> rows;
  for (const auto& pose : poses) rows.push_back({pose.time_ns, LocalizationState::kLocalized});
  dataset::writeLocalization(out_ + "/localization/r2.csv", rows);
  const Report report = evaluateRun(out_, recording_, Frame::kFree);
  EXPECT_FALSE(report.robots[0].localization);
  const auto& localized = report.robots[1].localization.value().states.at(LocalizationState::kLocalized);
  EXPECT_EQ(localized.poses, 101);
  EXPECT_EQ(localized.share, 1.0);
  EXPECT_LT(localized.max_m, 1e-7);  // files have nine decimals
}

TEST_F(FreeFrame, MatchesLandmarksByName) {
  const Report report = evaluateRun(out_, recording_, Frame::kFree);
  ASSERT_TRUE(report.landmarks);
  EXPECT_EQ(report.landmarks->truths, 3);
  EXPECT_EQ(report.landmarks->found, 2);  // "a" is missing
  EXPECT_NEAR(report.landmarks->max_m, 0.05, 1e-6);
  EXPECT_NEAR(report.landmarks->mean_m, 0.025, 1e-6);
  EXPECT_THAT(table(report), HasSubstr("found 2 of 3"));
}

TEST_F(FreeFrame, RecoversTruthFromExactWheels) {
  const Report report = evaluateRun(out_, recording_, Frame::kFree);
  for (const RobotReport& robot : report.robots) {
    ASSERT_TRUE(robot.dead_reckoning) << robot.name;
    EXPECT_EQ(robot.dead_reckoning->poses, 101);
    EXPECT_LT(robot.dead_reckoning->max_m, 1e-6);  // arcs are integrated exactly
  }
  EXPECT_THAT(table(report), HasSubstr("wheels alone"));
}

TEST(EvaluateSample, ReportsNoErrorForTruth) {
  OMNIFLEET_NEEDS_DATA(recording, "rendered_sample");
  const test::TempFolder out;
  std::filesystem::copy(recording + "/groundtruth/scene.geojson", out / "objects.geojson");
  std::filesystem::create_directory(out / "trajectories");
  for (const char* name : {"r1.tum", "r2.tum", "r3.tum"}) {
    std::filesystem::copy(recording + "/groundtruth/" + name, out / "trajectories");
  }
  const Report report = evaluateRun(out.path(), recording);
  EXPECT_EQ(report.map->matches.size(), 5u);
  EXPECT_EQ(report.map->x_error_m, 0.0);
  EXPECT_NEAR(report.map->iou, 1.0, 1e-5);
  ASSERT_EQ(report.robots.size(), 3u);
  for (const RobotReport& robot : report.robots) {
    EXPECT_EQ(robot.path.poses, 17);
    EXPECT_EQ(robot.path.max_m, 0.0);
  }
}

}  // namespace
}  // namespace omnifleet::evaluate
