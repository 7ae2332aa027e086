#include "dataset/dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "dataset/atomic_file.h"
#include "dataset/ground_truth.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kDataset =
    "format: omnifleet-dataset\nversion: 1\nrobots:\n  r2:\n    initial_pose: [1, 2, 3.5]\n"
    "    body: {footprint_m: [[0, 0], [0, 1], [1, 1]], height_m: 0.2}\n  r1:\n"
    "    body: {radius_m: 0.15, height_m: 0.3}\n    wheel_separation_m: 0.26\n";
constexpr const char* kSensor =
    "camera_model: fisheye\nprojection: equidistant\nimage_width: 64\nimage_height: 48\nfocal_px: 15\n"
    "principal_point_px: [31.5, 23.5]\nfov_deg: 185\n";

/// A dataset on disk, whose files each test modifies.
class DatasetFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    put("dataset.yaml", kDataset);
    put("r1/fisheye/sensor.yaml", kSensor);
    put("r1/fisheye/data.csv", "#timestamp [ns],filename\n10,a.png\n20,b.png\n");
    put("r2/notes.txt", "nothing of it was recorded\n");
  }
  void put(const std::string& name, const std::string& text) { writeAtomic(folder_ / name, text); }
  Dataset open() { return Dataset::open(folder_.path()); }
  std::string refusal() {
    try {
      open();
    } catch (const options::Error& error) {
      return error.what();
    }
    return "";
  }

  test::TempFolder folder_;
};

TEST_F(DatasetFiles, ReadsRobotsSortedByName) {
  const Dataset d = open();
  ASSERT_EQ(d.robots.size(), 2u);
  EXPECT_EQ(d.robots[0].name, "r1");
  EXPECT_FALSE(d.robots[0].initial_pose);
  EXPECT_EQ(d.robots[0].body.radius_m, 0.15);
  EXPECT_EQ(d.robots[0].body.wheel_separation_m, 0.26);
  ASSERT_TRUE(d.robots[1].initial_pose);
  EXPECT_NEAR(d.robots[1].initial_pose->theta_rad, 3.5 - 2 * M_PI, 1e-15);
  EXPECT_GT(signedArea(d.robots[1].body.footprint_m), 0.0) << "reordered to counter-clockwise";
  EXPECT_EQ(d.findRobot("r3"), nullptr);
  ASSERT_NE(d.findStream("r1/fisheye"), nullptr);
  EXPECT_EQ(d.findStream("r1/front"), nullptr);
  EXPECT_EQ(d.findStream("r1/fisheye")->rows[1].time_ns, 20);
  EXPECT_THAT(d.findStream("r1/fisheye")->rows[1].path, HasSubstr("r1/fisheye/data/b.png"));
}

TEST_F(DatasetFiles, ConvertsTimesFromUnitOfHeader) {
  const std::vector<std::pair<std::string, std::string>> files{
      {"#timestamp [ns],filename", "1700000000123456000"}, {"# timestamp [us],filename", "1700000000123456"},
      {"#timestamp [µs],filename", "1700000000123456"},    {"#timestamp[ms], filename", "1700000000123.456"},
      {"#time [s],filename", "1700000000.123456"},         {"timestamp [us],filename", "1700000000123456"}};
  for (const auto& [header, time] : files) {
    put("r1/fisheye/data.csv", header + "\n" + time + ",a.png\n");
    const Dataset d = open();
    const auto& rows = d.findStream("r1/fisheye")->rows;
    ASSERT_EQ(rows.size(), 1u) << header;
    EXPECT_EQ(rows[0].time_ns, 1700000000123456000) << header;
  }
  put("r1/wheels/data.csv", "#timestamp [us],v_left,v_right\n10,0,0\n20.5,0,0\n-1,0,0\n");
  put("r1/observations.csv", "#timestamp [ms],id,range [m],bearing [rad]\n30,a,1,0\n");
  put("r1/laser/data.csv", "#timestamp [s],angle_min [rad],angle_increment [rad],ranges [m]\n0.25,0,0.1,1\n");
  const Dataset d = open();
  ASSERT_EQ(d.findRobot("r1")->wheels.size(), 2u);
  EXPECT_EQ(d.findRobot("r1")->wheels[1].time_ns, 20500);
  EXPECT_EQ(d.findRobot("r1")->observations.at(0).time_ns, 30000000);
  EXPECT_EQ(d.findRobot("r1")->laser.at(0).time_ns, 250000000);
}

