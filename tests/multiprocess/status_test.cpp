// What people see of a fleet by omnifleet_status. Each scenario has its own DDS domain and waits for events.

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

/// One look at a fleet, from a process of its own.
struct Look {
  Look(int domain, const std::string& log) {
    Process status({program("status"), "--once", "--domain", std::to_string(domain)}, log);
    code = status.wait(20s);
    text = status.output();
  }
  std::string lineOf(const std::string& who) const {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind(who + " ", 0) == 0) return line;
    }
    return {};
  }
  /// Named as nameOf() does.
  std::set<std::string> running() const {
    std::istringstream lines(text);
    std::set<std::string> names;
    for (std::string line; std::getline(lines, line);) {
      if (line.find("  running") == std::string::npos) continue;
      std::string who = line.substr(0, line.find("  "));
      if (who.find(' ') == std::string::npos) who += " ";
      names.insert(who);
    }
    return names;
  }
  std::optional<int> code;
  std::string text;
};

/// Looks until it is as wanted, as people do: on a busy machine one look may be too short to hear everybody.
Look lookUntil(int domain, const std::string& log, const std::function<bool(const Look&)>& wanted) {
  const auto end = std::chrono::steady_clock::now() + 60s;
  Look look(domain, log);
  while (!wanted(look) && std::chrono::steady_clock::now() < end) look = Look(domain, log);
  return look;
}

/// What people see of a running fleet: everybody, at work.
TEST(Status, ShowsEveryServiceAtWork) {
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
  const Look look =
      lookUntil(69, fleet.out + "/status.txt", [&](const Look& l) { return l.running() == expected; });
  EXPECT_EQ(look.code, std::optional<int>(0)) << look.text;
  EXPECT_EQ(look.running(), expected) << look.text;
}

TEST(Status, SaysWhereThereIsNoFleet) {
  Process status({program("status"), "--once", "--wait", "0.3", "--domain", "70"},
                 freshDir("no_fleet") + "/out");
  EXPECT_EQ(status.wait(20s), std::optional<int>(1));
  EXPECT_THAT(status.output(), HasSubstr("no fleet on domain 70"));
}

/// A process that hangs cannot say so: who watches names it, who comes later learns it from the launcher. In
/// lockstep, where nobody takes a process of a busy machine for dead before half a minute is over.
TEST(Status, NamesAServiceThatHangsUntilItGoesOn) {
  constexpr int kDomain = 82;
  LiveFleet fleet("hung", kDomain, "long", true);
  auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
  std::map<std::string, v1::ServiceStatus> last;
  const auto hear = [&] {
    v1::ServiceStatus s;
    while (statuses->take(s)) last[nameOf(s)] = s;
  };
  const std::string who = "classifier r1";
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        hear();
        return last.count(who) > 0 && last[who].processed() > 0 && last.count("launch ") > 0;
      },
      60s))
      << fleet.launch.output();
  Process watching({program("status"), "--domain", std::to_string(kDomain)}, fleet.out + "/watching.txt");
  ASSERT_TRUE(fleet.listener.until([&] { return watching.output().find(who) != std::string::npos; }, 20s));
  const auto hung = static_cast<pid_t>(last[who].process_id());
  ASSERT_GT(hung, 0);
  ASSERT_EQ(kill(hung, SIGSTOP), 0);
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        hear();
        return last["launch "].last_error().to_string().find(who + " silent for ") != std::string::npos;
      },
      30s))
      << fleet.launch.output();
  EXPECT_EQ(last["launch "].state(), v1::SERVICE_DEGRADED);
  EXPECT_TRUE(
      fleet.listener.until([&] { return watching.output().find("silent for ") != std::string::npos; }, 20s))
      << "who has seen it speak";
  const Look late = lookUntil(kDomain, fleet.out + "/hung.txt", [](const Look& l) {
    return !l.lineOf("launch").empty() && !l.lineOf("world").empty();
  });
  EXPECT_EQ(late.code, std::optional<int>(3)) << late.text;
  EXPECT_THAT(late.lineOf("launch"), HasSubstr(who + " silent for ")) << late.text;
  EXPECT_THAT(late.lineOf("world"), HasSubstr("running")) << late.text;

  ASSERT_EQ(kill(hung, SIGCONT), 0);
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        hear();
        return last["launch "].last_error().to_string().find(who) == std::string::npos;
      },
      60s))
      << fleet.launch.output();
  const Look after = lookUntil(kDomain, fleet.out + "/going_on.txt", [&](const Look& l) {
    return l.code == std::optional<int>(0) && !l.lineOf("launch").empty() && !l.lineOf(who).empty();
  });
  EXPECT_EQ(after.code, std::optional<int>(0)) << after.text;
  EXPECT_THAT(after.lineOf(who), HasSubstr("running")) << after.text;
  EXPECT_THAT(fleet.launch.output(), HasSubstr(who + ": silent for "));
  EXPECT_THAT(fleet.launch.output(), HasSubstr(who + ": speaks again"));
}

}  // namespace
}  // namespace omnifleet::test
