// Fleet files: content, resulting processes, and messages for rejected files.

#include "fleet/fleet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace omnifleet::fleet {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kSensor =
    "camera_model: fisheye\nprojection: equidistant\nimage_width: 640\nimage_height: 480\n"
    "focal_px: 150\nprincipal_point_px: [319.5, 239.5]\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n";

constexpr const char* kRobots =
    "robots:\n"
    "  r2: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26, wheels: true, host: pc2}\n"
    "  r1: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26, initial_pose: [1, 2, 0.5], "
    "host: pc1}\n";

constexpr const char* kCameras =
    "cameras:\n"
    "  r1/fisheye: {source: folder, path: pictures, sensor: sensor.yaml, rate_hz: 4, host: pc1}\n"
    "  r2/fisheye: {source: device, path: /dev/video0, sensor: sensor.yaml, host: pc2}\n";

class FleetFile : public testing::Test {
 protected:
  FleetFile() : folder_(fs::temp_directory_path() / ("omnifleet_fleet_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    write("sensor.yaml", kSensor);
  }
  ~FleetFile() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    const fs::path path = folder_ / name;
    std::ofstream(path) << text;
    return path;
  }
  Fleet load(const std::string& text, const std::vector<std::string>& overlays = {}) {
    return Fleet::load(write("fleet.yaml", text), "", overlays);
  }
  std::string problemOf(const std::string& text, const std::vector<std::string>& overlays = {}) {
    try {
      load(text, overlays);
    } catch (const options::Error& error) {
      return error.what();
    }
    return "nothing";
  }

  fs::path folder_;
};

std::vector<std::string> names(const std::vector<ProcessSpec>& processes) {
  std::vector<std::string> all;
  for (const ProcessSpec& p : processes)
    all.push_back(p.service + (p.instance.empty() ? "" : " " + p.instance));
  return all;
}

TEST_F(FleetFile, SortsRobotsAndCameras) {
  const Fleet fleet = load(std::string(kRobots) + kCameras);
  ASSERT_EQ(fleet.robots.size(), 2u);
  EXPECT_EQ(fleet.robots[0].name, "r1");
  EXPECT_EQ(fleet.robots[0].initial_pose->theta_rad, 0.5);
  EXPECT_FALSE(fleet.robots[0].has_wheels);
  EXPECT_TRUE(fleet.robots[1].has_wheels);
  EXPECT_FALSE(fleet.robots[1].initial_pose);
  EXPECT_EQ(fleet.camera("r1/fisheye").path, (folder_ / "pictures").string())
      << "relative to the folder of the fleet file";
  EXPECT_EQ(fleet.camera("r1/fisheye").rate_hz, 4.0);
  EXPECT_EQ(fleet.camera("r2/fisheye").path, "/dev/video0");
  EXPECT_EQ(fleet.mappingRobots(), (std::vector<std::string>{"r1", "r2"}));
}

TEST_F(FleetFile, ListsProcessesUpstreamFirst) {
  const Fleet fleet = load(std::string(kRobots) + kCameras);
  EXPECT_EQ(names(processes(fleet)),
            (std::vector<std::string>{"camera r1/fisheye", "camera r2/fisheye", "local_mapper r1",
                                      "local_mapper r2", "classifier r1", "classifier r2", "localizer",
                                      "global_merger r1", "global_merger r2"}));
  EXPECT_EQ(names(processes(fleet, "pc2")), (std::vector<std::string>{"camera r2/fisheye", "local_mapper r2",
                                                                      "classifier r2", "global_merger r2"}));
}

/// Independent count of the readers: from the processes, by the table of idl/README.md.
TEST_F(FleetFile, ExpectsReadersOfAllReadingProcesses) {
  for (const std::string& more : {std::string(), std::string("services: {formation: {}}\n")}) {
    const Fleet fleet = load(std::string(kRobots) + kCameras + more);
    std::map<std::string, int> of;
    for (const ProcessSpec& process : processes(fleet)) ++of[process.service];
    EXPECT_EQ(expectedReaders(fleet, "pose", "r1"), of["classifier"] + of["global_merger"] + of["formation"]);
    EXPECT_EQ(expectedReaders(fleet, "map/contribution", "r1"), of["global_merger"]);
    EXPECT_EQ(expectedReaders(fleet, "alignment", "r1"), 1) << "the replica that saves";
    EXPECT_EQ(expectedReaders(fleet, "objects", "r1"), 2 + (of["formation"] > 0 ? 1 : 0));
    EXPECT_EQ(expectedReaders(fleet, "local_map", "r1"), 1);
  }
}

