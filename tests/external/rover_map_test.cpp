// A drive that others simulated, as a recording through every stage: one robot, and the same frames as two
// robots whose maps are merged.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "dataset/writer.h"
#include "fleet_in_process/in_process.h"
#include "tests/test_data.h"
#include "tests/unit/distance_vector/rover_data.h"

namespace omnifleet::test {
namespace {

constexpr double kWheelSeparation_m = 0.8, kBodyRadius_m = 0.4;
constexpr int kMiddle = 141;  // frame at which the drive is divided
constexpr TimeNs kBegin_ns = 1'000'000'000;

using Steps = std::vector<RoverStep>;

/// The frames of one robot.
struct Part {
  Steps steps;
  TimeNs begin_ns = kBegin_ns;
  Pose2 initial_pose;
  TimeNs timeOf(const RoverStep& step) const { return begin_ns + step.time_ns - steps.front().time_ns; }
};

Part partOf(const Steps& steps, TimeNs begin_ns = kBegin_ns) {
  return {steps, begin_ns, steps.front().map_from_base};
}

/// Wheels that drive an arc from each pose to the next.
void writeWheels(const std::string& folder, const std::string& robot, const Part& part) {
  dataset::WheelsWriter wheels(folder, robot);
  for (std::size_t k = 0; k + 1 < part.steps.size(); ++k) {
    const RoverStep &from = part.steps[k], &to = part.steps[k + 1];
    const Pose2 motion = from.map_from_base.inverse() * to.map_from_base;
    const double seconds = 1e-9 * static_cast<double>(to.time_ns - from.time_ns),
                 half = 0.5 * motion.theta_rad,
                 chord_m = motion.x_m * std::cos(half) + motion.y_m * std::sin(half),
                 speed = chord_m * (std::abs(half) > 1e-9 ? half / std::sin(half) : 1.0) / seconds,
                 difference = 0.5 * kWheelSeparation_m * motion.theta_rad / seconds;
    wheels.write({part.timeOf(from), speed - difference, speed + difference});
  }
  wheels.write({part.timeOf(part.steps.back()), 0.0, 0.0});
}

void record(const std::string& folder, const std::vector<Part>& parts) {
  std::vector<dataset::RobotRecording> robots;
  for (const Part& part : parts) {
    dataset::RobotRecording robot;
    robot.name = "r" + std::to_string(robots.size() + 1);
    robot.initial_pose = part.initial_pose;
    robot.body.radius_m = kBodyRadius_m;
    robot.body.height_m = kBodyRadius_m;
    robot.body.wheel_separation_m = kWheelSeparation_m;
    robots.push_back(robot);
  }
  dataset::writeDatasetYaml(folder, robots);
  for (std::size_t r = 0; r < parts.size(); ++r) {
    dataset::ImageStreamWriter images(folder, robots[r].name + "/front", roverCamera());
    for (const RoverStep& step : parts[r].steps) images.write(parts[r].timeOf(step), cv::imread(step.image));
    writeWheels(folder, robots[r].name, parts[r]);
  }
}

/// Poses are given: exact wheels, and nothing corrects them. The ground is not level, and the rover pitches
/// by up to 5°, so its scans contradict each other. Each frame is mapped, so that the same frames count in
/// each run.
constexpr const char* kOverlay = R"(services:
  local_mapper:
    wheels: {noise: 0.0001, noise_floor_mps: 0.0001, side_slip: 0.0001}
  localizer:
    estimator:
      initial_sigma_m: 0.001
      initial_sigma_rad: 0.0002
      wheel_bias_sigma: 0.000001
      use_landmarks: false
      use_sightings: false
      scan: {use: false}
  global_merger:
    occupancy: {resolution_m: 0.1, max_range_m: 6.0}
    keyframes:
      distance_m: 0
      rotation_rad: 0
      interval_s: 0
      min_interval_s: 0
      odometry_sigma_m: 0.1
)";
constexpr double kReach_m = 6.0;  // max_range_m; the camera measures to 6.2 m

/// What a run has mapped, compared with the true map.
struct Mapped {
  dataset::OccupancyGrid grid;
  std::vector<dataset::StampedPose> path;  ///< of the first robot
  std::size_t poses = 0;
  double worst_m = 0.0;  ///< error of a position
  double fidelity = 0.0, coverage = 0.0;
};

/// Cells of the true map of which the grid has at least this share free are claimed.
constexpr double kClaimed = 0.25;

/// Fidelity is the share of the claimed cells that are navigable, coverage the share of the navigable cells
/// in sight that are claimed.
void compare(const cv::Mat1b& truth, const cv::Mat1b& seen, Mapped& mapped) {
  cv::Mat1d free = cv::Mat1d::zeros(truth.size());
  const double cell_m = mapped.grid.resolution_m;
  for (int y = 0; y < mapped.grid.height; ++y) {
    for (int x = 0; x < mapped.grid.width; ++x) {
      if (mapped.grid.cells[static_cast<std::size_t>(x + y * mapped.grid.width)] != 0) continue;
      const Eigen::Vector2d at = mapped.grid.origin_m + cell_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      free(static_cast<int>(at.y()), static_cast<int>(at.x())) += cell_m * cell_m;
    }
  }
  int claimed = 0, navigable = 0, in_sight = 0, covered = 0;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const bool claim = free(y, x) >= kClaimed;
      claimed += claim ? 1 : 0;
      navigable += claim && truth(y, x) ? 1 : 0;
      in_sight += seen(y, x);
      covered += claim && seen(y, x) ? 1 : 0;
    }
  }
  mapped.fidelity = static_cast<double>(navigable) / std::max(1, claimed);
  mapped.coverage = static_cast<double>(covered) / std::max(1, in_sight);
}

