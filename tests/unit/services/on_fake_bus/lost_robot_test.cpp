// Slipping wheels, a kidnapped robot, missing odometry: the whole fleet on recordings of the arena, without
// ceiling cameras. Faults are reported, and the map is not smeared.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "evaluate/report.h"
#include "fleet_in_process/in_process.h"
#include "tests/test_data.h"
#include "world/recording.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr double kRate_hz = 5.0;

/// r1 drives from `start` past five obstacles; r2 stands still and observes. Speeds and noise are the
/// defaults of the arena.
std::string arenaText(const std::string& start, double duration_s, bool alone) {
  const std::string r2 = "  r2: {initial_pose: [1.0, -0.9, 2.0], speeds: [0, 0, 0]}\n";
  return "name: lost\nframes: {rate_hz: 5, duration_s: " + std::to_string(duration_s) +
         "}\nfloor: {size_m: [5.0, 4.0]}\nrobots:\n  r1: {initial_pose: " + start +
         ", speeds: [0, 0.15, 0.17]}\n" + (alone ? "" : r2) +
         "obstacles:\n"
         "  - {kind: box, pose: [0.35, 0.75, 0.4], size_m: [0.30, 0.20], height_m: 0.18, rgb: [190, 52, "
         "40]}\n"
         "  - {kind: cylinder, pose: [0.10, -0.70, 0], radius_m: 0.12, height_m: 0.20, rgb: [40, 78, 170]}\n"
         "  - {kind: box, pose: [-0.80, 0.85, 1.0], size_m: [0.20, 0.20], height_m: 0.15, rgb: [214, 160, "
         "30]}\n"
         "  - {kind: cylinder, pose: [-0.9, -0.8, 0], radius_m: 0.10, height_m: 0.12, rgb: [40, 140, 60]}\n"
         "  - {kind: box, pose: [1.25, 0.45, 0.8], size_m: [0.25, 0.15], height_m: 0.20, rgb: [120, 40, "
         "130]}\n"
         "rigs:\n  fisheye:\n    camera_model: fisheye\n    projection: equidistant\n    image_width: 640\n"
         "    image_height: 480\n    focal_px: 148.659\n    principal_point_px: [319.5, 239.5]\n"
         "    fov_deg: 185\n    position_m: [0, 0, 0.5]\n    self_mask_radius_px: 99\n";
}

/// Rows of a file with the times of the first column moved by `by_ns`, without the header.
std::string later(const fs::path& path, TimeNs by_ns) {
  std::ifstream file(path);
  std::string text;
  for (std::string row; std::getline(file, row);) {
    if (row.empty() || row[0] == '#') continue;
    const std::size_t end = row.find_first_of(", ");
    const bool seconds = row.find(' ') < row.find(',');  // TUM format: seconds
    std::ostringstream time;
    if (seconds) {
      time.precision(9);
      time << std::fixed << std::stod(row.substr(0, end)) + 1e-9 * static_cast<double>(by_ns);
    } else {
      time << std::stoll(row.substr(0, end)) + by_ns;
    }
    text += time.str() + row.substr(end) + "\n";
  }
  return text;
}

/// Recordings, created once, and the results of their runs.
class LostRobot : public ::testing::Test {
 protected:
  struct Run {
    evaluate::Report report;
    std::set<std::string> messages;
    std::string trajectory;  ///< of r1
    const evaluate::RobotReport& robot(std::size_t i) const { return report.robots.at(i); }
  };

  static void SetUpTestSuite() { folder_ = new test::TempFolder; }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string recorded(const std::string& name, const std::string& start, double duration_s,
                              bool alone = false) {
    const std::string data = *folder_ / name;
    if (fs::exists(data)) return data;
    std::ofstream(*folder_ / (name + ".yaml")) << arenaText(start, duration_s, alone);
    const auto arena = synthetic::Arena::load(*folder_ / (name + ".yaml"));
    world::RecordingOptions options;
    options.world = world::World::Options::read(arena.world);
    options.seed = 1000;
    options.ceiling = false;
    const auto report = world::record(arena, options, data);
    EXPECT_TRUE(report.collisions.empty());
    return data;
  }
  static std::string undisturbed() { return recorded("undisturbed", "[-1.3, -0.1, 0.0]", 7.0); }
  static std::string copyOf(const std::string& data, const std::string& name) {
    fs::copy(data, *folder_ / name, fs::copy_options::recursive);
    return *folder_ / name;
  }

