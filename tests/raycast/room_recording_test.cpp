// The files of furnished rooms: reproducible, wheels that fit the true path, and faults as stated. Images are
// tiny, because only their presence counts.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "tests/raycast/room_recording.h"

namespace omnifleet::raycast {
namespace {

namespace fs = std::filesystem;

FurnishedOptions tiny(unsigned seed) {
  FurnishedOptions options;
  options.seed = seed;
  options.frames = 40;
  options.width_px = 32;
  options.height_px = 24;
  return options;
}

/// All files of a recording by name.
std::map<std::string, std::string> filesOf(const FurnishedOptions& options) {
  const fs::path folder = fs::path(::testing::TempDir()) / ("omnifleet_rooms_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  recordFurnished(folder.string(), options);
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    files[fs::relative(entry.path(), folder).string()] =
        std::string(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  fs::remove_all(folder);
  return files;
}

/// Rows of a csv or TUM file as numbers; the header is left out. A file name counts as its number.
std::vector<std::vector<double>> rowsOf(const std::string& text) {
  std::vector<std::vector<double>> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::vector<double> row;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, line.find(',') != std::string::npos ? ',' : ' ');)
      row.push_back(std::strtod(cell.c_str(), nullptr));
    rows.push_back(row);
  }
  return rows;
}

struct WheelRowIn {
  double time_s, left_mps, right_mps;
};

std::vector<WheelRowIn> wheelsIn(const std::map<std::string, std::string>& files) {
  std::vector<WheelRowIn> wheels;
  for (const auto& row : rowsOf(files.at("r1/wheels/data.csv")))
    wheels.push_back({1e-9 * row[0] - 1000.0, row[1], row[2]});
  return wheels;
}

struct PoseIn {
  double time_s;
  Pose2 pose;
};

std::vector<PoseIn> truthIn(const std::map<std::string, std::string>& files) {
  std::vector<PoseIn> poses;
  for (const auto& row : rowsOf(files.at("groundtruth/r1.tum")))
    poses.push_back({row[0] - 1000.0, {row[1], row[2], 2.0 * std::atan2(row[6], row[7])}});
  return poses;
}

std::vector<double> frameTimesIn(const std::map<std::string, std::string>& files, const std::string& robot) {
  std::vector<double> times;
  for (const auto& row : rowsOf(files.at(robot + "/fisheye/data.csv")))
    times.push_back(1e-9 * row[0] - 1000.0);
  return times;
}

cv::Mat imageIn(const std::map<std::string, std::string>& files, const std::string& name) {
  const std::string& bytes = files.at(name);
  return cv::imdecode(std::vector<unsigned char>(bytes.begin(), bytes.end()), cv::IMREAD_COLOR);
}

/// Signed way of the left and of the right wheel between two times, metres.
Eigen::Vector2d wheelWay(const std::vector<WheelRowIn>& wheels, double begin_s, double end_s) {
  Eigen::Vector2d way = Eigen::Vector2d::Zero();
  for (const WheelRowIn& row : wheels)
    if (row.time_s > begin_s - 1e-6 && row.time_s < end_s - 1e-6)
      way += kWheelRow_s * Eigen::Vector2d(row.left_mps, row.right_mps);
  return way;
}

/// The same by the true path, from arcs between its poses.
Eigen::Vector2d trueWay(const std::vector<PoseIn>& truth, double begin_s, double end_s) {
  Eigen::Vector2d way = Eigen::Vector2d::Zero();
  for (std::size_t k = 1; k < truth.size(); ++k) {
    if (truth[k - 1].time_s < begin_s - 1e-6 || truth[k].time_s > end_s + 1e-6) continue;
    const Pose2 step = truth[k - 1].pose.inverse() * truth[k].pose;
    const double half = 0.5 * step.theta_rad, arc = std::copysign(step.translation().norm(), step.x_m) *
                                                    (std::abs(half) < 1e-9 ? 1.0 : half / std::sin(half));
    way += Eigen::Vector2d(arc - kWheelSeparation_m * half, arc + kWheelSeparation_m * half);
  }
  return way;
}

Pose2 integrated(const std::vector<WheelRowIn>& wheels, const Pose2& start, double end_s) {
  Pose2 pose = start;
  for (const WheelRowIn& row : wheels) {
    if (row.time_s > end_s - 1e-6) break;
    const double way = 0.5 * kWheelRow_s * (row.left_mps + row.right_mps),
                 turn = kWheelRow_s * (row.right_mps - row.left_mps) / kWheelSeparation_m;
    pose = pose * Pose2{way * std::cos(0.5 * turn), way * std::sin(0.5 * turn), turn};
  }
  return pose;
}

TEST(RoomRecording, IsEqualForEqualSeeds) {
  FurnishedOptions options = tiny(21);
  options.frames = 6;
  options.robots = 2;
  options.occluded_share = 0.2;
  const auto files = filesOf(options);
  EXPECT_GE(files.size(), 2U * 6U + 8U);
  EXPECT_TRUE(files == filesOf(options));
  options.seed = 22;
  EXPECT_NE(files.at("groundtruth/scene.geojson"), filesOf(options).at("groundtruth/scene.geojson"));
}

/// A row holds the mean speeds of 0.1 s, in which the robot may turn by 0.08 rad; the rest is rounding.
TEST(RoomRecording, WheelsWithoutErrorsEndAtTheTruePose) {
  for (unsigned seed = 31; seed < 33; ++seed) {
    FurnishedOptions options = tiny(seed);
    options.frames = 101;
    options.wheel_bias = options.wheel_noise = 0.0;
    const auto files = filesOf(options);
    const auto truth = truthIn(files);
    ASSERT_EQ(truth.size(), 101U);
    const Pose2 error =
        truth.back().pose.inverse() * integrated(wheelsIn(files), truth.front().pose, truth.back().time_s);
    EXPECT_GT(trueWay(truth, 0.0, 20.0).mean(), 1.0) << "seed " << seed;
    EXPECT_LT(error.translation().norm(), 2e-3) << "seed " << seed;
    EXPECT_LT(std::abs(error.theta_rad), 1e-5) << "seed " << seed;
  }
}

/// Each wheel has one scale error; 4 σ = 6 %. Noise of 2 % per row adds 0.15 % to the mean of 200 rows.
TEST(RoomRecording, WheelsHaveTheStatedBias) {
  double sum2 = 0.0;
  for (unsigned seed = 41; seed < 49; ++seed) {
    FurnishedOptions options = tiny(seed);
    options.frames = 101;
    const auto files = filesOf(options);
    const Eigen::Vector2d ratio =
        wheelWay(wheelsIn(files), 0.0, 20.0).cwiseQuotient(trueWay(truthIn(files), 0.0, 20.0));
    for (const double wheel : {ratio.x(), ratio.y()}) {
      EXPECT_NEAR(wheel, 1.0, 0.063) << "seed " << seed;
      sum2 += (wheel - 1.0) * (wheel - 1.0) / 16.0;
    }
  }
  EXPECT_NEAR(std::sqrt(sum2), 0.015, 0.009);  // 16 samples: σ within ± 3.5/√32
}

TEST(RoomRecording, BlackFramesAreBlackAndNothingElseChanges) {
  FurnishedOptions options = tiny(51);
  options.robots = 2;
  options.frames = 16;
  const auto plain = filesOf(options);
  options.black = Interval{1.0, 2.0};
  const auto black = filesOf(options);
  ASSERT_EQ(plain.size(), black.size());
  int changed = 0;
  for (const auto& [name, bytes] : plain) {
    if (black.at(name) == bytes) continue;
    ++changed;
    EXPECT_EQ(name.rfind("r1/fisheye/data/1001", 0), 0U) << name;  // from 1.0 s to 1.8 s
    EXPECT_EQ(cv::norm(imageIn(black, name), cv::NORM_INF), 0.0) << name;
    EXPECT_GT(cv::norm(imageIn(plain, name), cv::NORM_INF), 50.0) << name;
  }
  EXPECT_EQ(changed, 5);
}

TEST(RoomRecording, KidnappedRobotMovesWithoutWheelsAndFrames) {
  FurnishedOptions options = tiny(61);
  options.robots = 2;
  options.kidnapped_s = 3.0;
  const auto files = filesOf(options);
  for (const WheelRowIn& row : wheelsIn(files)) {
    if (row.time_s > 2.99 && row.time_s < 4.99) {
      EXPECT_EQ(row.left_mps, 0.0) << row.time_s;
      EXPECT_EQ(row.right_mps, 0.0) << row.time_s;
    }
  }
  EXPECT_GT(wheelWay(wheelsIn(files), 5.0, 8.0).norm(), 0.1);
  const auto truth = truthIn(files);
  ASSERT_EQ(truth.size(), 40U);
  EXPECT_GT((truth[25].pose.translation() - truth[15].pose.translation()).norm(), 1.5);
  EXPECT_LT((truth[15].pose.translation() - truth[14].pose.translation()).norm(), 0.06);
  EXPECT_LT((truth[26].pose.translation() - truth[25].pose.translation()).norm(), 0.06);
  const std::vector<double> times = frameTimesIn(files, "r1");
  EXPECT_EQ(times.size(), 30U);
  for (const double time_s : times) EXPECT_TRUE(time_s < 2.99 || time_s > 4.99) << time_s;
  EXPECT_EQ(frameTimesIn(files, "r2").size(), 40U);
}

TEST(RoomRecording, SlippingWheelsTurnFartherThanTheRobotMoves) {
  FurnishedOptions options = tiny(71);
  options.frames = 101;
  options.wheel_bias = 0.0;
  const auto plain = filesOf(options);
  options.slip = Interval{5.0, 10.0};
  const auto files = filesOf(options);
  EXPECT_EQ(files.at("groundtruth/r1.tum"), plain.at("groundtruth/r1.tum"));
  const auto wheels = wheelsIn(files);
  const auto truth = truthIn(files);
  const auto ratio = [&](double begin_s, double end_s) {
    return wheelWay(wheels, begin_s, end_s).sum() / trueWay(truth, begin_s, end_s).sum();
  };
  EXPECT_NEAR(ratio(0.0, 5.0), 1.0, 0.02);
  EXPECT_NEAR(ratio(5.0, 10.0), 1.4, 0.03);
  EXPECT_NEAR(ratio(10.0, 20.0), 1.0, 0.02);
}

TEST(RoomRecording, WheelsMayUseAnotherClockOrUnit) {
  FurnishedOptions options = tiny(81);
  options.frames = 10;
  const auto plain = filesOf(options);
  options.wheel_clock_offset_s = 1000.0;
  options.wheel_speed_factor = 100.0;
  auto files = filesOf(options);
  const auto before = wheelsIn(plain), after = wheelsIn(files);
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t k = 0; k < before.size(); ++k) {
    EXPECT_NEAR(after[k].time_s - before[k].time_s, 1000.0, 1e-6);
    EXPECT_NEAR(after[k].left_mps, 100.0 * before[k].left_mps, 1e-9);
    EXPECT_NEAR(after[k].right_mps, 100.0 * before[k].right_mps, 1e-9);
  }
  files["r1/wheels/data.csv"] = plain.at("r1/wheels/data.csv");
  EXPECT_TRUE(files == plain);
}

