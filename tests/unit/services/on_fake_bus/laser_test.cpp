// A robot with a laser and no camera: its local mapper with valid and invalid scans, and a fleet of such
// robots on a recording of the arena.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <octomap/OcTree.h>
#include <unistd.h>
#include <algorithm>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"
#include "world/recording.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr TimeNs kScanPeriod = 200'000'000;
constexpr std::size_t kBeams = 360;

class Folder {
 public:
  explicit Folder(const std::string& name)
      : path_(fs::temp_directory_path() / (name + "_" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

constexpr int kImageWidth = 480, kImageHeight = 360;

/// @param camera adds a fisheye
std::string fleetFile(const Folder& folder, bool camera = false) {
  std::ofstream(folder / "laser.yaml") << "position_m: [0, 0, 0.1]\nrange_max_m: 5\nrange_sigma_m: 0.005\n";
  std::ofstream(folder / "fleet.yaml")
      << "robots: {r1: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26, wheels: true, "
         "laser: laser.yaml}}\n"
      << (camera ? "cameras: {r1/fisheye: {source: folder, path: ., sensor: fisheye.yaml}}\n" : "");
  std::ofstream(folder / "fisheye.yaml") << "camera_model: fisheye\nprojection: equidistant\nimage_width: "
                                            "480\nimage_height: 360\nfocal_px: 111.494\n"
                                            "principal_point_px: [239.5, 179.5]\nfov_deg: 185\nposition_m: "
                                            "[0, 0, 0.5]\nself_mask_radius_px: 75\n";
  return folder / "fleet.yaml";
}

/// The local mapper of r1 with its scanner and wheels.
class LaserStage : public testing::Test {
 protected:
  explicit LaserStage(bool camera = false)
      : folder_("omnifleet_laser_stage"),
        bench_("local_mapper", "r1", {}, fleetFile(folder_, camera)),
        scans_(bench_.bus().writer(bench_.topics.laser, "r1")),
        wheels_(bench_.bus().writer(bench_.topics.wheels_odometry, "r1")),
        maps_(bench_.bus().reader(bench_.topics.local_map, "r1")) {}

  /// A disc of 15 cm radius, 1 m straight ahead.
  v1::LaserScan scan(std::uint32_t index) const {
    v1::LaserScan sample;
    sample.robot("r1");
    sample.header().acquired_ns(index * kScanPeriod);
    sample.header().sequence_number(index);
    sample.angle_min_rad(-M_PI);
    sample.angle_increment_rad(2.0 * M_PI / kBeams);
    sample.range_max_m(5.0f);
    for (std::size_t i = 0; i < kBeams; ++i) {
      const double bearing = -M_PI + 2.0 * M_PI * static_cast<double>(i) / kBeams;
      const double half = 0.15 * 0.15 - std::sin(bearing) * std::sin(bearing);
      const bool hit = half > 0.0 && std::cos(bearing) > 0.0;
      sample.range_m().push_back(hit ? static_cast<float>(std::cos(bearing) - std::sqrt(half))
                                     : std::numeric_limits<float>::infinity());
    }
    return sample;
  }
  void sendWheels(TimeNs time) {
    v1::WheelOdometry sample;
    sample.robot("r1");
    sample.header().acquired_ns(time);
    sample.v_left_mps(0.1);
    sample.v_right_mps(0.1);
    ASSERT_TRUE(wheels_->write(sample));
  }
  /// Sends one scan. @return the stage's answer
  v1::LocalMap answerTo(const v1::LaserScan& sample) {
    EXPECT_TRUE(scans_->write(sample));
    sendWheels(sample.header().acquired_ns());
    bench_.spin();
    v1::LocalMap answer, none;
    EXPECT_TRUE(maps_->take(answer)) << "every scan must have an answer";
    EXPECT_FALSE(maps_->take(none)) << "a scan must have only one answer";
    EXPECT_EQ(answer.header().sequence_number(), sample.header().sequence_number());
    return answer;
  }

  /// Expects one new message.
  void expectMessage(ErrorCode code, const std::string& text) {
    const std::vector<Message> messages = bench_.messages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].code, code);
    EXPECT_THAT(messages[0].text, HasSubstr(text));
  }

  Folder folder_;
  test::StageBench bench_;
  std::unique_ptr<bus::Writer<v1::LaserScan>> scans_;
  std::unique_ptr<bus::Writer<v1::WheelOdometry>> wheels_;
  std::unique_ptr<bus::Reader<v1::LocalMap>> maps_;
};

TEST_F(LaserStage, ConvertsScanToLocalMap) {
  answerTo(scan(0));
  const v1::LocalMap map = answerTo(scan(1));
  EXPECT_EQ(map.state(), v1::FrameState::FRAME_OK);
  EXPECT_EQ(map.camera_height_m(), 0.0);
  EXPECT_TRUE(map.motion().valid());
  EXPECT_NEAR(map.motion().previous_from_current().x(), 0.02, 1e-9);  // 0.1 m/s for 0.2 s
  ASSERT_EQ(map.objects().size(), 1u);
  EXPECT_NEAR(map.objects()[0].contact().x(), 0.85, 1e-3);
  ASSERT_EQ(map.scan().range_m().size(), kBeams);
  EXPECT_NEAR(map.scan().range_m()[0], 0.85, 1e-3);
  EXPECT_EQ(map.scan().range_m()[180], 5.0f) << "free up to the range of the scanner";
}

TEST_F(LaserStage, RejectsInvalidScansAndContinues) {
  EXPECT_EQ(answerTo(scan(0)).state(), v1::FrameState::FRAME_OK);
  std::uint32_t index = 0, invalid = 0;
  const auto stateWith = [&](auto&& damage) {
    v1::LaserScan sample = scan(++index);
    damage(sample);
    const v1::LocalMap map = answerTo(sample);
    EXPECT_TRUE(map.objects().empty() && map.scan().range_m().empty());
    EXPECT_EQ(bench_.status().invalid, ++invalid);
    EXPECT_THAT(bench_.status().last_error.text, HasSubstr("scan " + std::to_string(index) + " of laser r1"));
    EXPECT_EQ(answerTo(scan(++index)).state(), v1::FrameState::FRAME_OK);
    return map.state();
  };
  EXPECT_EQ(stateWith([](auto& s) { s.range_m()[7] = std::nanf(""); }), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_EQ(stateWith([](auto& s) { s.range_m()[7] = -0.5f; }), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_EQ(stateWith([](auto& s) { s.angle_increment_rad(0.0); }), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_EQ(stateWith([](auto& s) { s.angle_min_rad(std::nan("")); }), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_EQ(stateWith([](auto& s) { s.range_max_m(-1.0f); }), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_EQ(stateWith([](auto& s) { s.range_m().clear(); }), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_EQ(bench_.status().drops, 6u);
  EXPECT_EQ(stateWith([](auto& s) { s.range_m().pop_back(); }), v1::FrameState::FRAME_WRONG_SIZE);
  EXPECT_EQ(answerTo(scan(++index)).state(), v1::FrameState::FRAME_OK);
}

/// The failed scanner sends five scans.
TEST_F(LaserStage, ReportsFailedScannerOnceAndSendsNoScan) {
  answerTo(scan(0));
  bench_.messages();
  for (std::uint32_t index = 1; index < 6; ++index) {
    v1::LaserScan failed = scan(index);
    for (float& range : failed.range_m()) range = std::numeric_limits<float>::infinity();
    const v1::LocalMap map = answerTo(failed);
    EXPECT_EQ(map.state(), v1::FrameState::FRAME_DARK);
    EXPECT_TRUE(map.scan().range_m().empty());
  }
  expectMessage(ErrorCode::kScanRejected, "scan 1 of laser r1: ");
  EXPECT_EQ(answerTo(scan(6)).state(), v1::FrameState::FRAME_OK);
  expectMessage(ErrorCode::kScanRejected, "5 consecutive frames rejected: ");
}

TEST_F(LaserStage, RejectsScanOutOfOrder) {
  answerTo(scan(2));
  ASSERT_TRUE(scans_->write(scan(1)));
  ASSERT_TRUE(scans_->write(scan(2)));
  bench_.spin();
  v1::LocalMap none;
  EXPECT_FALSE(maps_->take(none));
  EXPECT_EQ(bench_.status().drops, 2u);
  EXPECT_EQ(bench_.status().last_error.code, ErrorCode::kSampleOutOfOrder);
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("laser r1: "));
}

/// The same robot with an additional camera that sees only floor.
class LaserBesideCamera : public LaserStage {
 protected:
  LaserBesideCamera()
      : LaserStage(true), camera_(bench_.bus().frameWriter("r1/fisheye", kImageWidth * kImageHeight * 3)) {}

  void sendFrame(std::uint32_t index) {
    bus::FrameHeader header;
    header.acquired_ns = index * kScanPeriod;
    header.sequence = index;
    header.width_px = kImageWidth;
    header.height_px = kImageHeight;
    std::uint8_t* loan = camera_->begin(header);
    ASSERT_NE(loan, nullptr);
    test::drawBareFloor(loan, kImageWidth, kImageHeight);
    ASSERT_TRUE(camera_->publish());
  }
  void endStreams() {
    const auto ends = bench_.bus().writer(bench_.topics.run_end);
    const std::map<std::string, TimeNs> last{
        {"camera r1/fisheye", 3 * kScanPeriod}, {"laser r1", 1}, {"wheels/odometry r1", 3 * kScanPeriod}};
    for (const auto& [stream, last_ns] : last) {
      v1::RunEnd end;
      end.stream(stream);
      end.header().acquired_ns(last_ns);
      end.samples(3);
      EXPECT_TRUE(ends->write(end));
    }
  }
  /// The answer to a frame and to a scan that is `age` older.
  v1::LocalMap answerTo(std::uint32_t index, TimeNs age) {
    v1::LaserScan older = scan(index);
    older.header().acquired_ns(index * kScanPeriod - age);
    EXPECT_TRUE(scans_->write(older));
    sendFrame(index);
    sendWheels(index * kScanPeriod);
    v1::LaserScan next = scan(index);  // lockstep waits until no other scan can precede the frame
    next.header().acquired_ns(index * kScanPeriod + 1);
    if (age > 0) {
      EXPECT_TRUE(scans_->write(next));
    }
    bench_.spin();
    v1::LocalMap answer, none;
    EXPECT_TRUE(maps_->take(answer));
    EXPECT_FALSE(maps_->take(none)) << "a scan alone must not give a local map";
    return answer;
  }

  std::unique_ptr<bus::FrameWriter> camera_;
};

TEST_F(LaserBesideCamera, MergesScanOfSameTimeWithCamera) {
  const v1::LocalMap map = answerTo(1, 0);
  EXPECT_EQ(map.state(), v1::FrameState::FRAME_OK);
  EXPECT_NEAR(map.camera_height_m(), 0.5, 1e-9) << "the local map must be that of the camera";
  EXPECT_NEAR(map.scan().range_m()[0], 0.85, 2e-3);
  EXPECT_EQ(map.scan().label()[0], static_cast<std::uint8_t>(RayLabel::kUnknown));
  EXPECT_EQ(map.scan().label()[180], static_cast<std::uint8_t>(RayLabel::kFloorEnd));
  EXPECT_LT(map.scan().range_m()[180], 4.0f) << "limited to the range of the camera";
}

TEST_F(LaserBesideCamera, ReportsScansOfAnotherClockAtTheEnd) {
  for (std::uint32_t index = 1; index <= 3; ++index) {
    v1::LaserScan other = scan(index);
    other.header().acquired_ns(other.header().acquired_ns() / 1000);  // microseconds
    EXPECT_TRUE(scans_->write(other));
    sendFrame(index);
    sendWheels(index * kScanPeriod);
  }
  endStreams();
  bench_.spin();
  std::vector<Message> messages = bench_.messages();
  messages.erase(std::remove_if(messages.begin(), messages.end(),
                                [](const Message& m) { return m.code != ErrorCode::kClockOffset; }),
                 messages.end());
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_THAT(messages[0].text, HasSubstr("camera r1/fisheye: 0.200 to 0.600 s, laser r1: 0.000 to 0.001 s"));
  EXPECT_THAT(messages[0].text, HasSubstr("microseconds"));
}

TEST_F(LaserBesideCamera, IgnoresOlderScan) {
  const v1::LocalMap map = answerTo(1, kScanPeriod / 2);
  EXPECT_EQ(map.state(), v1::FrameState::FRAME_OK);
  EXPECT_EQ(map.scan().label()[0], static_cast<std::uint8_t>(RayLabel::kFloorEnd));
}

/// Two robots drive past two obstacles within walls, one on each side.
synthetic::Arena arena() {
  return synthetic::Arena::read(options::Section::parse(R"(
name: lasers
frames: {rate_hz: 5, duration_s: 30}
floor: {size_m: [4.0, 3.2]}
obstacles:
  - {kind: box, pose: [0.0, 0.0, 0.4], size_m: [0.30, 0.20], height_m: 0.18}
  - {kind: cylinder, pose: [0.7, 0.1, 0], radius_m: 0.12, height_m: 0.20}
walls: {height_m: 0.3}
robots:
  r1: {initial_pose: [-1.20, 0.75, 0.0], waypoints: [[1.30, 0.75]]}
  r2: {initial_pose: [-1.20, -0.75, 0.0], waypoints: [[1.30, -0.75]]}
rigs:
  laser: {beams: 720, position_m: [0.02, 0, 0.08], range_max_m: 5.0, range_sigma_m: 0.005}
)",
                                                        "lasers.yaml"));
}

std::map<std::string, std::string> resultsOf(const fs::path& out) {
  std::map<std::string, std::string> files;
  for (const char* name : {"objects.geojson", "map.bt", "trajectories/r1.tum", "trajectories/r2.tum"}) {
    std::ostringstream text;
    text << std::ifstream(out / name, std::ios::binary).rdbuf();
    files[name] = text.str();
  }
  return files;
}

TEST(LaserFleet, MapsRecordingOfScansReproducibly) {
  const Folder folder("omnifleet_laser_fleet");
  const synthetic::Arena scene = arena();
  world::RecordingOptions options;
  options.world = world::World::Options::read(scene.world);
  world::record(scene, options, folder / "recording");
  services::InProcessRun run;
  run.dataset = folder / "recording";
  run.out = folder / "one";
  ASSERT_TRUE(services::runInProcess(run));

  auto found = dataset::readObjects(folder / "one/objects.geojson");
  const auto open = [](const dataset::MapObject& object) { return object.isOpen(); };
  EXPECT_TRUE(std::any_of(found.begin(), found.end(), open)) << "the walls";
  found.erase(std::remove_if(found.begin(), found.end(), open), found.end());
  const auto truth = scene.truthScene(0.0);
  ASSERT_EQ(found.size(), truth.size()) << "no missed and no false obstacle: walls and robots do not count";
  for (const auto& object : truth) {
    double nearest = 1.0;
    for (const auto& seen : found) nearest = std::min(nearest, (seen.centroid_m - object.centroid_m).norm());
    EXPECT_LT(nearest, 0.02) << "sides are accurate to 0.5 cm, paths to 1 cm";
  }
  for (const std::string robot : {"r1", "r2"}) {
    const auto path = dataset::readTum((folder / ("one/trajectories/" + robot + ".tum")).string());
    const auto true_path = dataset::readTum((folder / ("recording/groundtruth/" + robot + ".tum")).string());
    ASSERT_EQ(path.size(), true_path.size()) << "one row per scan";
    const Eigen::Vector2d off = (path.back().position_m - true_path.back().position_m).head<2>();
    EXPECT_LT(off.norm(), 0.05) << robot;
  }
  const octomap::OcTree tree((folder / "one/map.bt").string());
  const auto occupied = [&](double x, double y) {
    const auto* node = tree.search(x, y, 0.0);
    return node == nullptr ? -1 : tree.isNodeOccupied(node) ? 1 : 0;
  };
  EXPECT_EQ(occupied(-0.6, 0.4), 0) << "free floor";
  EXPECT_EQ(occupied(0.7, 0.23), 1) << "the near side of the cylinder";
  // The wall is the border of two cells. Only the nearer one is visible.
  EXPECT_EQ(occupied(-0.6, 1.58), 1) << "a wall";
  EXPECT_EQ(occupied(-0.6, 1.62), -1) << "behind it";

  run.out = folder / "two";
  ASSERT_TRUE(services::runInProcess(run));
  EXPECT_EQ(resultsOf(folder / "one"), resultsOf(folder / "two"));
}

}  // namespace
}  // namespace omnifleet
