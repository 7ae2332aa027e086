// One fleet on two machines: two network namespaces with a link between them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <set>

#include "tests/multiprocess/live_fleet.h"
#include "tests/multiprocess/two_machines.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

/// The small arena without ceiling cameras, for two minutes: r1 and the first localizer on pcA, r2 and the
/// simulated world on pcB.
std::string twoMachineFleet(const std::string& name, const std::string& network) {
  const std::string file = fleetWithoutCeiling(name);
  std::ofstream(file) << "name: two_machines\n"
                         "world: {arena: arena.yaml, seed: 1, duration_s: 120, end_at_rest: false}\n"
                         "robots: {r1: {host: pcA}, r2: {host: pcB}}\n"
                         "services: {world: {host: pcB}, localizer: {host: pcA}}\n"
                      << network << "\n";
  return file;
}

class Machines : public testing::Test {
 protected:
  void SetUp() override {
    const std::string obstacle = TwoMachines::obstacle();
    if (!obstacle.empty()) GTEST_SKIP() << obstacle;
    machines_ = std::make_unique<TwoMachines>(TwoMachines::Link::kDirect);
  }

  /// With a listener on one of the machines. pcA starts first and holds the offices.
  void launch(const std::string& name, int domain, const std::string& listen_on,
              const std::string& network = "network: {addresses: [10.77.0.0/24]}") {
    domain_ = domain;
    fleet_ = twoMachineFleet(name + "_fleet", network);
    out_ = freshDir(name);
    launchOn("pcA");
    awaitOfficesOfA();
    launchOn("pcB");
    inside_ = machines_->enter(listen_on);
    listener_ = std::make_unique<Listener>(domain, listen_on == "pcA" ? "10.77.0.1" : "10.77.0.2");
  }
  void launchOn(const std::string& machine) {
    launches_[machine] = std::make_unique<Process>(
        machines_->on(machine, {program("launch"), "run", fleet_, "--host", machine, "--out",
                                out_ + "/" + machine, "--domain", std::to_string(domain_), "--realtime"}),
        out_ + "/" + machine + ".log");
  }
  /// Waits until pcA, alone, estimates and publishes the map.
  void awaitOfficesOfA() const {
    const auto inside = machines_->enter("pcA");
    Listener listener(domain_, "10.77.0.1");
    auto candidacies = listener.bus().reader(listener.topics().election);
    std::set<std::string> held;
    v1::Candidacy candidacy;
    const auto both_held = [&] {
      while (candidacies->take(candidacy))
        if (candidacy.term() == 1) held.insert(candidacy.office().to_string());
      return held.size() == 2;
    };
    if (!listener.until(both_held, 30s)) throw std::runtime_error("pcA does not take the offices");
  }
  std::string output() const {
    return "pcA:\n" + launches_.at("pcA")->output() + "\npcB:\n" + launches_.at("pcB")->output();
  }
  /// Waits until the replicas hold equal maps of at least so many contributions.
  bool untilMapsAgree(std::uint32_t at_least, std::chrono::seconds timeout) {
    return listener_->until(
        [&] {
          takeHashes();
          return latest_["r1"].contributions() >= at_least &&
                 latest_["r1"].sha256() == latest_["r2"].sha256();
        },
        timeout);
  }
  void takeHashes() {
    if (!hashes_) hashes_ = listener_->bus().reader(listener_->topics().map_hash);
    v1::MapHash hash;
    while (hashes_->take(hash)) latest_[hash.replica().to_string()] = hash;
  }
  /// What the replicas hold, for messages.
  std::string held() const {
    std::string text;
    for (const auto& [replica, hash] : latest_)
      text += replica + ": " + std::to_string(hash.contributions()) + " contributions, " +
              std::to_string(hash.keyframe_poses()) + " poses\n";
    return text;
  }

