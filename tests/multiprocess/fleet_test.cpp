// Runs whole fleets of processes and observes them from outside. Each scenario has its own DDS domain and
// waits for events.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <signal.h>
#include <Eigen/Core>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/multiprocess/live_fleet.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;

/// 2 s plus the end of the launcher. The presets of sanitized builds allow more.
std::chrono::duration<double> stopBudget() {
  const char* within_s = std::getenv("OMNIFLEET_STOP_WITHIN");
  return std::chrono::duration<double>(within_s ? std::stod(within_s) : 2.0) + 1s;
}

TEST(FleetProcesses, LockstepRunEndsByItselfAndSavesMap) {
  const std::string out = freshDir("lockstep");
  Listener listener(61);
  auto hashes = listener.bus().reader(listener.topics().map_hash);
  auto statuses = listener.bus().reader(listener.topics().service_status);
  std::filesystem::create_directories(out + "/trajectories");
  std::ofstream(out + "/trajectories/gone.tum") << "of an earlier run\n";
  Process launch({program("launch"), "run", smallFleet(), "--out", out, "--domain", "61"},
                 out + "/launch.log");
  std::map<std::string, v1::MapHash> last_hash;
  std::set<std::string> seen, finished;
  std::optional<int> code;
  listener.until(
      [&] {
        code = launch.wait(0ms);  // before the last take, so that every earlier sample is taken
        v1::MapHash hash;
        while (hashes->take(hash)) last_hash[hash.replica().to_string()] = hash;
        v1::ServiceStatus status;
        while (statuses->take(status)) {
          seen.insert(nameOf(status));
          if (status.state() == v1::SERVICE_FINISHED) finished.insert(nameOf(status));
        }
        return code.has_value();
      },
      120s);
  ASSERT_TRUE(code.has_value()) << "the run did not end\n" << launch.output();
  EXPECT_EQ(*code, 0) << launch.output();
  EXPECT_EQ(seen, instances(smallFleet())) << "every process must publish its status";
  EXPECT_EQ(finished, seen) << "every process must publish its end";
  ASSERT_EQ(last_hash.size(), 2u) << "one hash per replica";
  EXPECT_EQ(last_hash["r1"].sha256(), last_hash["r2"].sha256()) << "equal contributions must give equal maps";
  EXPECT_GT(last_hash["r1"].contributions(), 2u);
  for (const char* file :
       {"map.bt", "map.pgm", "map.yaml", "map.png", "objects.geojson", "trajectories/r1.tum"}) {
    EXPECT_FALSE(fileText(out + "/" + file).empty()) << file;
  }
  EXPECT_FALSE(nlohmann::json::parse(fileText(out + "/objects.geojson"))["features"].empty());
  EXPECT_FALSE(std::filesystem::exists(out + "/trajectories/gone.tum"));
}

TEST(FleetProcesses, LateSubscriberReceivesMap) {
  LiveFleet fleet("late", 62);
  {
    auto early = fleet.listener.bus().reader(fleet.listener.topics().map_grid);
    v1::Grid grid;
    ASSERT_TRUE(fleet.listener.untilSample<v1::Grid>(
        *early, grid, [](const v1::Grid& g) { return g.width() > 0; }, 60s))
        << fleet.launch.output();
  }
  Listener late(62);
  auto grids = late.bus().reader(late.topics().map_grid);
  auto outlines = late.bus().reader(late.topics().map_outlines);
  auto octrees = late.bus().reader(late.topics().map_octree);
  v1::Grid grid;
  ASSERT_TRUE(late.untilSample<v1::Grid>(
      *grids, grid, [](const v1::Grid& g) { return g.width() > 0; }, 10s));
  EXPECT_EQ(grid.cells().size(), static_cast<std::size_t>(grid.width()) * grid.height());
  EXPECT_THAT(grid.cells(), testing::Contains(0)) << "the map must contain free cells";
  v1::OctreeMap octree;
  ASSERT_TRUE(late.untilSample<v1::OctreeMap>(
      *octrees, octree, [](const v1::OctreeMap&) { return true; }, 10s));
  EXPECT_EQ(std::string(octree.bt().begin(), octree.bt().begin() + 9), "# Octomap");
  v1::Outlines tile;
  ASSERT_TRUE(late.untilSample<v1::Outlines>(
      *outlines, tile, [](const v1::Outlines& t) { return !t.objects().empty(); }, 30s));
}