TEST_F(FleetFile, DrivesArenaByFormationSectionOfFleetFile) {
  const std::string world = std::string("world: {arena: ") + std::getenv("OMNIFLEET_SOURCE_DIR") +
                            "/config/arenas/ahmed.yaml}\n";  // an arena of tours
  EXPECT_FALSE(load(world).hasFormation());
  const Fleet fleet = load(world + "services: {formation: {behaviour: exploration}}\n");
  ASSERT_TRUE(fleet.hasFormation());
  const std::vector<std::string> all = names(processes(fleet));
  for (const char* robot : {"r1", "r2"})
    EXPECT_EQ(std::count(all.begin(), all.end(), std::string("formation ") + robot), 1);
  for (const char* parked : {"r3", "r4"})
    EXPECT_EQ(std::count(all.begin(), all.end(), std::string("formation ") + parked), 0);
}

TEST_F(FleetFile, ReadsNetwork) {
  const std::string lab = std::string(kRobots) + kCameras;
  EXPECT_TRUE(load(lab).network.interfaces.empty());
  const Fleet fleet = load(lab + "network: {interface: wlan0, peers: [pc1, 192.168.1.11]}\n");
  EXPECT_THAT(fleet.network.interfaces, testing::ElementsAre("wlan0"));
  EXPECT_THAT(fleet.network.peers, testing::ElementsAre("pc1", "192.168.1.11"));
  EXPECT_THAT(load(lab + "network: {addresses: [10.0.0.0/24]}\n").network.interfaces,
              testing::ElementsAre("10.0.0.0/24"));
  EXPECT_THAT(problemOf(lab + "network: {interface: eth0, addresses: [10.0.0.1]}\n"), HasSubstr("conflicts"));
  EXPECT_THAT(problemOf(lab + "network: {peers: [pc1]}\n"), HasSubstr("interface or addresses"));
  EXPECT_THAT(problemOf(lab + "network: {interfaces: eth0}\n"), HasSubstr("network.interfaces"));
}

/// The arena describes its robots; the fleet file says on which machines they run.
TEST_F(FleetFile, PlacesRobotsOfArenaOnMachines) {
  const Fleet fleet = load(std::string("world: {arena: ") + std::getenv("OMNIFLEET_SOURCE_DIR") +
                           "/config/arenas/small.yaml}\nrobots: {r1: {host: pc1}, r2: {host: pc2}}\n"
                           "cameras: {ceiling/c1: {host: pc1}}\n");
  EXPECT_THAT(fleet.hosts(), testing::ElementsAre("pc1", "pc2"));
  EXPECT_THAT(names(processes(fleet, "pc2")),
              testing::UnorderedElementsAre("camera r2/fisheye", "local_mapper r2", "classifier r2",
                                            "formation r2", "global_merger r2"))
      << "a robot's camera is where the robot is";
  EXPECT_THAT(names(processes(fleet, "pc1")), testing::IsSupersetOf({"world", "localizer"}))
      << "services of the whole fleet run on the first machine";
}

/// Frames do not leave their machine: such a fleet would run without a single frame.
TEST_F(FleetFile, RefusesCameraOnAnotherMachineThanItsReader) {
  const std::string arena = std::string("world: {arena: ") + std::getenv("OMNIFLEET_SOURCE_DIR") +
                            "/config/arenas/small.yaml}\nrobots: {r1: {host: pc1}, r2: {host: pc2}}\n";
  EXPECT_THAT(problemOf(arena + "cameras: {r1/fisheye: {host: pc2}, ceiling/c1: {host: pc1}}\n"),
              testing::AllOf(HasSubstr("cameras.r1/fisheye: it is on pc2"), HasSubstr("local_mapper r1"),
                             HasSubstr("is on pc1")));
  EXPECT_THAT(
      problemOf(arena + "cameras: {ceiling/c1: {host: pc1}}\nservices: {local_mapper: {host: pc2}}\n"),
      HasSubstr("cameras.r1/fisheye: it is on pc1, but local_mapper r1"));
  EXPECT_EQ(problemOf(arena + "cameras: {ceiling/c1: {host: pc1}}\n"), "nothing");
}

