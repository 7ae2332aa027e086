#include "dataset/trajectory_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dataset/atomic_file.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::HasSubstr;

TEST(Tum, KeepsNanosecondsAndHeadings) {
  const test::TempFolder folder;
  std::vector<StampedPose> poses;
  for (int i = 0; i < 50; ++i) {
    poses.push_back({1700000000000000001 + i * 199999999LL, Pose2{0.1 * i, -0.03 * i, wrapAngle(0.37 * i)}});
  }
  writeTum(folder / "r1.tum", poses);
  const std::vector<StampedPose> back = flat(readTum(folder / "r1.tum"));
  ASSERT_EQ(back.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(back[i].time_ns, poses[i].time_ns);
    // Sine and cosine of half the angle have nine decimals: an error of 1e-9 each.
    EXPECT_NEAR(wrapAngle(back[i].map_from_base.theta_rad - poses[i].map_from_base.theta_rad), 0.0, 3e-9);
    EXPECT_NEAR(back[i].map_from_base.x_m, poses[i].map_from_base.x_m, 1e-9);
    EXPECT_NEAR(back[i].map_from_base.y_m, poses[i].map_from_base.y_m, 1e-9);
  }
}

TEST(Covariances, ReadsWhatItWritesAndListsDamagedRows) {
  const test::TempFolder folder;
  Eigen::Matrix3d covariance;
  covariance << 1e-4, 2e-6, -3e-6, 2e-6, 4e-4, 5e-6, -3e-6, 5e-6, 9e-4;
  writeCovariances(folder / "r1.csv", {{1'500'000'000'123'456'789, covariance, 2}, {7, 2.0 * covariance}});
  const auto rows = readCovariances(folder / "r1.csv");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].time_ns, 1'500'000'000'123'456'789);
  EXPECT_LT((rows[0].covariance - covariance).norm(), 1e-12);
  EXPECT_LT((rows[1].covariance - 2.0 * covariance).norm(), 1e-12);
  EXPECT_EQ(rows[0].datum, 2u);
  EXPECT_EQ(rows[1].datum, 0u);
  std::vector<std::string> warnings;
  writeAtomic(folder / "damaged.csv",
              "#t\n1,1,0,0,1,0,1,0\n2,1,0,nan,1,0,1,0\nx,1,0,0,1,0,1,0\n3,1,0\n4,1,0,0,1,0,1,-1\n");
  EXPECT_EQ(readCovariances(folder / "damaged.csv", &warnings).size(), 1u);
  EXPECT_EQ(warnings.size(), 4u);
}

TEST(Localization, ReadsWhatItWrites) {
  const test::TempFolder folder;
  std::vector<StampedLocalization> rows;
  for (const LocalizationState state : kLocalizationStates)
    for (const PoseEvent event : kPoseEvents)
      rows.push_back({1'500'000'000'123'456'789 + static_cast<TimeNs>(rows.size()),
                      state,
                      event,
                      event == PoseEvent::kNone ? 0.0 : 4.25 + static_cast<double>(rows.size()),
                      {static_cast<std::uint16_t>(37 * rows.size() % 256)},
                      {static_cast<std::uint16_t>(91 * rows.size() % 256)}});
  writeLocalization(folder / "r1.csv", rows);
  std::vector<std::string> warnings;
  const auto back = readLocalization(folder / "r1.csv", &warnings);
  EXPECT_TRUE(warnings.empty());
  ASSERT_EQ(back.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(back[i].time_ns, rows[i].time_ns);
    EXPECT_EQ(back[i].state, rows[i].state);
    EXPECT_EQ(back[i].event, rows[i].event);
    EXPECT_EQ(back[i].correction_sigmas, rows[i].correction_sigmas);
    EXPECT_EQ(back[i].used, rows[i].used);
    EXPECT_EQ(back[i].rejected, rows[i].rejected);
  }
}

TEST(Localization, WritesNamesAndHeader) {
  const test::TempFolder folder;
  SourceSet wheels, wheels_and_scan;
  wheels.add(Source::kWheels);
  wheels_and_scan = wheels;
  wheels_and_scan.add(Source::kScan);
  writeLocalization(folder / "r1.csv",
                    {{7, LocalizationState::kOdometryOnly, PoseEvent::kNone, 0.0, {}, wheels},
                     {8, LocalizationState::kLocalized, PoseEvent::kLoopClosed, 12.5, wheels_and_scan, {}}});
  EXPECT_EQ(
      readFile(folder / "r1.csv"),
      "#timestamp [ns],state,event,correction [sigma],used,rejected\n7,odometry_only,none,0,none,wheels\n"
      "8,localized,loop_closed,12.5,wheels+scan,none\n");
}