TEST_F(DatasetFiles, RefusesUnknownUnitOfTimeByName) {
  put("r1/fisheye/data.csv", "# a comment\n#timestamp [ticks],filename\n10,a.png\n");
  EXPECT_THAT(refusal(),
              AllOf(HasSubstr("r1/fisheye/data.csv:2"), HasSubstr("[ticks]"), HasSubstr("ns, us, ms")));
}

TEST_F(DatasetFiles, ListsRejectedRows) {
  put("r1/fisheye/data.csv",
      "#timestamp [ns],filename\n10,a.png\nnan,b.png\r\n30.5,c.png\n\n40,\n50,d.png,x\n60, e.png \n");
  const Dataset d = open();
  const auto& rows = d.robots[0].fisheye->rows;
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[1].path, "") << "a row without a file name is a missing frame";
  EXPECT_EQ(rows[1].sequence, 3u) << "rejected rows keep their number";
  EXPECT_THAT(rows[2].path, HasSubstr("data/e.png"));
  EXPECT_THAT(d.warnings,
              ElementsAre(HasSubstr("data.csv:3: the timestamp"), HasSubstr("data.csv:4: the timestamp"),
                          HasSubstr("data.csv:7: expected the columns")));
}

TEST_F(DatasetFiles, RejectsFileOutsideOfDataFolder) {
  put("r1/fisheye/data.csv", "10,a.png\n20,../../../secret.png\n30,/etc/secret.png\n40,x/../b.png\n");
  const Dataset dataset = open();
  const std::vector<ImageRow>& rows = dataset.robots[0].fisheye->rows;
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_THAT(rows[1].path, HasSubstr("data/b.png"));
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("data.csv:2: the file '../../../secret.png'"),
                                            HasSubstr("data.csv:3: the file '/etc/secret.png'")));
}

TEST_F(DatasetFiles, RejectsWheelRowNotFiniteOrOutOfOrder) {
  put("r1/wheels/data.csv",
      "#t,l,r\n10,0.1,0.2\n20,nan,0.2\n30,0.3,inf\n25,1,1\n24,1,1\n25,2,2\n40,-0.5,+1e-3\n");
  const Dataset d = open();
  const auto& wheels = d.robots[0].wheels;
  ASSERT_EQ(wheels.size(), 3u);
  EXPECT_EQ(wheels[1].time_ns, 25);
  EXPECT_EQ(wheels[2].left_mps, -0.5);
  EXPECT_EQ(wheels[2].right_mps, 1e-3);
  EXPECT_THAT(d.warnings, ElementsAre(HasSubstr(":3: wheel speeds"), HasSubstr(":4: wheel speeds"),
                                      HasSubstr(":6: time 24 is not after the latest time 25"),
                                      HasSubstr(":7: time 25 is not after the latest")));
}

TEST_F(DatasetFiles, ReadsObservationsAndLaser) {
  put("r2/observations.csv", "#t,id,range,bearing\n10,7,1.5,3.5\n10,r1,2.5,-0.25\n10,,1,1\n11,8,-1,0\n");
  put("r2/laser/data.csv", "#t,min,inc,ranges\n5,-1.57,0.01,1.0,inf,nan,0,-1,2.5\n6,0,0,1\n7,0,0.1,x\n");
  const Dataset d = open();
  const RobotRecording& r2 = *d.findRobot("r2");
  ASSERT_EQ(r2.observations.size(), 2u);
  EXPECT_NEAR(r2.observations[0].bearing_rad, 3.5 - 2 * M_PI, 1e-15);
  EXPECT_EQ(r2.observations[1].id, "r1");
  ASSERT_EQ(r2.laser.size(), 1u);
  const float none = std::numeric_limits<float>::infinity();
  EXPECT_THAT(r2.laser[0].range_m, ElementsAre(1.0f, none, none, none, none, 2.5f));
  EXPECT_EQ(d.warnings.size(), 4u);
}