  std::unique_ptr<TwoMachines> machines_;
  int domain_ = 0;
  std::string fleet_, out_;
  std::map<std::string, std::unique_ptr<Process>> launches_;
  std::shared_ptr<void> inside_;
  std::unique_ptr<Listener> listener_;
  std::unique_ptr<bus::Reader<v1::MapHash>> hashes_;
  std::map<std::string, v1::MapHash> latest_;  ///< by replica
};

TEST(MachinesOptions, PartOfFleetWithOnlyLoopbackIsRefused) {
  const std::string fleet = twoMachineFleet("loopback_only_fleet", "");
  const std::string out = freshDir("loopback_only");
  Process launch({program("launch"), "run", fleet, "--host", "pcA", "--out", out, "--domain", "120"},
                 out + "/launch.log");
  EXPECT_EQ(launch.wait(20s), 2) << launch.output();
  EXPECT_THAT(launch.output(), testing::AllOf(testing::HasSubstr("pcA, pcB"), testing::HasSubstr("loopback"),
                                              testing::HasSubstr("network: {interface: NAME}")));
}

/// The cameras of one machine alone deliver 2.6 MB/s.
TEST_F(Machines, ShareOneMapAndFramesStayOnTheirs) {
  ASSERT_TRUE(machines_->multicastPasses());
  launch("two_machines", 121, "pcB");
  ASSERT_TRUE(untilMapsAgree(20, 60s)) << output();
  const std::uint64_t before = machines_->receivedByA();
  const auto begun = steady_clock::now();
  auto poses = listener_->bus().reader(listener_->topics().pose);
  v1::Pose pose;
  int received = 0;
  ASSERT_TRUE(listener_->until(
      [&] {
        while (poses->take(pose)) received += pose.valid() ? 1 : 0;
        return received >= 40;
      },
      30s))
      << output();
  const double bytes_per_s = static_cast<double>(machines_->receivedByA() - before) /
                             std::chrono::duration<double>(steady_clock::now() - begun).count();
  EXPECT_GT(bytes_per_s, 1e3) << "the machines talk to each other";
  EXPECT_LT(bytes_per_s, 0.2 * 480 * 360 * 3 * 5) << "frames leave their machine";
  for (const char* machine : {"pcA", "pcB"}) {
    launches_[machine]->signal(SIGINT);
    EXPECT_EQ(launches_[machine]->wait(30s), 0) << output();
    EXPECT_FALSE(fileText(out_ + "/" + machine + "/map.bt").empty()) << machine << " saves its replica's map";
  }
}

TEST_F(Machines, FindEachOtherByPeersWithoutMulticast) {
  machines_.reset();
  machines_ = std::make_unique<TwoMachines>(TwoMachines::Link::kRouted);
  ASSERT_FALSE(machines_->multicastPasses());
  launch("peers", 122, "pcA", "network: {addresses: [10.77.0.0/24], peers: [10.77.0.1, 10.77.0.2]}");
  ASSERT_TRUE(untilMapsAgree(10, 60s)) << output();
}

