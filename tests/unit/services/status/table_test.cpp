#include "status/table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace omnifleet::status {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

v1::ServiceStatus sample(const std::string& service, const std::string& instance, v1::ServiceState state,
                         const std::string& error = {}) {
  v1::ServiceStatus s;
  s.service(service);
  s.instance(instance);
  s.state(state);
  s.last_error(error);
  return s;
}

class StatusTable : public testing::Test {
 protected:
  void put(const v1::ServiceStatus& s) { table_.put(s, now_); }
  /// Updates the table five times per second, as the program does.
  void wait(milliseconds time) {
    for (const auto end = now_ + time; now_ < end; table_.update(now_)) now_ += milliseconds(200);
  }
  std::string lineOf(const std::string& name) const {
    std::istringstream lines(table_.text());
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind(name + " ", 0) == 0) return line;
    }
    return {};
  }

  Table::Clock::time_point now_{seconds(1000)};
  Table table_;
};

TEST_F(StatusTable, ShowsSilentServiceWithDuration) {
  put(sample("classifier", "r1", v1::SERVICE_RUNNING, "a sample out of order was rejected"));
  put(sample("world", "", v1::SERVICE_RUNNING));
  wait(seconds(2));
  put(sample("world", "", v1::SERVICE_RUNNING));
  EXPECT_THAT(lineOf("classifier r1"), HasSubstr("  running"));
  EXPECT_FALSE(table_.anySilent());
  wait(seconds(2));
  EXPECT_THAT(lineOf("classifier r1"),
              AllOf(HasSubstr("  silent"), HasSubstr("silent for 4 s; before: a sample out of order")));
  EXPECT_THAT(lineOf("world"), AllOf(HasSubstr("  running"), Not(HasSubstr("silent"))));
  EXPECT_TRUE(table_.anySilent());
  put(sample("classifier", "r1", v1::SERVICE_RUNNING));
  put(sample("world", "", v1::SERVICE_RUNNING));
  wait(milliseconds(200));
  EXPECT_THAT(lineOf("classifier r1"), HasSubstr("  running"));
  EXPECT_FALSE(table_.anySilent()) << "it publishes its status again";
}

TEST_F(StatusTable, FinishedServiceIsNotSilent) {
  put(sample("world", "", v1::SERVICE_FINISHED));
  wait(seconds(60));
  EXPECT_THAT(lineOf("world"), HasSubstr("  finished"));
  EXPECT_FALSE(table_.anySilent());
}

TEST_F(StatusTable, CountsServiceThatLauncherReportsAsSilent) {
  put(sample("launch", "", v1::SERVICE_DEGRADED, "classifier r1 silent for 40 s"));
  put(sample("localizer", "", v1::SERVICE_DEGRADED, "r1 slips"));
  EXPECT_TRUE(table_.anySilent());
  EXPECT_THAT(lineOf("launch"), HasSubstr("classifier r1 silent for 40 s"));
  put(sample("launch", "", v1::SERVICE_RUNNING));
  EXPECT_FALSE(table_.anySilent()) << "the error of another service is no silence";
}

v1::FormationState state(const std::string& robot, const std::string& leader, std::uint32_t term) {
  v1::FormationState s;
  s.robot(robot);
  s.leader(leader);
  s.term(term);
  return s;
}

TEST_F(StatusTable, SumsTrafficOfEachRobot) {
  const auto withTraffic = [](v1::ServiceStatus s, double out_per_s, double in_per_s) {
    s.bytes_out_per_s(out_per_s);
    s.bytes_in_per_s(in_per_s);
    return s;
  };
  put(sample("global_merger", "r1", v1::SERVICE_RUNNING));
  EXPECT_EQ(lineOf("to"), "");
  put(withTraffic(sample("global_merger", "r1", v1::SERVICE_RUNNING), 20000, 41000));
  put(withTraffic(sample("formation", "r1", v1::SERVICE_RUNNING), 1500, 0));
  put(withTraffic(sample("global_merger", "r2", v1::SERVICE_RUNNING), 7000, 0));
  put(withTraffic(sample("global_merger", "r2@host:4711", v1::SERVICE_DEGRADED), 200, 0));
  put(withTraffic(sample("localizer", "", v1::SERVICE_RUNNING), 2500, 0));
  put(withTraffic(sample("classifier", "r2", v1::SERVICE_FINISHED), 9000, 0));
  EXPECT_EQ(lineOf("to"), "to other hosts, kB/s: r1 21.5, r2 7.2, others 2.5");
  EXPECT_THAT(lineOf("global_merger r1"), HasSubstr(" 20.0     41.0  "));
}

TEST_F(StatusTable, ShowsLeaderAndRobotsThatFollowAnother) {
  put(sample("world", "", v1::SERVICE_RUNNING));
  EXPECT_EQ(lineOf("leader:"), "") << "a fleet without a formation";
  for (const char* robot : {"r1", "r2", "r3"}) table_.put(state(robot, "r1", 0));
  EXPECT_EQ(lineOf("leader:"), "leader: r1 (term 0)");
  table_.put(state("r2", "r2", 1));
  table_.put(state("r3", "r2", 1));
  EXPECT_EQ(lineOf("leader:"), "leader: r2 (term 1); r1 last followed r1 (term 0)");
  table_.put(state("r1", "r2", 1));
  EXPECT_EQ(lineOf("leader:"), "leader: r2 (term 1)");
}

}  // namespace
}  // namespace omnifleet::status
