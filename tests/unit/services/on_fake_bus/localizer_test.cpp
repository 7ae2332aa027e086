// What the localizer tells people, and what it does in a lull.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "adapters/adapters.h"
#include "outline/prism.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kStep = 200'000'000;

/// Both robots' classifiers are played: they stand, and each sees a thing that the other does
/// not.
class LiveLocalizer : public testing::Test {
 protected:
  LiveLocalizer() {
    for (const char* robot : {"r1", "r2"})
      objects_.emplace_back(robot, bench_.bus().writer(bench_.topics.objects, robot));
  }
  void frames(int step) {
    for (auto& [robot, writer] : objects_) {
      Objects seen;
      seen.robot = robot;
      seen.acquired_ns = step * kStep;
      seen.sequence = static_cast<std::uint32_t>(step);
      seen.camera_height_m = 0.5;
      seen.motion.valid = step > 0;
      seen.motion.since_ns = (step - 1) * kStep;
      seen.motion.covariance = Eigen::Vector3d(1e-8, 1e-8, 1e-8).asDiagonal();
      seen.scan.range_m.assign(360, 1.5F);
      seen.scan.sigma_m.assign(360, 0.01F);
      seen.scan.label.assign(360, RayLabel::kFloorEnd);
      seen.scan.object.assign(360, 0);
      seen.tracks.push_back(bin({0.9, 0.5}));
      v1::Objects wire;
      adapters::toWire(seen, adapters::RunClock::kDataset, wire);
      ASSERT_TRUE(writer->write(wire));
    }
    bench_.spin();
  }

  /// Round, 20 cm wide, 15 cm high; base_link.
  static Track bin(const Eigen::Vector2d& at_m) {
    Track track;
    track.id = 1;
    track.kind = ObjectKind::kObstacle;
    track.kind_probability = 1.0;
    track.visible = true;
    track.position_m = at_m;
    track.contact_m = at_m * (1.0 - 0.1 / at_m.norm());
    for (int k = 0; k < 24; ++k) {
      const double angle = 2.0 * M_PI * k / 24;
      track.hull_m.push_back(at_m + 0.1 * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
    outline::PrismView view;
    view.camera_height_m = 0.5;
    track.supports = outline::prismSupports(track.hull_m, 0.15, view, 0.002);
    return track;
  }

  test::StageBench bench_{"localizer", "", "", "", bus::RunMode::kLive};
  std::vector<std::pair<std::string, std::unique_ptr<bus::Writer<v1::Objects>>>> objects_;
};

/// What is in sight contradicts both starts, frame by frame.
TEST_F(LiveLocalizer, ATroubleThatLastsIsToldOnceOfEachRobot) {
  for (int step = 0; step < 40; ++step) {
    frames(step);
    bench_.lull();
  }
  const std::vector<std::string> told = bench_.problems();
  ASSERT_EQ(told.size(), 2U);
  for (const std::string& line : told) EXPECT_THAT(line, HasSubstr("is its initial_pose right?"));
  EXPECT_NE(told[0], told[1]);
}

TEST_F(LiveLocalizer, TheWindowIsSolvedAnewInALullOnceForEachRoundOfFrames) {
  EXPECT_FALSE(bench_.background());
  for (int step = 0; step < 3; ++step) {
    frames(step);
    EXPECT_TRUE(bench_.background()) << step;
    EXPECT_FALSE(bench_.background()) << step;
  }
}

}  // namespace
}  // namespace omnifleet