/// pcA has the localizer that estimates and the replica that publishes the map.
TEST_F(Machines, OtherOneContinuesWhenOneDiesAndKeepsTheOffices) {
  launch("machine_dies", 123, "pcB");
  ASSERT_TRUE(untilMapsAgree(20, 60s)) << output();
  auto poses = listener_->bus().reader(listener_->topics().pose, "r2");
  auto grids = listener_->bus().reader(listener_->topics().map_grid);
  v1::Pose pose;
  v1::Grid grid;
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *poses, pose, [](const v1::Pose& p) { return p.valid() && p.term() == 1; }, 10s));
  while (grids->take(grid)) EXPECT_EQ(grid.term(), 1u);
  launches_.at("pcA")->signal(SIGKILL);
  const auto killed = steady_clock::now();
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *poses, pose, [](const v1::Pose& p) { return p.valid() && p.term() == 2; }, 10s))
      << output();
  const double silent_s = std::chrono::duration<double>(steady_clock::now() - killed).count();
  RecordProperty("poses_after_ms", static_cast<int>(1e3 * silent_s));
  EXPECT_LT(silent_s, 3.0) << "without load 0.9 s; the lease of a participant is 3 s";
  ASSERT_TRUE(listener_->untilSample<v1::Grid>(
      *grids, grid, [](const v1::Grid& g) { return g.term() == 2; }, 10s))
      << output();

  // pcA returns and stands by.
  launches_.at("pcA")->wait(10s);
  launchOn("pcA");
  auto statuses = listener_->bus().reader(listener_->topics().service_status);
  v1::ServiceStatus status;
  ASSERT_TRUE(listener_->untilSample<v1::ServiceStatus>(
      *statuses, status,
      [](const v1::ServiceStatus& s) { return nameOf(s) == "global_merger r1" && s.processed() > 10; }, 30s))
      << output();
  auto own = listener_->bus().reader(listener_->topics().pose, "r1");
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *own, pose, [](const v1::Pose& p) { return p.valid(); }, 20s))
      << output();
  EXPECT_EQ(pose.term(), 2u) << "the office does not move back";
  while (grids->take(grid)) EXPECT_EQ(grid.term(), 2u);
  launches_["pcB"]->signal(SIGTERM);
  EXPECT_EQ(launches_["pcB"]->wait(30s), 0) << output();
  EXPECT_FALSE(fileText(out_ + "/pcB/map.bt").empty())
      << "the map of all robots is saved on the other machine";
}

/// Both parts go on alone. Afterwards each holds what the other one has mapped.
TEST_F(Machines, MapsAgreeAgainAfterTheLinkWasCut) {
  launch("link_cut", 124, "pcB");
  auto poses = listener_->bus().reader(listener_->topics().pose, "r2");
  v1::Pose pose;
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *poses, pose, [](const v1::Pose& p) { return p.valid(); }, 60s))
      << output();
  takeHashes();
  ASSERT_TRUE(untilMapsAgree(latest_["r2"].contributions() + 10, 60s)) << "with some of r2\n" << output();
  machines_->cut();
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *poses, pose, [](const v1::Pose& p) { return p.valid() && p.term() == 2; }, 10s))
      << "pcB estimates alone\n"
      << output();
  const auto alone = pose.header().acquired_ns();
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *poses, pose,
      [&](const v1::Pose& p) { return p.valid() && p.header().acquired_ns() > alone + 8'000'000'000; }, 30s));
  takeHashes();
  const std::uint32_t held_alone = latest_["r2"].contributions();
  machines_->restore();
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *poses, pose, [](const v1::Pose& p) { return p.valid() && p.term() == 3; }, 20s))
      << "one localizer remains and takes over the robots of both\n"
      << output();
  const auto both_hold_more = [&] {
    takeHashes();
    return latest_["r1"].contributions() > held_alone && latest_["r2"].contributions() > held_alone;
  };
  ASSERT_TRUE(listener_->until(both_hold_more, 60s)) << held() << output();
  auto own = listener_->bus().reader(listener_->topics().pose, "r1");
  ASSERT_TRUE(listener_->untilSample<v1::Pose>(
      *own, pose, [](const v1::Pose& p) { return p.valid() && p.term() == 3; }, 20s))
      << output();
  // While both map, their hashes are those of different times. Saved maps are those of the same set.
  for (const auto& [machine, running] : launches_) running->signal(SIGINT);
  for (const auto& [machine, running] : launches_) EXPECT_EQ(running->wait(30s), 0) << output();
  const std::string map = fileText(out_ + "/pcA/map.bt");
  EXPECT_FALSE(map.empty());
  EXPECT_TRUE(map == fileText(out_ + "/pcB/map.bt")) << "the gap is filled on both machines\n" << output();
}

}  // namespace
}  // namespace omnifleet::test