  Run run(const std::string& data, const std::string& name) {
    Run result;
    services::InProcessRun options;
    options.dataset = data;
    options.out = *folder_ / (name + "_out");
    options.log_level = "off";
    options.on_message = [&](const std::string& service, const Message& message) {
      result.messages.insert(service + ": " + toLogLine(message));
    };
    EXPECT_TRUE(services::runInProcess(options));
    result.report = evaluate::evaluateRun(options.out, data);
    std::printf("%s\n%s", name.c_str(), evaluate::table(result.report).c_str());
    for (const std::string& message : result.messages) std::printf("  %s\n", message.c_str());
    return result;
  }

  /// A map as good as that of an undisturbed run: no obstacle missed or doubled, and the same accuracy.
  void expectWholeMap(const Run& run) {
    const auto& map = *run.report.map;
    EXPECT_TRUE(map.missed.empty());
    EXPECT_TRUE(map.falsely_found.empty());
    EXPECT_LT(map.x_error_m, 0.012);
    EXPECT_LT(map.y_error_m, 0.012);
    EXPECT_GT(map.iou, 0.80);
  }

  static test::TempFolder* folder_;
};
test::TempFolder* LostRobot::folder_ = nullptr;

TEST_F(LostRobot, UndisturbedRunReportsNoWheelFault) {
  const Run plain = run(undisturbed(), "undisturbed");
  expectWholeMap(plain);
  for (const std::string& message : plain.messages) EXPECT_THAT(message, Not(HasSubstr("[wheel_")));
  EXPECT_LT(plain.robot(0).path.distance_m, 0.01);
}

TEST_F(LostRobot, ReportsWheelSlip) {
  const std::string data = copyOf(undisturbed(), "slipping");
  // For 0.6 s the wheels turn three times as fast as the robot drives: 18 cm of false distance.
  std::ifstream rows(undisturbed() + "/r1/wheels/data.csv");
  std::ofstream out(data + "/r1/wheels/data.csv");
  TimeNs first = 0;
  for (std::string row; std::getline(rows, row);) {
    std::vector<double> speeds(2);
    long long time = 0;
    if (std::sscanf(row.c_str(), "%lld,%lf,%lf", &time, &speeds[0], &speeds[1]) == 3) {
      if (first == 0) first = time;
      const double at_s = 1e-9 * static_cast<double>(time - first);
      const double factor = at_s >= 3.0 && at_s < 3.6 ? 3.0 : 1.0;
      out << time << ',' << factor * speeds[0] << ',' << factor * speeds[1] << '\n';
    } else {
      out << row << '\n';
    }
  }
  out.close();
  const Run slipping = run(data, "slipping");
  EXPECT_THAT(slipping.messages, Contains(HasSubstr("[wheel_slip] r1 at ")));
  EXPECT_LT(slipping.robot(0).path.max_m, 0.05);
  EXPECT_GT(slipping.robot(0).dead_reckoning->max_m, 0.10);
  expectWholeMap(slipping);
}