class StopSignal : public testing::TestWithParam<int> {};

TEST_P(StopSignal, EndsEveryServiceAndLeavesNoFiles) {
  const int domain = GetParam() == SIGINT ? 63 : 64;
  const std::string name = GetParam() == SIGINT ? "sigint" : "sigterm";
  std::vector<pid_t> pids;
  {
    LiveFleet fleet(name, domain);
    auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
    auto poses = fleet.listener.bus().reader(fleet.listener.topics().pose);
    v1::Pose pose;
    ASSERT_TRUE(fleet.listener.untilSample<v1::Pose>(
        *poses, pose, [](const v1::Pose& p) { return p.valid(); }, 60s))
        << fleet.launch.output();
    v1::ServiceStatus status;
    std::set<std::string> seen;
    ASSERT_TRUE(fleet.listener.until(
        [&] {
          while (statuses->take(status)) {
            if (seen.insert(nameOf(status)).second) {
              pids.push_back(static_cast<pid_t>(status.process_id()));
            }
          }
          return seen == instances(smallFleet());
        },
        30s));
    std::size_t files = 0;
    for (const pid_t pid : pids) files += sharedMemoryFilesOf(pid).size();
    EXPECT_GT(files, 0u) << "the frames of this fleet must be in shared memory";
    const auto sent = std::chrono::steady_clock::now();
    fleet.launch.signal(GetParam());
    const auto code =
        fleet.launch.wait(std::chrono::duration_cast<std::chrono::milliseconds>(stopBudget()) + 10s);
    ASSERT_TRUE(code.has_value()) << "still running\n" << fleet.launch.output();
    EXPECT_EQ(*code, 0) << fleet.launch.output();
    EXPECT_LT(std::chrono::steady_clock::now() - sent, stopBudget()) << "includes the end of the launcher";
    EXPECT_FALSE(fileText(fleet.out + "/map.bt").empty()) << "the merger must save the map";
    for (const pid_t pid : pids) EXPECT_FALSE(alive(pid)) << pid;
  }
  for (const pid_t pid : pids) {
    EXPECT_THAT(sharedMemoryFilesOf(pid), testing::IsEmpty()) << "shared memory of frames must be removed";
  }
}
INSTANTIATE_TEST_SUITE_P(Both, StopSignal, testing::Values(SIGINT, SIGTERM),
                         [](const auto& test) { return test.param == SIGINT ? "SIGINT" : "SIGTERM"; });

