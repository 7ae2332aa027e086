// The world service of an arena: robots on tours or driven by their formation services, parked robots, robots
// without wheels.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "dataset/dataset.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;

class ArenaWorld : public testing::Test {
 protected:
  ArenaWorld()
      : folder_(fs::temp_directory_path() / ("omnifleet_arena_world_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "fleet.yaml") << "world: {arena: " << std::getenv("OMNIFLEET_SOURCE_DIR")
                                          << "/config/arenas/ahmed.yaml, duration_s: 4}\n";
  }
  ~ArenaWorld() override { fs::remove_all(folder_); }

  fs::path folder_;
};

TEST_F(ArenaWorld, DrivesToursAndWritesTruthOfParkedRobots) {
  test::StageBench bench("world", "", (folder_ / "out").string(), (folder_ / "fleet.yaml").string());
  const auto moving = bench.bus().reader(bench.topics.world_truth, "r1"),
             parked = bench.bus().reader(bench.topics.world_truth, "r3");
  const auto wheels = bench.bus().reader(bench.topics.wheels_odometry, "r1");
  for (int turn = 0; turn < 200; ++turn) bench.spin();
  v1::Truth truth;
  int frames = 0;
  double way_m = 0.0;
  Eigen::Vector2d before(0.0, 0.0);
  while (moving->take(truth)) {
    const Eigen::Vector2d at(truth.map_from_base().x(), truth.map_from_base().y());
    if (frames++ > 0) way_m += (at - before).norm();
    before = at;
  }
  EXPECT_GT(frames, 10);
  EXPECT_GT(way_m, 0.2);
  ASSERT_TRUE(parked->take(truth));
  EXPECT_NEAR(truth.map_from_base().x(), -1.3, 1e-9);
  v1::WheelOdometry odometry;
  EXPECT_FALSE(wheels->take(odometry)) << "r1 has no sensor wheels";
  bench.drain();
  const dataset::Dataset recording = dataset::Dataset::open((folder_ / "out/recording").string());
  ASSERT_EQ(recording.robots.size(), 4u);
  EXPECT_FALSE(recording.robots[0].initial_pose);
  EXPECT_EQ(recording.robots[2].body.footprint_m.size(), 4u);
  EXPECT_TRUE(fs::exists(folder_ / "out/recording/groundtruth/r3.tum"));
}

TEST_F(ArenaWorld, WaitsForCommandsOfRobotsWithFormationServiceOnly) {
  std::ofstream(folder_ / "fleet.yaml", std::ios::app) << "services: {formation: {behaviour: exploration}}\n";
  test::StageBench bench("world", "", (folder_ / "out").string(), (folder_ / "fleet.yaml").string());
  const auto moving = bench.bus().reader(bench.topics.world_truth, "r1"),
             parked = bench.bus().reader(bench.topics.world_truth, "r3");
  const auto first = bench.bus().writer(bench.topics.wheels_command, "r1"),
             second = bench.bus().writer(bench.topics.wheels_command, "r2");
  v1::Truth truth;
  v1::WheelCommand command;
  double begin_m = 0.0, end_m = 0.0;
  int frames = 0;
  for (; moving->take(truth); ++frames) {
    end_m = truth.map_from_base().y();
    if (frames == 0) begin_m = end_m;
    for (const auto* robot : {"r1", "r2"}) {
      command.robot(robot);
      command.header() = truth.header();
      command.v_left_mps(0.1);
      command.v_right_mps(0.1);
      bench.spin();
      EXPECT_EQ(robot == std::string("r1") ? first->write(command) : second->write(command), true);
    }
    bench.spin();
  }
  EXPECT_EQ(frames, 21) << "4 s at 5 Hz";
  EXPECT_GT(end_m - begin_m, 0.2) << "r1 drives upwards";
  Eigen::Vector2d place_m(0.0, 0.0);
  while (parked->take(truth)) place_m = {truth.map_from_base().x(), truth.map_from_base().y()};
  EXPECT_NEAR((place_m - Eigen::Vector2d(-1.3, -0.84)).norm(), 0.0, 1e-9);
  bench.drain();
}

}  // namespace
}  // namespace omnifleet
