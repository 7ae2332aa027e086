#include "supervisor/schedule.h"

#include <gtest/gtest.h>

#include <fstream>

#include "supervisor/log_tail.h"

namespace omnifleet::supervisor {
namespace {

TEST(Backoff, DoublesDelayOnlyForEarlyFailures) {
  Options options;
  Backoff backoff(options);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(60.0), 0.1);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(60.0), 0.1);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(0.2), 0.1);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(0.2), 0.2);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(0.2), 0.4);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(5.0), 0.1);
  EXPECT_DOUBLE_EQ(backoff.restartDelay(0.2), 0.1);
}

TEST(Backoff, LimitsDelayToCap) {
  Options options;
  Backoff backoff(options);
  double longest = 0.0;
  for (int i = 0; i < 200; ++i) longest = std::max(longest, backoff.restartDelay(0.0));
  EXPECT_DOUBLE_EQ(longest, options.restart_cap_s);
}

TEST(Backoff, CountsConsecutiveEarlyFailures) {
  Backoff backoff{Options()};
  backoff.restartDelay(0.1);
  backoff.restartDelay(0.1);
  EXPECT_EQ(backoff.earlyFailures(), 2);
  backoff.restartDelay(10.0);
  EXPECT_EQ(backoff.earlyFailures(), 0);
}

TEST(LevelDeadline, KeepsHalfOfBudgetForLastLevel) {
  EXPECT_DOUBLE_EQ(levelDeadline(0, 1, 2.0), 2.0);
  EXPECT_DOUBLE_EQ(levelDeadline(0, 2, 2.0), 1.0);
  EXPECT_DOUBLE_EQ(levelDeadline(1, 2, 2.0), 2.0);
  EXPECT_DOUBLE_EQ(levelDeadline(0, 5, 2.0), 0.25);
  EXPECT_DOUBLE_EQ(levelDeadline(3, 5, 2.0), 1.0);
  EXPECT_DOUBLE_EQ(levelDeadline(4, 5, 2.0), 2.0);
}

TEST(LastLines, ReturnsLastLinesOfFile) {
  const std::string path = testing::TempDir() + "last_lines.log";
  {
    std::ofstream file(path);
    for (int i = 0; i < 100000; ++i) file << "line " << i << "\n";
    file << "unfinished";
  }
  const auto lines = lastLines(path, 3);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0], "line 99998");
  EXPECT_EQ(lines[2], "unfinished");
  EXPECT_TRUE(lastLines(path + ".missing", 3).empty());
  EXPECT_TRUE(lastLines(path, 0).empty());
}

TEST(SupervisorOptions, RejectsInvalidValuesAndUnknownKeys) {
  EXPECT_THROW(Options::read(options::Section::parse("stop_budget_s: 0", "t")), options::Error);
  EXPECT_THROW(Options::read(options::Section::parse("no_such: 1", "t")), options::Error);
  EXPECT_DOUBLE_EQ(Options::read(options::Section::parse("young_s: 2.5", "t")).young_s, 2.5);
}

}  // namespace
}  // namespace omnifleet::supervisor