/// The true map (navigable: grey, in sight: light) with the grid on it (free: green, occupied: red).
void draw(const std::string& path, const cv::Mat1b& truth, const cv::Mat1b& seen,
          const dataset::OccupancyGrid& grid) {
  constexpr int kPx = 20;  // per metre
  const cv::Rect part(92, 78, 48, 36);
  cv::Mat3b image(part.height * kPx, part.width * kPx);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const Eigen::Vector2d at(part.x + (u + 0.5) / kPx, part.y + part.height - (v + 0.5) / kPx);
      const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
      const auto grey = static_cast<std::uint8_t>(truth(y, x) == 0 ? 60 : seen(y, x) != 0 ? 230 : 150);
      const Eigen::Vector2d in_grid = (at - grid.origin_m) / grid.resolution_m;
      const auto column = static_cast<int>(std::floor(in_grid.x())),
                 row = static_cast<int>(std::floor(in_grid.y()));
      const bool inside = column >= 0 && row >= 0 && column < grid.width && row < grid.height;
      const int cell = inside ? grid.cells[static_cast<std::size_t>(column + row * grid.width)] : -1;
      const auto half = static_cast<std::uint8_t>(grey / 2);
      image(v, u) = cell == 0     ? cv::Vec3b(half, grey, half)
                    : cell == 100 ? cv::Vec3b(0, 0, 255)
                                  : cv::Vec3b::all(grey);
    }
  }
  cv::imwrite(path, image);
}

/// Of the cells that are known in either grid.
double shareOfDifferentCells(const dataset::OccupancyGrid& a, const dataset::OccupancyGrid& b) {
  std::map<std::pair<std::int64_t, std::int64_t>, std::array<int, 2>> cells;
  int which = 0;
  for (const auto* grid : {&a, &b}) {
    const auto left = std::llround(grid->origin_m.x() / grid->resolution_m),
               bottom = std::llround(grid->origin_m.y() / grid->resolution_m);
    for (int y = 0; y < grid->height; ++y)
      for (int x = 0; x < grid->width; ++x)
        cells.try_emplace({left + x, bottom + y}, std::array<int, 2>{-1, -1})
            .first->second[static_cast<std::size_t>(which)] =
            grid->cells[static_cast<std::size_t>(x + y * grid->width)];
    ++which;
  }
  int known = 0, different = 0;
  for (const auto& [place, value] : cells) {
    known += value[0] >= 0 || value[1] >= 0 ? 1 : 0;
    different += value[0] != value[1] ? 1 : 0;
  }
  std::printf("%d of %d known cells differ\n", different, known);
  return static_cast<double>(different) / std::max(1, known);
}

class RoverMap : public ::testing::Test {
 protected:
  void SetUp() override {
    OMNIFLEET_NEEDS_DATA(folder, "forward_rover");
    truth_ = roverMap(folder);
    ASSERT_EQ(truth_.size(), cv::Size(200, 200));
    steps_ = roverSteps(folder);
    ASSERT_EQ(steps_.size(), 283U);
    seen_ = roverSight(truth_, steps_, kReach_m);
  }

