// However a live fleet is stopped, it saves its map and ends with exit code 0 within a bounded time.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <set>

#include "tests/multiprocess/live_fleet.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;

/// Waits until the merger of r1 has a map to save. Returns the process numbers of all services.
std::set<pid_t> untilMapped(Listener& listener) {
  auto statuses = listener.bus().reader(listener.topics().service_status);
  auto hashes = listener.bus().reader(listener.topics().map_hash);
  std::set<std::string> names;
  std::set<pid_t> pids;
  bool mapped = false;
  v1::ServiceStatus status;
  v1::MapHash hash;
  const bool ready = listener.until(
      [&] {
        while (statuses->take(status)) {
          if (status.service() == "launch") continue;
          if (names.insert(nameOf(status)).second) pids.insert(static_cast<pid_t>(status.process_id()));
        }
        while (hashes->take(hash)) mapped |= hash.replica() == "r1" && hash.contributions() > 0;
        return mapped && names.size() + 1 == instances(smallFleet()).size();
      },
      60s);
  EXPECT_TRUE(ready) << "the fleet did not start";
  return pids;
}

bool hasMap(const std::string& out) {
  return !fileText(out + "/map.bt").empty() && !fileText(out + "/objects.geojson").empty();
}

/// A terminal that is closed.
TEST(Stopping, HangupSavesMap) {
  LiveFleet fleet("hangup", 110);
  untilMapped(fleet.listener);
  fleet.launch.signal(SIGHUP);
  EXPECT_EQ(fleet.launch.wait(20s), 0) << fleet.launch.output();
  EXPECT_TRUE(hasMap(fleet.out));
}

/// systemd sends SIGTERM, and if asked SIGHUP after it, to every process of a unit.
TEST(Stopping, TermAndHangupToAllProcessesSaveMap) {
  LiveFleet fleet("term_to_all", 111);
  const std::set<pid_t> pids = untilMapped(fleet.listener);
  for (const pid_t pid : pids) kill(pid, SIGTERM);
  fleet.launch.signal(SIGTERM);
  for (const pid_t pid : pids) kill(pid, SIGHUP);
  fleet.launch.signal(SIGHUP);
  EXPECT_EQ(fleet.launch.wait(20s), 0) << fleet.launch.output();
  EXPECT_THAT(fleet.launch.output(), testing::Not(testing::HasSubstr(", restart in")));
  EXPECT_TRUE(hasMap(fleet.out));
}

/// The first process of a pipeline must outlive the others: `launch.sh … 2>&1 | head -1`.
TEST(Stopping, ReaderOfOutputThatIsGoneDoesNotEndFleet) {
  const std::string out = freshDir("unread_output");
  std::string words;
  for (const std::string& word : LiveFleet::command(out, 112, "long", false, smallFleet()))
    words += "'" + word + "' ";
  Process shell({"/bin/sh", "-c", words + "2>&1 | head -1; :"}, out + "/shell.log");
  Listener listener(112);
  untilMapped(listener);
  const pid_t launch = childNamed(shell.pid(), "omnifleet_launc");
  ASSERT_GT(launch, 0);
  EXPECT_EQ(childNamed(shell.pid(), "head"), 0) << "nobody reads the output";
  kill(launch, SIGTERM);
  EXPECT_EQ(shell.wait(20s), 0) << shell.output();
  EXPECT_TRUE(hasMap(out));
}

/// A deadlock between discovery and a timer in Fast DDS 2.9 once kept the launcher for 11 minutes.
TEST(Stopping, HangingProgressDisplayIsEnded) {
  LiveFleet fleet("hanging_progress", 113);
  untilMapped(fleet.listener);
  const pid_t progress = childNamed(fleet.launch.pid(), "omnifleet_launc");
  ASSERT_GT(progress, 0);
  kill(progress, SIGSTOP);
  fleet.launch.signal(SIGINT);
  EXPECT_EQ(fleet.launch.wait(30s), 0) << fleet.launch.output();
  EXPECT_THAT(fleet.launch.output(), testing::HasSubstr("the progress display did not end and was killed"));
  EXPECT_TRUE(hasMap(fleet.out));
}

}  // namespace
}  // namespace omnifleet::test