TEST_F(DatasetFiles, RejectsImpossibleObservations) {
  put("r2/observations.csv",
      "10,7,1.5,0.5\n10,r2,1,0\n10,8,1e9,0\n11,8,1000,99\n11,8,1000,6.28\n11,9,2,-0.1\n11,8,999,6.2\n12,8,2,"
      "0\n12,9,0,0\n");
  const Dataset d = open();
  const RobotRecording& r2 = *d.findRobot("r2");
  EXPECT_EQ(r2.observations.size(), 4u);
  EXPECT_THAT(d.warnings,
              ElementsAre(HasSubstr(":2: the robot 'r2' cannot observe itself"),
                          HasSubstr(":3: the range must be above 0 and at most 1000 m"),
                          HasSubstr(":4: the bearing must be within ±2π rad; 99 looks like degrees"),
                          HasSubstr(":7: '8' is observed twice at the same time; the first row is used"),
                          HasSubstr(":9: the range must be above 0")));
}

TEST_F(DatasetFiles, RejectsObservationsInDegrees) {
  put("r2/observations.csv", "10,7,1.5,45\n11,7,1.5,3\n12,7,1.5,-70\n13,7,1.5,1\n");
  EXPECT_THAT([&] { open(); }, ::testing::ThrowsMessage<options::Error>(
                                   HasSubstr("2 of 4 bearings are beyond ±2π; bearings must be in radians")));
}

TEST_F(DatasetFiles, RejectsOnlyTheTimeTooFarAhead) {
  put("r1/wheels/data.csv", "10,1,1\n20,1,1\n99999,1,1\n30,1,1\n40,1,1\n50,1,1\n60,1,1\n");
  put("r2/observations.csv", "10,7,1,0\n99999,7,1,0\n20,7,1,0\n20,8,1,0\n30,7,1,0\n");
  put("r1/fisheye/data.csv", "10,a.png\n99999,b.png\n20,c.png\n30,d.png\n40,e.png\n");
  const Dataset d = open();
  EXPECT_EQ(d.findRobot("r1")->wheels.size(), 6u);
  EXPECT_EQ(d.findRobot("r2")->observations.size(), 4u);
  EXPECT_EQ(d.findStream("r1/fisheye")->rows.size(), 4u);
  EXPECT_THAT(d.warnings,
              ::testing::UnorderedElementsAre(
                  HasSubstr("wheels/data.csv:3: the time is later than the times of the next 3 rows"),
                  HasSubstr("observations.csv:2: the time is later"),
                  HasSubstr("fisheye/data.csv:2: the time is later")));
}

TEST_F(DatasetFiles, WarnsAboutTableWithoutRow) {
  put("r1/fisheye/data.csv", "#timestamp [ns],filename\n");
  put("r1/wheels/data.csv", "");
  const Dataset d = open();
  EXPECT_THAT(d.warnings, ElementsAre(HasSubstr("r1/fisheye/data.csv: contains no row"),
                                      HasSubstr("r1/wheels/data.csv: contains no row")));
}

TEST_F(DatasetFiles, WarnsAboutRobotWithoutFolder) {
  EXPECT_TRUE(open().warnings.empty());
  std::filesystem::remove_all(folder_ / "r2");
  const Dataset d = open();
  EXPECT_EQ(d.robots.size(), 2u);
  EXPECT_THAT(d.warnings,
              ElementsAre(AllOf(HasSubstr("dataset.yaml: robots.r2: folder "), HasSubstr("/r2"))));
  std::filesystem::remove_all(folder_ / "r1");
  EXPECT_TRUE(open().warnings.empty()) << "ground truth only, as a simulated run writes it";
}

/// Clocks of recordings do not run before their epoch.
TEST_F(DatasetFiles, RejectsNegativeTimes) {
  put("r1/fisheye/data.csv", "#timestamp [ns],filename\n-10,a.png\n20,b.png\n");
  put("r1/wheels/data.csv", "-5,1,1\n0,1,1\n");
  const Dataset d = open();
  ASSERT_EQ(d.robots[0].fisheye->rows.size(), 1u);
  EXPECT_EQ(d.robots[0].fisheye->rows[0].sequence, 1u) << "rejected rows keep their number";
  ASSERT_EQ(d.robots[0].wheels.size(), 1u);
  EXPECT_THAT(d.warnings,
              ElementsAre(HasSubstr("data.csv:2: the timestamp"), HasSubstr("data.csv:1: the timestamp")));
}