TEST(FleetProcesses, RestartsKilledServiceAndRunContinues) {
  LiveFleet fleet("killed", 65);
  auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
  auto objects = fleet.listener.bus().reader(fleet.listener.topics().objects, "r1");
  const auto classifier = [](const v1::ServiceStatus& s) {
    return s.service().to_string() == "classifier" && s.instance().to_string() == "r1";
  };
  v1::Objects sample;
  ASSERT_TRUE(fleet.listener.untilSample<v1::Objects>(
      *objects, sample, [](const v1::Objects&) { return true; }, 60s))
      << fleet.launch.output();
  v1::ServiceStatus status;
  ASSERT_TRUE(fleet.listener.untilSample<v1::ServiceStatus>(*statuses, status, classifier, 10s));
  Process second({program("launch"), "run", smallFleet(), "--out", freshDir("second"), "--domain", "65"},
                 fleet.out + "/second.log");
  EXPECT_EQ(second.wait(20s), 2) << "two fleets on one domain would receive each other's data";
  EXPECT_THAT(second.output(), testing::HasSubstr("DDS domain 65"));
  for (const int number :
       {SIGKILL, SIGTERM}) {  // a restart is due in both cases, because no stop was requested
    const auto victim = status.process_id();
    ASSERT_EQ(kill(static_cast<pid_t>(victim), number), 0);
    ASSERT_TRUE(fleet.listener.untilSample<v1::ServiceStatus>(
        *statuses, status,
        [&](const v1::ServiceStatus& s) { return classifier(s) && s.process_id() != victim; }, 20s))
        << fleet.launch.output();
    const auto before = sample.header().acquired_ns();
    ASSERT_TRUE(fleet.listener.untilSample<v1::Objects>(
        *objects, sample,
        [&](const v1::Objects& o) { return o.header().acquired_ns() > before + 1'000'000'000; }, 20s))
        << "the restarted classifier must publish";
  }
  auto poses = fleet.listener.bus().reader(fleet.listener.topics().pose, "r1");
  v1::Pose pose;
  const auto restarted = sample.header().acquired_ns();
  EXPECT_TRUE(fleet.listener.untilSample<v1::Pose>(
      *poses, pose, [&](const v1::Pose& p) { return p.valid() && p.header().acquired_ns() > restarted; },
      20s))
      << "the later stages must continue";

  // A run does not depend on the process that displays its progress.
  const pid_t progress = childNamed(fleet.launch.pid(), "omnifleet_launc");
  ASSERT_GT(progress, 0);
  ASSERT_EQ(kill(progress, SIGKILL), 0);
  const auto killed = pose.header().acquired_ns();
  EXPECT_TRUE(fleet.listener.untilSample<v1::Pose>(
      *poses, pose,
      [&](const v1::Pose& p) { return p.valid() && p.header().acquired_ns() > killed + 500'000'000; }, 20s));
  fleet.launch.signal(SIGINT);
  EXPECT_EQ(fleet.launch.wait(20s), 0) << fleet.launch.output();
  EXPECT_THAT(fleet.launch.output(), testing::HasSubstr("progress display ended by signal 9"));
}

/// A fleet without ceiling cameras, and the poses of its localizer before and after a kill.
class LocalizerRestart {
 public:
  explicit LocalizerRestart(const std::string& name, int domain)
      : fleet_(name, domain, "long", false, fleetWithoutCeiling(name + "_fleet")) {}

  /// Kills the localizer when `ready`. Expects correct poses of both robots from the restarted localizer.
  template <class Ready>
  void killWhen(Ready ready) {
    const auto isReady = [&] {
      takeAll();
      return localizer_ != 0 && ready(*this);
    };
    ASSERT_TRUE(fleet_.listener.until(isReady, 60s)) << fleet_.launch.output();
    const std::int64_t first_process = localizer_;
    ASSERT_EQ(kill(static_cast<pid_t>(first_process), SIGKILL), 0);
    received_.clear();
    const auto receivedFromBoth = [&] {
      takeAll();
      std::map<std::string, int> valid;
      for (const v1::Pose& pose : received_)
        if (pose.term() == 2 && pose.valid()) ++valid[pose.robot().to_string()];
      return valid["r1"] >= 10 && valid["r2"] >= 10;
    };
    ASSERT_TRUE(fleet_.listener.until(receivedFromBoth, 30s)) << fleet_.launch.output();
    EXPECT_NE(localizer_, first_process);
    expectCorrect();
  }
  std::size_t frames() const { return true_m_.size(); }  ///< of all robots
  double driven_m(const std::string& robot) const {
    const auto first = first_m_.find(robot);
    return first == first_m_.end() ? 0.0 : (last_m_.at(robot) - first->second).norm();
  }

 private:
  void takeAll() {
    v1::ServiceStatus status;
    while (statuses_->take(status)) {
      if (nameOf(status) == "localizer ") localizer_ = status.process_id();
    }
    v1::Truth truth;
    while (truths_->take(truth)) {
      const Eigen::Vector2d at_m(truth.map_from_base().x(), truth.map_from_base().y());
      first_m_.try_emplace(truth.robot().to_string(), at_m);
      last_m_[truth.robot().to_string()] = at_m;
      true_m_[{truth.robot().to_string(), truth.header().acquired_ns()}] = at_m;
    }
    v1::Pose pose;
    while (poses_->take(pose)) received_.push_back(pose);
  }
  void expectCorrect() const {
    int compared = 0;
    for (const v1::Pose& pose : received_) {
      const auto truth = true_m_.find({pose.robot().to_string(), pose.header().acquired_ns()});
      if (!pose.valid() || truth == true_m_.end()) continue;
      ++compared;
      const Eigen::Vector2d at_m(pose.map_from_base().x(), pose.map_from_base().y());
      EXPECT_LT((at_m - truth->second).norm(), 0.06) << pose.robot().to_string() << ", term " << pose.term();
    }
    EXPECT_GE(compared, 20);
  }

  LiveFleet fleet_;
  std::unique_ptr<bus::Reader<v1::ServiceStatus>> statuses_ =
      fleet_.listener.bus().reader(fleet_.listener.topics().service_status);
  std::unique_ptr<bus::Reader<v1::Pose>> poses_ = fleet_.listener.bus().reader(fleet_.listener.topics().pose);
  std::unique_ptr<bus::Reader<v1::Truth>> truths_ =
      fleet_.listener.bus().reader(fleet_.listener.topics().world_truth);
  std::map<std::pair<std::string, std::int64_t>, Eigen::Vector2d> true_m_;
  std::map<std::string, Eigen::Vector2d> first_m_, last_m_;
  std::vector<v1::Pose> received_;
  std::int64_t localizer_ = 0;
};

/// The restarted localizer must not publish the initial poses or outdated poses.
TEST(FleetProcesses, RestartedLocalizerPublishesOnlyCorrectPoses) {
  LocalizerRestart restart("localizer_restart", 66);
  // More frames than the history of `objects` holds, so that it does not reach back to the initial poses.
  restart.killWhen([](const LocalizerRestart& run) {
    return run.frames() > 2 * 80 && run.driven_m("r1") > 0.5 && run.driven_m("r2") > 0.5;
  });
}

/// No map exists yet, and the first frames were lost before their readers were matched.
TEST(FleetProcesses, LocalizerRestartedAtOnceUsesInitialPoses) {
  LocalizerRestart restart("localizer_restart_at_once", 67);
  restart.killWhen([](const LocalizerRestart& run) { return run.frames() > 0; });
}

/// The leaders that r1 and r2 report, and the process of r1's formation service.
class Leadership {
 public:
  explicit Leadership(Listener& listener)
      : statuses_(listener.bus().reader(listener.topics().service_status)),
        states_(listener.bus().reader(listener.topics().formation_state)) {}
  /// Takes all arrived samples.
  void takeAll() {
    v1::ServiceStatus status;
    while (statuses_->take(status)) {
      if (status.service() == "formation" && status.instance() == "r1")
        pid = static_cast<pid_t>(status.process_id());
    }
    v1::FormationState state;
    while (states_->take(state)) states[state.robot().to_string()] = state;
  }
  bool follows(const std::string& robot, const std::string& leader) const {
    const auto state = states.find(robot);
    return state != states.end() && state->second.leader() == leader;
  }

  pid_t pid = 0;  ///< of r1's formation service, the latest process
  std::map<std::string, v1::FormationState> states;

 private:
  std::unique_ptr<bus::Reader<v1::ServiceStatus>> statuses_;
  std::unique_ptr<bus::Reader<v1::FormationState>> states_;
};

/// Kills the formation service of the leader repeatedly, so that each restart is delayed further. The other
/// robot becomes leader and drives. The killed robot stops, and follows after its restart.
TEST(FleetProcesses, OtherRobotBecomesLeaderAfterFailure) {
  LiveFleet fleet("leader_failover", 71, "slow_leader");
  Leadership leadership(fleet.listener);
  auto truths = fleet.listener.bus().reader(fleet.listener.topics().world_truth, "r1");
  auto commands = fleet.listener.bus().reader(fleet.listener.topics().wheels_command, "r2");
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        leadership.takeAll();
        return leadership.pid > 0 && leadership.follows("r2", "r1") && leadership.follows("r1", "r1");
      },
      60s))
      << fleet.launch.output();
  std::set<pid_t> killed;
  const auto killAgain = [&] {
    leadership.takeAll();
    if (killed.insert(leadership.pid).second) kill(leadership.pid, SIGKILL);
  };
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        killAgain();
        return leadership.follows("r2", "r2");
      },
      60s))
      << fleet.launch.output();
  EXPECT_GE(leadership.states["r2"].term(), 1u);
  EXPECT_EQ(leadership.states["r2"].role(), v1::FormationRole::ROLE_LEADER);
  v1::Truth truth;
  double x_m = NAN;
  EXPECT_TRUE(fleet.listener.until(
      [&] {
        killAgain();
        bool is_stopped = false;
        while (truths->take(truth)) {
          is_stopped = truth.map_from_base().x() == x_m;
          x_m = truth.map_from_base().x();
        }
        return is_stopped;
      },
      15s))
      << "a robot without commands must stop";
  v1::WheelCommand command;
  EXPECT_TRUE(fleet.listener.untilSample<v1::WheelCommand>(
      *commands, command, [](const v1::WheelCommand& c) { return c.v_left_mps() + c.v_right_mps() > 0.05; },
      20s))
      << "the new leader must drive";
  EXPECT_TRUE(fleet.listener.until(
      [&] {
        leadership.takeAll();
        return leadership.follows("r1", "r2") && leadership.states["r1"].term() >= 1;
      },
      30s))
      << "the restarted robot must follow\n"
      << fleet.launch.output();
  EXPECT_EQ(leadership.states["r1"].role(), v1::FormationRole::ROLE_FOLLOWER);
}