/// Appends a second recording to the first, `gap_s` later. The wheels stand still in the gap.
void append(const std::string& after, double gap_s, const std::vector<const char*>& robots,
            const std::string& data) {
  const auto step = static_cast<TimeNs>(1e9 / kRate_hz);
  const int standing = static_cast<int>(gap_s * kRate_hz);
  for (const char* robot : robots) {
    const fs::path to = fs::path(data) / robot, from = fs::path(after) / robot;
    int frames = 0;
    TimeNs last = 0;
    std::ifstream listed(to / "fisheye" / "data.csv");
    for (std::string row; std::getline(listed, row);) {
      if (row.empty() || row[0] == '#') continue;
      ++frames;
      last = std::stoll(row);
    }
    std::ofstream wheels(to / "wheels" / "data.csv", std::ios::app);
    for (int i = 1; i <= standing; ++i) wheels << last + i * step << ",0,0\n";
    wheels.close();
    const TimeNs by = (frames + standing) * step;
    std::string rows = later(from / "fisheye" / "data.csv", by), renamed;
    std::istringstream each(rows);
    for (std::string row; std::getline(each, row);) {
      const std::string file = row.substr(row.find(',') + 1);
      fs::copy_file(from / "fisheye" / "data" / file, to / "fisheye" / "data" / ("later_" + file));
      renamed += row.substr(0, row.find(',') + 1) + "later_" + file + "\n";
    }
    std::ofstream(to / "fisheye" / "data.csv", std::ios::app) << renamed;
    std::ofstream(to / "wheels" / "data.csv", std::ios::app) << later(from / "wheels" / "data.csv", by);
    const std::string path = "/groundtruth/" + std::string(robot) + ".tum";
    std::ofstream(data + path, std::ios::app) << later(after + path, by);
  }
}

TEST_F(LostRobot, RelocalizesKidnappedRobotWithoutSmearingMap) {
  // Two recordings in one room; between them r1 was moved by 1.5 m and turned, r2 did not move.
  const std::string data = copyOf(recorded("before", "[-1.3, -0.1, 0.0]", 3.0), "kidnapped");
  append(recorded("after", "[0.75, 0.05, 2.6]", 4.0), 0.0, {"r1", "r2"}, data);
  const Run kidnapped = run(data, "kidnapped");
  EXPECT_THAT(kidnapped.messages, Contains(HasSubstr("[kidnapped] r1 at ")));
  expectWholeMap(kidnapped);
  EXPECT_LT(kidnapped.robot(0).path.max_m, 0.10);  // no valid pose may be wrong by more
  EXPECT_GT(kidnapped.robot(0).path.poses, 20);    // of 35 frames: it relocalized
  EXPECT_LT(kidnapped.robot(1).path.max_m, 0.03);
}

/// No other robot localizes it, and at its new place it has observed few of the obstacles there.
TEST_F(LostRobot, KeepsMapWhenLoneRobotIsKidnapped) {
  const std::string before = recorded("lone_before", "[-1.3, -0.1, 0.0]", 1.6, true);
  const std::string after = recorded("lone_after", "[0.75, -0.2, -0.1]", 4.0, true);
  for (const double gap_s : {0.0, 8.0}) {
    const std::string name = gap_s > 0 ? "lone_gap" : "lone_at_once";
    const std::string data = copyOf(before, name);
    append(after, gap_s, {"r1"}, data);
    const Run kidnapped = run(data, name);
    EXPECT_THAT(kidnapped.messages, Contains(HasSubstr("[kidnapped]"))) << name;
    ASSERT_TRUE(kidnapped.report.map) << name;
    EXPECT_TRUE(kidnapped.report.map->falsely_found.empty()) << name;
    EXPECT_LE(kidnapped.report.map->missed.size(), 2u) << name;
    EXPECT_LT(kidnapped.robot(0).path.distance_m, 0.10) << name;
  }
}

TEST_F(LostRobot, LocalizesWithoutWheelOdometry) {
  const std::string data = copyOf(undisturbed(), "no_wheels");
  for (const char* robot : {"r1", "r2"}) fs::remove_all(fs::path(data) / robot / "wheels");
  const Run blind = run(data, "no_wheels");
  EXPECT_EQ(blind.robot(0).path.poses, blind.robot(0).frames);
  EXPECT_LT(blind.robot(0).path.distance_m, 0.03);
  expectWholeMap(blind);
}

}  // namespace
}  // namespace omnifleet
