#include "evaluation/classification.h"

#include <gtest/gtest.h>

#include "tests/test_data.h"

namespace omnifleet::evaluation {
namespace {

using dataset::TrackRow;

/// r1 at (1, 0) with heading 90°, r2 at (1, 2); a box around (−1, 0).
class Kinds : public ::testing::Test {
 protected:
  void SetUp() override {
    truth_["r1"] = {{0, {1, 0, M_PI / 2}}, {100, {1, 0, M_PI / 2}}};
    truth_["r2"] = {{0, {1, 2, 0}}, {100, {1, 2, 0}}};
    dataset::MapObject box;
    box.outline_m = {{-1.4, -0.4}, {-0.6, -0.4}, {-0.6, 0.4}, {-1.4, 0.4}};
    scene_ = {box};
  }
  KindMetrics compare(const std::vector<TrackRow>& rows) { return compareKinds("r1", rows, truth_, scene_); }

  std::map<std::string, std::vector<dataset::StampedPose>> truth_;
  std::vector<dataset::MapObject> scene_;
};

// In base_link of r1, r2 is 2 m ahead and the box 2 m to the left.
TEST_F(Kinds, CountsEveryOutcome) {
  const KindMetrics m = compare({{0, 1, ObjectKind::kRobot, {2.1, 0}},       // correct
                                 {50, 1, ObjectKind::kObstacle, {2, 0.1}},   // a robot classified as obstacle
                                 {50, 2, ObjectKind::kObstacle, {0, 1.7}},   // correct (inside the footprint)
                                 {60, 2, ObjectKind::kUnknown, {0.1, 2.3}},  // an obstacle of unknown kind
                                 {70, 3, ObjectKind::kRobot, {-2, -2}},      // no true object here
                                 {999, 3, ObjectKind::kRobot, {2, 0}}});     // no truth at this time
  EXPECT_EQ(m.robot.right, 1);
  EXPECT_EQ(m.robot.missed, 1);
  EXPECT_EQ(m.robot.wrong, 1);
  EXPECT_EQ(m.obstacle.right, 1);
  EXPECT_EQ(m.obstacle.missed, 1);
  EXPECT_EQ(m.obstacle.wrong, 1);
  EXPECT_EQ(m.phantoms, 1);
  EXPECT_NEAR(m.robot.f1(), 2.0 / 4.0, 1e-15);
}

TEST_F(Kinds, ReturnsNanWithoutSamples) {
  EXPECT_TRUE(std::isnan(compare({}).robot.f1()));
  EXPECT_EQ(compareKinds("r9", {{0, 1, ObjectKind::kRobot, {2, 0}}}, truth_, scene_).robot.wrong, 0);
}

TEST(TrackFiles, ReadsVisibleTracksThatItWrites) {
  const test::TempFolder folder;
  Objects objects;
  objects.acquired_ns = 1234;
  Track seen, predicted;
  seen.id = 5;
  seen.kind = ObjectKind::kRobot;
  seen.visible = true;
  seen.position_m = {1.25, -0.5};
  objects.tracks = {seen, predicted};
  dataset::TracksWriter(folder.path(), "r1").write(objects);
  std::vector<std::string> warnings;
  const auto rows = dataset::readTracks(folder / "tracks/r1.csv", warnings);
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(rows[0].time_ns, 1234);
  EXPECT_EQ(rows[0].track, 5u);
  EXPECT_EQ(rows[0].kind, ObjectKind::kRobot);
  EXPECT_EQ(rows[0].position_m, Eigen::Vector2d(1.25, -0.5));
}

}  // namespace
}  // namespace omnifleet::evaluation