TEST(FleetProcesses, TruthReachesOnlyTheRenderers) {
  LiveFleet fleet("truth", 66);
  auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
  std::set<std::string> running;
  v1::ServiceStatus status;
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        while (statuses->take(status)) running.insert(nameOf(status));
        return running == instances(smallFleet());
      },
      60s))
      << fleet.launch.output();
  // Every reader of the truth in the fleet matches this writer.
  auto truth = fleet.listener.bus().writer(fleet.listener.topics().world_truth, "r1");
  const int cameras = static_cast<int>(std::count_if(
      running.begin(), running.end(), [](const std::string& name) { return name.rfind("camera ", 0) == 0; }));
  ASSERT_GT(cameras, 0);
  EXPECT_TRUE(truth->waitForReaders(cameras, 10s));
  EXPECT_FALSE(truth->waitForReaders(cameras + 1, 2s))
      << "another service than the renderers reads the truth";
}

TEST(FleetProcesses, InvalidOptionStartsNoProcess) {
  const std::string out = freshDir("bad_option");
  Process launch({program("launch"), "run", smallFleet(), "--config",
                  sourceDir() + "/tests/multiprocess/bad.yaml", "--out", out + "/run", "--domain", "67"},
                 out + "/launch.log");
  const auto code = launch.wait(20s);
  ASSERT_TRUE(code.has_value());
  EXPECT_EQ(*code, 2);
  EXPECT_THAT(launch.output(), testing::HasSubstr("bad.yaml:5:"));
  EXPECT_THAT(launch.output(), testing::HasSubstr("services.classifier.no_such_option"));
  const std::string text = launch.output();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
}