TEST_F(DatasetFiles, ReadsCeilingCamerasAndBothMarkerKinds) {
  put("ceiling/c2/sensor.yaml", kSensor);
  put("ceiling/c2/data.csv", "1,x.jpg\n");
  put("ceiling/c1/sensor.yaml", kSensor);
  put("ceiling/c1/data.csv", "#nothing recorded\n");
  put("ceiling/markers.yaml",
      "kind: patches\nheight_m: 0.3\nteam_rgb: [20, 90, 220]\nteam_offset_m: [-0.06, 0]\n"
      "individual_offset_m: [0.06, 0]\npatch_size_m: [0.09, 0.12]\nrobots:\n  r1: {rgb: [230, 60, 61]}\n");
  Dataset d = open();
  ASSERT_EQ(d.ceiling.size(), 2u);
  EXPECT_EQ(d.ceiling[0].name, "ceiling/c1");
  EXPECT_TRUE(d.ceiling[0].rows.empty());
  ASSERT_TRUE(d.markers);
  EXPECT_EQ(d.markers->kind, MarkerKind::kPatches);
  EXPECT_EQ(d.markers->team, (Rgb{20, 90, 220}));
  EXPECT_EQ(d.markers->robots.at("r1").individual, (Rgb{230, 60, 61}));
  EXPECT_EQ(d.markers->patch_size_m, Eigen::Vector2d(0.09, 0.12));
  put("ceiling/markers.yaml",
      "kind: cover_tail_head\nheight_m: 0.3\ncover_size_m: 0.3\nhead_offset_m: [0.1, 0]\nhead_size_m: [0.05, "
      "0.06]\n"
      "tail_offset_m: [-0.1, 0]\ntail_size_m: 0.05\nrobots:\n"
      "  r1: {cover_rgb: [1, 2, 3], tail_rgb: [4, 5, 6], head_rgb: [7, 8, 9]}\n");
  d = open();
  EXPECT_EQ(d.markers->kind, MarkerKind::kCoverTailHead);
  EXPECT_EQ(d.markers->cover_size_m, Eigen::Vector2d(0.3, 0.3));
  EXPECT_EQ(d.markers->robots.at("r1").head, (Rgb{7, 8, 9}));
  EXPECT_EQ(MarkerSet::read(options::Section::parse(d.markers->toYaml(), "m")).toYaml(), d.markers->toYaml());
}

TEST_F(DatasetFiles, ReportsMissingMarkersAndMissingScans) {
  put("ceiling/c1/sensor.yaml", kSensor);
  put("ceiling/c1/data.csv", "1,x.jpg\n");
  EXPECT_THAT(open().warnings, testing::Contains(HasSubstr("ceiling/markers.yaml: is missing")));
  put("r2/laser/sensor.yaml", "range_max_m: 8\n");
  EXPECT_THAT(refusal(), HasSubstr("r2/laser/data.csv: is missing"));
}

/// The text as some editors and spreadsheets save it: with a byte order mark and CRLF.
std::string editedElsewhere(const std::string& text) {
  std::string edited = "\xEF\xBB\xBF";
  for (const char c : text) {
    if (c == '\n') edited += '\r';
    edited += c;
  }
  return edited;
}