  /// Records the parts as one robot each, runs every stage on the recording and compares the merged map.
  Mapped run(const char* name, const std::vector<Part>& parts) const {
    const TempFolder folder;
    record(folder / "recording", parts);
    std::ofstream(folder / "overlay.yaml") << kOverlay;
    services::InProcessRun run;
    run.dataset = folder / "recording";
    run.overlays = {folder / "overlay.yaml"};
    run.out = folder / "out";
    run.log_level = "off";
    EXPECT_TRUE(services::runInProcess(run));
    Mapped mapped;
    mapped.grid = dataset::readMapServer(run.out + "/map.yaml");
    for (std::size_t r = 0; r < parts.size(); ++r) {
      const auto path =
          dataset::flat(dataset::readTum(run.out + "/trajectories/r" + std::to_string(r + 1) + ".tum"));
      for (const dataset::StampedPose& row : path) {
        const auto step = std::find_if(parts[r].steps.begin(), parts[r].steps.end(),
                                       [&](const RoverStep& s) { return parts[r].timeOf(s) == row.time_ns; });
        if (step == parts[r].steps.end()) continue;
        ++mapped.poses;
        mapped.worst_m = std::max(
            mapped.worst_m, (row.map_from_base.translation() - step->map_from_base.translation()).norm());
      }
      if (r == 0) mapped.path = path;
    }
    compare(truth_, seen_, mapped);
    std::printf("%s: %zu poses, at most %.3f m off, fidelity %.3f, coverage %.3f\n", name, mapped.poses,
                mapped.worst_m, mapped.fidelity, mapped.coverage);
    if (const char* pictures = std::getenv("OMNIFLEET_PICTURES"))
      draw(std::string(pictures) + "/rover_" + name + ".png", truth_, seen_, mapped.grid);
    return mapped;
  }

  /// Fidelity and coverage of the issue; each frame has a pose.
  static void expectGood(const Mapped& mapped) {
    EXPECT_EQ(mapped.poses, 283U);
    EXPECT_LT(mapped.worst_m, 0.1);  // the wheels drive arcs, the rover also slips sideways
    EXPECT_GE(mapped.fidelity, 0.75);
    EXPECT_GE(mapped.coverage, 0.9);
  }

  cv::Mat1b truth_, seen_;
  Steps steps_;
};

TEST_F(RoverMap, FreesTheNavigableGroundInSight) {
  expectGood(run("one", {partOf(steps_)}));
}

/// Both halves begin at the same time, so that the robots are at different places. If r2 begins where the
/// single robot was, all poses are equal. Cells differ where r2's floor model begins anew, and beside a slope
/// that the rover touches: the margin of its footprint grows with the σ of its pose. The poses of the log
/// differ by up to 9 cm from those of the wheels, which is about a cell.
TEST_F(RoverMap, IsTheSameFromTwoRobotsWithHalfOfTheDriveEach) {
  const Mapped one = run("one", {partOf(steps_)});
  const Steps first(steps_.begin(), steps_.begin() + kMiddle), second(steps_.begin() + kMiddle, steps_.end());
  Part r2 = partOf(second);
  const Mapped given = run("halves_with_poses_of_the_log", {partOf(first), r2});
  expectGood(given);
  EXPECT_LE(shareOfDifferentCells(one.grid, given.grid), 0.02);
  r2.initial_pose = one.path.at(kMiddle).map_from_base;
  const Mapped two = run("halves", {partOf(first), r2});
  expectGood(two);
  EXPECT_LE(shareOfDifferentCells(one.grid, two.grid), 0.005);
}

/// Every other frame each. The second robot drives after the first one has left.
TEST_F(RoverMap, IsTheSameFromTwoRobotsWithEveryOtherFrame) {
  constexpr TimeNs kLater_ns = 30 * kBegin_ns;
  const Mapped one = run("one", {partOf(steps_)});
  std::array<Steps, 2> every_other;
  for (std::size_t k = 0; k < steps_.size(); ++k) every_other[k % 2].push_back(steps_[k]);
  const Mapped two = run("every_other", {partOf(every_other[0]), partOf(every_other[1], kLater_ns)});
  expectGood(two);
  EXPECT_LE(shareOfDifferentCells(one.grid, two.grid), 0.015);
}

}  // namespace
}  // namespace omnifleet::test