TEST(FleetProcesses, CameraThatCannotBeOpenedStartsNoProcess) {
  const std::string out = freshDir("bad_source");
  std::ofstream(out + "/sensor.yaml")
      << "camera_model: fisheye\nprojection: equidistant\nimage_width: 640\nimage_height: 480\n"
         "focal_px: 150\nprincipal_point_px: [319.5, 239.5]\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n";
  // A device may come later.
  const std::map<std::string, std::string> sources{{"folder", "no_such_folder"},
                                                   {"video", "no_such_film.mp4"}};
  for (const auto& [source, path] : sources) {
    std::ofstream(out + "/fleet.yaml")
        << "robots: {r1: {body: {radius_m: 0.15, height_m: 0.3}, wheel_separation_m: 0.26}}\n"
        << "cameras: {r1/fisheye: {source: " << source << ", path: " << path << ", sensor: sensor.yaml}}\n";
    Process launch({program("launch"), "run", out + "/fleet.yaml", "--out", out + "/run", "--domain", "68"},
                   out + "/launch.log");
    EXPECT_EQ(launch.wait(20s), std::optional<int>(2)) << launch.output();
    EXPECT_THAT(launch.output(), testing::HasSubstr("cameras.r1/fisheye"));
    EXPECT_THAT(launch.output(), testing::HasSubstr(path));
    EXPECT_FALSE(std::filesystem::exists(out + "/run/log/camera_r1_fisheye.log")) << "no process may start";
  }
}

}  // namespace
}  // namespace omnifleet::test