TEST_F(FleetFile, OverridesKeyByKeyWithOverlay) {
  const std::string overlay = write("overlay.yaml", "robots: {r1: {body: {height_m: 0.5}}}\nname: other\n");
  const Fleet fleet = load(std::string("name: lab\n") + kRobots + kCameras, {overlay});
  EXPECT_EQ(fleet.name, "other");
  EXPECT_EQ(fleet.robot("r1").body.height_m, 0.5);
  EXPECT_EQ(fleet.robot("r1").body.radius_m, 0.15);
  EXPECT_EQ(fleet.robot("r2").body.height_m, 0.3);
}

TEST_F(FleetFile, PassesServiceOptionsOfFile) {
  const Fleet fleet =
      load(std::string(kRobots) + kCameras + "services: {classifier: {anything: 3, host: pc9}}\n");
  const options::Section section = fleet.service("classifier");
  EXPECT_EQ(section.keys(), (std::vector<std::string>{"anything", "host"}));
  for (const ProcessSpec& process : processes(fleet)) {
    EXPECT_EQ(process.host == "pc9", process.service == "classifier") << process.service;
  }
}

struct Refused {
  const char* what;
  std::string text;
  std::string names_line, names_problem;
};

TEST_F(FleetFile, NamesFileLineKeyAndBoundInErrors) {
  const std::string good = std::string(kRobots) + kCameras;
  const std::vector<Refused> cases{
      {"unknown key", good + "robot: {}\n", "fleet.yaml:7", "robot"},
      {"unknown service", good + "services: {local_maper: {}}\n", "fleet.yaml:7", "local_maper"},
      {"wrong type",
       std::string("robots: {r1: {body: {radius_m: wide, height_m: 1}, wheel_separation_m: 1}}\n"),
       "fleet.yaml:1", "radius_m"},
      {"out of range",
       std::string("robots:\n  r1: {body: {radius_m: 1, height_m: 1}, wheel_separation_m: -1}\n"),
       "fleet.yaml:2", "wheel_separation_m"},
      {"missing", std::string("robots:\n  r1: {body: {radius_m: 1, height_m: 1}}\n"), "fleet.yaml:2",
       "wheel_separation_m"},
      {"two shapes", std::string("robots:\n  r1: {body: {height_m: 1}, wheel_separation_m: 1}\n"),
       "fleet.yaml:2", "either radius_m or footprint_m"},
      {"camera without robot", good + "  fisheye: {source: folder, path: p, sensor: sensor.yaml}\n",
       "fleet.yaml:7", "ROBOT/fisheye"},
      {"no such source",
       std::string(kRobots) + "cameras:\n  r1/fisheye: {source: film, path: p, sensor: s}\n", "fleet.yaml:5",
       "folder, video, device"},
      {"rate",
       std::string(kRobots) +
           "cameras:\n  r1/fisheye: {source: folder, path: p, sensor: sensor.yaml, rate_hz: 0}\n",
       "fleet.yaml:5", "rate_hz"},
      {"owner",
       std::string(kRobots) + "cameras:\n  r9/fisheye: {source: folder, path: p, sensor: sensor.yaml}\n",
       "fleet.yaml:5", "belongs to robot 'r9'"},
      {"two worlds", std::string(kRobots) + "dataset: .\nworld: {arena: a.yaml}\n", "fleet.yaml",
       "conflicts with dataset"},
  };
  for (const Refused& c : cases) {
    const std::string problem = problemOf(c.text);
    EXPECT_THAT(problem, HasSubstr(c.names_line)) << c.what;
    EXPECT_THAT(problem, HasSubstr(c.names_problem)) << c.what;
    EXPECT_EQ(problem.find('\n'), std::string::npos) << c.what << ": expected one line, got " << problem;
  }
}

TEST_F(FleetFile, RejectsNamesThatExceedTheWireFormat) {
  const auto robot = [](const std::string& name) {
    return "robots: {\"" + name + "\": {body: {radius_m: 1, height_m: 1}, wheel_separation_m: 1}}\n";
  };
  const std::string longest(32, 'a');
  const std::string camera = "/fisheye: {source: folder, path: p, sensor: sensor.yaml}\n";
  EXPECT_EQ(load(robot(longest) + "cameras:\n  " + longest + camera).robots[0].name.size(), 32u);
  EXPECT_THAT(problemOf(robot(std::string(33, 'a'))), HasSubstr("33 characters; 1 to 32 are allowed"));
  EXPECT_THAT(problemOf(robot("r*")), HasSubstr("'r*'"));  // a DDS partition pattern
  EXPECT_THAT(problemOf(robot("a/b")), HasSubstr("'a/b'"));
  EXPECT_THAT(problemOf(robot("r1") + "name: a fleet\n"), HasSubstr("'a fleet'"));
  EXPECT_THAT(problemOf("name: empty\n"), HasSubstr("at least one robot"));
  std::string many = "robots:\n";
  for (int i = 0; i < 33; ++i)
    many += "  r" + std::to_string(i) + ": {body: {radius_m: 1, height_m: 1}, wheel_separation_m: 1}\n";
  EXPECT_THAT(problemOf(many), HasSubstr("robots: 33 robots; 1 to 32 are allowed"));
}