struct Earlier {
  FurnishedOptions options;
  Eigen::Vector3d last_pose;
  cv::Scalar mean;  ///< of the last image of robot 1, B G R
};

/// Figures measured on recordings of earlier versions stay comparable. The values are those of the version
/// before tours, pairs and decoration; a change of one random number would change them all.
TEST(RoomRecording, KeepsRecordingsOfEarlierVersions) {
  FurnishedOptions plain, dim, low;
  plain.seed = 5;
  plain.robots = 2;
  dim.seed = 7;
  dim.rooms = 2;
  dim.dim = true;
  low.seed = 10;
  low.furniture = Furniture::kLow;
  low.step_min_m = 0.10, low.step_max_m = 0.16;
  for (const Earlier& earlier :
       {Earlier{plain, {-0.603718288, -1.199314054, 1.350935413}, {80.083333, 78.161784, 74.870117}},
        Earlier{dim, {-1.929237770, -0.157275329, -0.071265391}, {36.074870, 38.522135, 38.566406}},
        Earlier{low, {0.263556988, 0.983299381, 0.656131635}, {69.109049, 69.082357, 68.963542}}}) {
    FurnishedOptions options = earlier.options;
    options.frames = 20;
    options.width_px = 64;
    options.height_px = 48;
    Random random(options.seed);
    const FurnishedScene scene = furnishedScene(options, random);
    const Pose2 last = scene.drive.frames.back().poses.front();
    EXPECT_LT((last.vector() - earlier.last_pose).norm(), 1e-6) << last.vector().transpose();
    const cv::Scalar mean = cv::mean(render(scene.room, scene.camera, last, {}, 3));
    EXPECT_LT(cv::norm(mean - earlier.mean), 1e-3) << mean;  // another libm may round a pixel differently
  }
}

/// The pipeline's own reader accepts a recording with faults.
TEST(RoomRecording, IsAValidDataset) {
  FurnishedOptions options = tiny(91);
  options.kidnapped_s = 1.0;
  options.black = Interval{4.0, 5.0};
  const fs::path folder = fs::path(::testing::TempDir()) / ("omnifleet_room_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  recordFurnished(folder.string(), options);
  const dataset::Dataset recording = dataset::Dataset::open(folder.string());
  const dataset::GroundTruth truth = dataset::GroundTruth::load(folder.string());
  fs::remove_all(folder);
  EXPECT_TRUE(recording.warnings.empty());
  ASSERT_EQ(recording.robots.size(), 1U);
  EXPECT_EQ(recording.robots[0].fisheye->rows.size(), 30U);
  EXPECT_EQ(truth.trajectories.at("r1").size(), 40U);
  EXPECT_EQ(truth.room.size(), 4U);
  EXPECT_GE(truth.scene.size(), 5U);
}

}  // namespace
}  // namespace omnifleet::raycast
