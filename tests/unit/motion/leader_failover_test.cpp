#include "motion/leader_failover.h"

#include <gtest/gtest.h>

#include <memory>

namespace omnifleet::motion {
namespace {

constexpr TimeNs kPeriod = 200'000'000;

/// Robots that receive each other's states one frame late, as on the bus.
class Fleet {
 public:
  explicit Fleet(int robots) {
    for (int i = 1; i <= robots; ++i) order_.push_back("r" + std::to_string(i));
    for (const std::string& robot : order_) start(robot);
  }
  void start(const std::string& robot) {
    members_[robot] = std::make_unique<LeaderFailover>(LeaderFailover::Options{}, robot, order_);
  }
  void lose(const std::string& robot) { members_.erase(robot); }
  void run(int frames) {
    for (int i = 0; i < frames; ++i) {
      now_ns_ += kPeriod;
      std::vector<FormationState> published;
      for (auto& [robot, member] : members_) {
        for (const FormationState& state : published_) member->receive(state);
        member->settle(now_ns_);
        FormationState state;
        state.robot = robot;
        state.acquired_ns = now_ns_;
        state.leader = member->leader();
        state.term = member->term();
        published.push_back(state);
      }
      published_ = published;
    }
  }
  const LeaderFailover& operator[](const std::string& robot) const { return *members_.at(robot); }
  /// The leader if all robots agree; otherwise empty.
  std::string leader() const {
    for (const auto& [robot, member] : members_) {
      if (member->leader() != members_.begin()->second->leader()) return {};
    }
    return members_.begin()->second->leader();
  }

 private:
  std::vector<std::string> order_;
  std::map<std::string, std::unique_ptr<LeaderFailover>> members_;
  std::vector<FormationState> published_;
  TimeNs now_ns_ = 1'000'000'000;
};

TEST(LeaderFailover, KeepsLeaderWhileAllRobotsPublish) {
  Fleet fleet(3);
  fleet.run(50);
  EXPECT_EQ(fleet.leader(), "r1");
  EXPECT_EQ(fleet["r3"].ranks(), (std::vector<std::string>{"r1", "r2", "r3"}));
}

TEST(LeaderFailover, ElectsNextInOrderWhenLeaderIsLost) {
  Fleet fleet(4);
  fleet.run(10);
  fleet.lose("r1");
  fleet.run(9);
  EXPECT_EQ(fleet.leader(), "r1") << "silent for less than two seconds";
  fleet.run(5);
  EXPECT_EQ(fleet.leader(), "r2");
  EXPECT_EQ(fleet["r4"].ranks(), (std::vector<std::string>{"r2", "r3", "r4"}));
  EXPECT_EQ(fleet["r4"].term(), 1u);
}

TEST(LeaderFailover, MakesReturningLeaderFollow) {
  Fleet fleet(3);
  fleet.run(10);
  fleet.lose("r1");
  fleet.run(20);
  fleet.start("r1");  // a new process that starts as leader
  fleet.run(2);
  EXPECT_EQ(fleet.leader(), "r2");
  EXPECT_EQ(fleet["r1"].ranks(), (std::vector<std::string>{"r2", "r1", "r3"}));
  EXPECT_EQ(fleet["r3"].ranks(), (std::vector<std::string>{"r2", "r1", "r3"}));
}

TEST(LeaderFailover, KeepsLeaderThatReturnsWithinTimeout) {
  Fleet fleet(3);
  fleet.run(10);
  fleet.lose("r1");
  fleet.run(5);
  fleet.start("r1");
  fleet.run(30);
  EXPECT_EQ(fleet.leader(), "r1");
  EXPECT_EQ(fleet["r2"].term(), 0u);
}

TEST(LeaderFailover, RemovesSilentFollowerFromRanks) {
  Fleet fleet(3);
  fleet.run(5);
  fleet.lose("r2");
  fleet.run(15);
  EXPECT_EQ(fleet.leader(), "r1");
  EXPECT_EQ(fleet["r3"].ranks(), (std::vector<std::string>{"r1", "r3"}));
}

TEST(LeaderFailover, IgnoresUnlistedRobotsAndOldStates) {
  LeaderFailover leader_failover({}, "r2", {"r1", "r2"});
  FormationState state;
  state.robot = state.leader = "r9";
  state.term = 7;
  state.acquired_ns = 1'000'000'000;
  leader_failover.receive(state);
  leader_failover.settle(1'000'000'000);
  EXPECT_EQ(leader_failover.leader(), "r1");
  state.robot = state.leader = "r1";
  state.term = 2;
  state.acquired_ns = 900'000'000;
  leader_failover.receive(state);
  state.term = 1;
  state.acquired_ns = 800'000'000;
  leader_failover.receive(state);
  leader_failover.settle(1'000'000'000);
  EXPECT_EQ(leader_failover.term(), 2u);
}

}  // namespace
}  // namespace omnifleet::motion