TEST_F(FleetFile, RunsForwardCameraOnlyIfItsRobotMapsWithIt) {
  write("front.yaml",
        "camera_model: pinhole\nprojection: pinhole\nimage_width: 320\nimage_height: 240\nfocal_px: 160\n"
        "principal_point_px: [159.5, 119.5]\nposition_m: [0.1, 0, 0.085]\nrotation_rpy_deg: [0, -78, 0]\n");
  const Fleet fleet = load(std::string(kRobots) + kCameras +
                           "  r1/front: {source: folder, path: front, sensor: front.yaml}\n");
  ASSERT_NE(fleet.frontOf("r1"), nullptr);
  EXPECT_EQ(fleet.frontOf("r1")->id, "r1/front");
  EXPECT_EQ(fleet.frontOf("r2"), nullptr);
  EXPECT_EQ(fleet.fisheyeOf("r1")->id, "r1/fisheye");
  EXPECT_FALSE(fleet.isRead(*fleet.frontOf("r1")));  // its local mapper reads the fisheye camera
  EXPECT_TRUE(fleet.isRead(*fleet.fisheyeOf("r1")));
  EXPECT_THAT(names(processes(fleet)), testing::Not(testing::Contains("camera r1/front")));
}

TEST(ArenaFleet, ParkedRobotsHaveNoSensorsAndNoInitialPose) {
  const Fleet fleet =
      Fleet::load(std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/ahmed.yaml", "", {});
  ASSERT_EQ(fleet.robots.size(), 4u);
  for (const RobotSpec& robot : fleet.robots) {
    EXPECT_FALSE(robot.has_wheels);
    EXPECT_FALSE(robot.initial_pose);
    EXPECT_EQ(robot.body.footprint_m.size(), 4u);
    EXPECT_EQ(fleet.frontOf(robot.name) != nullptr, robot.name < "r3");
  }
  const auto started = names(processes(fleet));
  EXPECT_THAT(started, testing::IsSupersetOf({"world", "camera ceiling/c1", "camera ceiling/c2"}));
  EXPECT_THAT(started, testing::Not(testing::Contains("local_mapper r3")));
  // Every camera that runs reads the true poses, and a forward camera runs if its robot maps.
  const auto cameras = std::count_if(started.begin(), started.end(), [](const std::string& process) {
    return process.rfind("camera ", 0) == 0;
  });
  EXPECT_EQ(cameras, fleet.maps("r1") ? 4 : 2);
  EXPECT_EQ(expectedReaders(fleet, "world/truth", "r3"), cameras);
}

/// Such a fleet would receive no data and never end.
TEST_F(FleetFile, RejectsFleetWithoutSensors) {
  EXPECT_THAT(problemOf(kRobots),
              testing::AllOf(HasSubstr("fleet.yaml:2: robots: no robot has"), HasSubstr("nothing to run")));
  const fs::path truth = folder_ / "recording";
  fs::create_directories(truth / "groundtruth");
  std::ofstream(truth / "dataset.yaml")
      << "format: omnifleet-dataset\nversion: 1\nrobots:\n"
         "  r1: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26}\n";
  try {
    Fleet::load("", truth.string(), {});
    FAIL() << "accepted";
  } catch (const options::Error& error) {
    EXPECT_THAT(std::string(error.what()),
                testing::AllOf(HasSubstr("recording/dataset.yaml: robots: no robot has"),
                               HasSubstr("nothing to run")));
  }
}

TEST_F(FleetFile, RejectsCameraBelowFloorWithFileAndKey) {
  std::string sensor(kSensor);
  sensor.erase(sensor.find("position_m"));
  write("sensor.yaml", sensor);
  EXPECT_THAT(problemOf(std::string(kRobots) + kCameras),
              testing::AllOf(HasSubstr("sensor.yaml: position_m"), HasSubstr("greater than 0")));
}

}  // namespace
}  // namespace omnifleet::fleet