TEST(Localization, ListsDamagedRowsAndRejectsUnusableFiles) {
  const test::TempFolder folder;
  writeAtomic(folder / "damaged.csv",
              "#t\n1,lost,none,0\nx,lost,none,0\n2,gone,none,0\n3,lost,crash,0\n4,lost,none,-1\n"
              "5,lost,none,nan\n6,lost,none\n7,lost,none,2e9\n8,lost,none,0,0\n 9 , lost , none , 0 \r\n"
              "10,lost,none,0,scan+radar,none\n11,lost,none,0,scan,+\n12,lost,none,0,scan,none\n");
  std::vector<std::string> warnings;
  const auto rows = readLocalization(folder / "damaged.csv", &warnings);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[1].time_ns, 9) << "without sources, as older versions wrote them";
  EXPECT_EQ(rows[2].time_ns, 12);
  EXPECT_THAT(
      warnings,
      ::testing::ElementsAre(
          HasSubstr("damaged.csv:3: the timestamp must be whole nanoseconds"),
          HasSubstr("damaged.csv:4: the state must be one of unlocated, localized, odometry_only, lost, "
                    "relocalized"),
          HasSubstr("damaged.csv:5: the event must be one of none, relocalized, loop_closed, absolute, "
                    "corrected"),
          HasSubstr("damaged.csv:6: the correction must be between 0 and 1e+09 sigma"),
          HasSubstr("damaged.csv:7: the correction"), HasSubstr("damaged.csv:8: expected 6 values"),
          HasSubstr("damaged.csv:9: the correction"), HasSubstr("damaged.csv:10: expected 6 values"),
          HasSubstr("damaged.csv:12: the source must be one of wheels, floor, appearance, scan"),
          HasSubstr("damaged.csv:13: the source must be one of")));
  EXPECT_EQ(readLocalization(folder / "damaged.csv").size(), 3u) << "warnings are optional";
  writeAtomic(folder / "unusable.csv", "1,lost\n");
  EXPECT_THROW(readLocalization(folder / "unusable.csv"), std::runtime_error);
  EXPECT_THROW(readLocalization(folder / "none.csv"), std::runtime_error);
}

TEST(Tum, WritesEqualTextForEqualPoses) {
  EXPECT_EQ(tumText({{-1500000000, Pose2{-1e-12, 1.0, 0.0}}}),
            "-1.500000000 0.000000000 1.000000000 0 0 0 0.000000000 1.000000000\n");
}

TEST(Tum, ListsBadRows) {
  const test::TempFolder folder;
  writeAtomic(folder / "x.tum",
              "# comment\n1.5 1 2 3 0 0 0 2\n2 1 2 3 0 0 0\n3 nan 0 0 0 0 0 1\n4 0 0 0 0 0 0 0\n1e1 0 0 0 0 "
              "0 0.7071 0.7071\n");
  std::vector<std::string> warnings;
  const auto poses = readTum(folder / "x.tum", &warnings);
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].time_ns, 1500000000);
  EXPECT_NEAR(poses[0].orientation.norm(), 1.0, 1e-15);
  EXPECT_EQ(poses[1].time_ns, 10000000000);
  EXPECT_NEAR(poses[1].flat().map_from_base.theta_rad, M_PI / 2, 1e-12);
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("x.tum:3: expected 8"), HasSubstr("x.tum:4:"),
                                               HasSubstr("x.tum:5:")));
  EXPECT_THROW(readTum(folder / "none.tum"), std::runtime_error);
}

TEST(Tum, ReadsPublishedFile) {
  OMNIFLEET_NEEDS_DATA(path, "trajectories_and_maps/fr2_desk_groundtruth.txt");
  std::vector<std::string> warnings;
  EXPECT_EQ(readTum(path, &warnings).size(), 20957u);
  EXPECT_TRUE(warnings.empty());
}

TEST(G2o, ReadsWhatItWrites) {
  const test::TempFolder folder;
  G2oGraph graph;
  graph.vertices = {{0, {0, 0, 0}}, {4, {1.25, -2, 3.0}}};
  G2oEdge edge{0, 4, {1.25, -2, 3.0}, {}};
  edge.information << 4, 1, 0.5, 1, 5, 0.25, 0.5, 0.25, 6;
  graph.edges = {edge};
  writeG2o(folder / "p.g2o", graph);
  const G2oGraph back = readG2o(folder / "p.g2o");
  ASSERT_EQ(back.vertices.size(), 2u);
  EXPECT_EQ(back.vertices[1].id, 4);
  EXPECT_EQ(back.vertices[1].pose.vector(), graph.vertices[1].pose.vector());
  ASSERT_EQ(back.edges.size(), 1u);
  EXPECT_EQ(back.edges[0].information, edge.information);
  writeAtomic(folder / "d.g2o", "VERTEX_SE2 0 0 0 0\nFIX 0\nVERTEX_SE2 1 2 3\n");
  EXPECT_THROW(readG2o(folder / "d.g2o"), std::runtime_error);
}

}  // namespace
}  // namespace omnifleet::dataset
