// The output of omnifleet_status for a fleet. Each scenario has its own DDS domain and waits for events.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <signal.h>
#include <functional>
#include <map>
#include <sstream>

#include "tests/multiprocess/live_fleet.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// One table of `omnifleet_status --once`, run as a process.
struct StatusOutput {
  StatusOutput(int domain, const std::string& log) {
    Process status({program("status"), "--once", "--domain", std::to_string(domain)}, log);
    code = status.wait(20s);
    text = status.output();
  }
  std::string lineOf(const std::string& name) const {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind(name + " ", 0) == 0) return line;
    }
    return {};
  }
  /// Names as nameOf() returns them.
  std::set<std::string> running() const {
    std::istringstream lines(text);
    std::set<std::string> names;
    for (std::string line; std::getline(lines, line);) {
      if (line.find("  running") == std::string::npos) continue;
      std::string name = line.substr(0, line.find("  "));
      if (name.find(' ') == std::string::npos) name += " ";
      names.insert(name);
    }
    return names;
  }
  std::optional<int> code;
  std::string text;
};

/// Repeats the table until it is as `wanted`: on a busy machine one run may be too short to receive every
/// status.
StatusOutput statusUntil(int domain, const std::string& log,
                         const std::function<bool(const StatusOutput&)>& wanted) {
  const auto end = std::chrono::steady_clock::now() + 60s;
  StatusOutput output(domain, log);
  while (!wanted(output) && std::chrono::steady_clock::now() < end) output = StatusOutput(domain, log);
  return output;
}

TEST(Status, ShowsEveryRunningService) {
  LiveFleet fleet("status", 69);
  auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
  std::set<std::string> running;
  const auto expected = instances(smallFleet());
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        v1::ServiceStatus s;
        while (statuses->take(s)) {
          if (s.processed() > 0 || s.service() == "world" || s.service() == "launch")
            running.insert(nameOf(s));
        }
        return running == expected;
      },
      30s));
  const StatusOutput output = statusUntil(69, fleet.out + "/status.txt",
                                          [&](const StatusOutput& l) { return l.running() == expected; });
  EXPECT_EQ(output.code, std::optional<int>(0)) << output.text;
  EXPECT_EQ(output.running(), expected) << output.text;
}

TEST(Status, ReportsMissingFleet) {
  Process status({program("status"), "--once", "--wait", "0.3", "--domain", "70"},
                 freshDir("no_fleet") + "/out");
  EXPECT_EQ(status.wait(20s), std::optional<int>(1));
  EXPECT_THAT(status.output(), HasSubstr("no fleet found on DDS domain 70"));
}

/// A hung process cannot report itself. A running status table detects it, and a late one shows what the
/// launcher reports. Uses lockstep, in which a busy machine has half a minute before a process is considered
/// lost.
TEST(Status, NamesHungServiceUntilItContinues) {
  constexpr int kDomain = 82;
  LiveFleet fleet("hung", kDomain, "long", true);
  auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
  std::map<std::string, v1::ServiceStatus> last;
  const auto takeAll = [&] {
    v1::ServiceStatus s;
    while (statuses->take(s)) last[nameOf(s)] = s;
  };
  const std::string name = "classifier r1";
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        takeAll();
        return last.count(name) > 0 && last[name].processed() > 0 && last.count("launch ") > 0;
      },
      60s))
      << fleet.launch.output();
  Process watching({program("status"), "--domain", std::to_string(kDomain)}, fleet.out + "/watching.txt");
  ASSERT_TRUE(fleet.listener.until([&] { return watching.output().find(name) != std::string::npos; }, 20s));
  const auto hung = static_cast<pid_t>(last[name].process_id());
  ASSERT_GT(hung, 0);
  ASSERT_EQ(kill(hung, SIGSTOP), 0);
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        takeAll();
        return last["launch "].last_error().to_string().find(name + " silent for ") != std::string::npos;
      },
      30s))
      << fleet.launch.output();
  EXPECT_EQ(last["launch "].state(), v1::SERVICE_DEGRADED);
  EXPECT_TRUE(
      fleet.listener.until([&] { return watching.output().find("silent for ") != std::string::npos; }, 20s))
      << "the running table has received its status before";
  const StatusOutput late = statusUntil(kDomain, fleet.out + "/hung.txt", [](const StatusOutput& l) {
    return !l.lineOf("launch").empty() && !l.lineOf("world").empty();
  });
  EXPECT_EQ(late.code, std::optional<int>(3)) << late.text;
  EXPECT_THAT(late.lineOf("launch"), HasSubstr(name + " silent for ")) << late.text;
  EXPECT_THAT(late.lineOf("world"), HasSubstr("running")) << late.text;

  ASSERT_EQ(kill(hung, SIGCONT), 0);
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        takeAll();
        return last["launch "].last_error().to_string().find(name) == std::string::npos;
      },
      60s))
      << fleet.launch.output();
  const StatusOutput after = statusUntil(kDomain, fleet.out + "/going_on.txt", [&](const StatusOutput& l) {
    return l.code == std::optional<int>(0) && !l.lineOf("launch").empty() && !l.lineOf(name).empty();
  });
  EXPECT_EQ(after.code, std::optional<int>(0)) << after.text;
  EXPECT_THAT(after.lineOf(name), HasSubstr("running")) << after.text;
  EXPECT_THAT(fleet.launch.output(), HasSubstr(name + ": silent for "));
  EXPECT_THAT(fleet.launch.output(), HasSubstr(name + ": publishes its status again"));
}

}  // namespace
}  // namespace omnifleet::test