TEST_F(DatasetFiles, AcceptsByteOrderMarkAndCrlfInEveryFile) {
  const std::map<std::string, std::string> files{
      {"dataset.yaml", kDataset},
      {"landmarks.yaml", "landmarks:\n  \"6\": {position_m: [0.5, -4.25]}\n"},
      {"ceiling/markers.yaml",
       "kind: patches\nheight_m: 0.3\nteam_rgb: [20, 90, 220]\nteam_offset_m: [-0.06, 0]\n"
       "individual_offset_m: [0.06, 0]\npatch_size_m: [0.09, 0.12]\nrobots:\n  r1: {rgb: [230, 60, 61]}\n"},
      {"r1/fisheye/sensor.yaml", kSensor},
      {"r1/fisheye/data.csv", "#timestamp [ns],filename\n10,a.png\n20,b.png\n"},
      {"r1/wheels/data.csv", "10,0.1,0.2\n20,0.3,0.4\n"},
      {"r2/observations.csv", "#timestamp [ns],id,range [m],bearing [rad]\n10,r1,1.5,0.25\n"},
      {"r2/laser/data.csv",
       "#timestamp [ns],angle_min [rad],angle_increment [rad],ranges [m]\n5,0,0.01,1,2\n"},
      {"r2/laser/sensor.yaml", "yaw_deg: 90\nrange_max_m: 8\n"},
      {"groundtruth/r1.tum", "0.00000001 1 2 0 0 0 0 1\n"},
      {"groundtruth/scene.geojson", "{\"type\": \"FeatureCollection\", \"features\": [\n]}\n"},
  };
  for (const auto& [name, text] : files) put(name, editedElsewhere(text));
  const Dataset d = open();
  EXPECT_THAT(d.warnings, testing::IsEmpty());
  ASSERT_EQ(d.robots.size(), 2u);
  const RobotRecording &r1 = d.robots[0], &r2 = d.robots[1];
  ASSERT_EQ(r1.fisheye->rows.size(), 2u);
  EXPECT_EQ(r1.fisheye->rows[0].sequence, 0u) << "the header does not count as a rejected row";
  EXPECT_THAT(r1.fisheye->rows[1].path, testing::EndsWith("data/b.png"));
  EXPECT_EQ(r1.wheels.size(), 2u) << "without a header the mark precedes a number";
  EXPECT_EQ(r2.observations.size(), 1u);
  ASSERT_EQ(r2.laser.size(), 1u);
  EXPECT_THAT(r2.laser[0].range_m, ElementsAre(1.0f, 2.0f));
  EXPECT_EQ(r2.laser_sensor.range_max_m, 8.0);
  EXPECT_EQ(d.markers->robots.at("r1").individual, (Rgb{230, 60, 61}));
  ASSERT_EQ(d.landmarks.size(), 1u);
  const GroundTruth truth = GroundTruth::load(folder_.path());
  EXPECT_TRUE(truth.has_scene);
  ASSERT_EQ(truth.trajectories.at("r1").size(), 1u);
  EXPECT_EQ(truth.trajectories.at("r1")[0].time_ns, 10);
}

TEST_F(DatasetFiles, NamesFileLineAndRemedyInErrors) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = kDataset;
    text.replace(text.find(from), from.size(), to);
    put("dataset.yaml", text);
    return refusal();
  };
  EXPECT_THAT(with("version: 1", "version: 2"),
              AllOf(HasSubstr("dataset.yaml:2: version"), HasSubstr("[1, 1]")));
  EXPECT_THAT(with("omnifleet-dataset", "euroc"), HasSubstr("dataset.yaml:1: format"));
  EXPECT_THAT(with("wheel_separation_m: 0.26", "wheel_separation_m: -1"), HasSubstr("dataset.yaml:9"));
  EXPECT_THAT(with("wheel_separation_m", "wheel_distance"), HasSubstr("unknown key"));
  EXPECT_THAT(with("radius_m: 0.15", "radius_m: 0.15, footprint_m: [[0, 0], [1, 0], [1, 1]]"),
              HasSubstr("exactly one"));
  EXPECT_THAT(with("    body: {radius_m: 0.15, height_m: 0.3}\n", ""),
              AllOf(HasSubstr("dataset.yaml:8: robots.r1.body"), HasSubstr("is required")));
  EXPECT_THAT(with("[1, 2, 3.5]", "[1, 1e7, 0]"),
              AllOf(HasSubstr("dataset.yaml:5: robots.r2.initial_pose"), HasSubstr("±1000 m")));
  EXPECT_THAT(with("  r1:", "  ceiling:"), HasSubstr("must not be ceiling"));
  put("r1/wheels/data.csv", "#timestamp [ns],v_left,v_right\n10,0,0\n");
  EXPECT_THAT(with("    wheel_separation_m: 0.26\n", ""),
              AllOf(HasSubstr("dataset.yaml: robots.r1.wheel_separation_m"), HasSubstr("is required")));
  EXPECT_THAT(with("  r1:", "  r/1:"), HasSubstr("letters"));
  put("dataset.yaml", kDataset);
  put("r1/fisheye/data.csv", "#timestamp [ns],filename\nx,a.png\n");
  EXPECT_THAT(refusal(), AllOf(HasSubstr("data.csv:2: the timestamp"), HasSubstr("remove the file")));
  std::filesystem::remove(folder_ / "r1/fisheye/data.csv");
  EXPECT_THAT(refusal(), AllOf(HasSubstr("data.csv"), HasSubstr("cannot be read")));
  std::filesystem::remove(folder_ / "dataset.yaml");
  EXPECT_THAT(refusal(), HasSubstr("dataset.yaml: is missing"));
  EXPECT_THROW(Dataset::open(folder_ / "nowhere"), options::Error);
}

}  // namespace
}  // namespace omnifleet::dataset
