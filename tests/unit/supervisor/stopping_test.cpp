// How a run stops: which signals, sent to whom, and what happens to processes that do not end.

#include "tests/unit/supervisor/supervisor_fixture.h"

#include <csignal>

namespace omnifleet::supervisor {
namespace {

using StopTest = SupervisorTest;

TEST_F(StopTest, StopsUpstreamFirst) {
  for (const int number : {SIGHUP, SIGINT, SIGTERM}) {
    fs::remove(folder_ + "/order");
    // The signal is sent only after each process has set its trap and printed "up" to its log.
    std::vector<ProcessSpec> processes{service("merger", 2), service("camera", 0), service("mapper", 1)};
    auto last = shell("signal",
                      "until grep -q up $D/log/merger.log && grep -q up $D/log/camera.log && "
                      "grep -q up $D/log/mapper.log; do :; done; kill -" +
                          std::to_string(number) + " $PPID; exit 0");
    processes.push_back(last);
    RunReport report;
    EXPECT_LT(secondsOf([&] { report = Supervisor({}).run(processes); }), 2.0);
    EXPECT_EQ(report.reason, EndReason::kSignal);
    EXPECT_EQ(report.signal, number);
    EXPECT_EQ(report.exit_code(), 0);
    EXPECT_EQ(read(folder_ + "/order"), "camera\nmapper\nmerger\n");
    fs::remove_all(folder_ + "/log");
  }
}

TEST_F(StopTest, KillsAndReportsProcessThatDoesNotEnd) {
  const auto stubborn = shell("stubborn", "trap '' TERM INT; echo stubborn up; " + std::string(kForever), 0);
  auto ready = shell("signal",
                     "until grep -q up $D/log/stubborn.log && grep -q up $D/log/merger.log; do :; done; "
                     "kill -INT $PPID; exit 0",
                     0);
  Options options;
  options.stop_budget_s = 0.4;
  RunReport report;
  const double took = secondsOf([&] {
    report = Supervisor(options).run({stubborn, service("merger", 1), ready});
  });
  EXPECT_LT(took, 2.0);
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].name, "stubborn");
  EXPECT_EQ(report.failures[0].how, "did not end within 0.4 s, killed");
  ASSERT_EQ(report.failures[0].last_lines.size(), 1U);
  EXPECT_EQ(report.failures[0].last_lines[0], "stubborn up");
  EXPECT_EQ(read(folder_ + "/order"), "merger\n")
      << "the merger must have its time to end although the camera hangs";
  EXPECT_EQ(report.exit_code(), 1);
}

/// The sink saves the map and must not be killed with the other processes when the machine is busy.
TEST_F(StopTest, SinkHasGraceTimeBeyondBudget) {
  Options options;
  options.stop_budget_s = 0.2;
  options.sink_grace_s = 20.0;
  // The sink ends only after the kill of the process "stubborn", which is later than the budget.
  auto stubborn = shell("stubborn", "trap '' TERM; echo $$ > $D/pid; " + std::string(kForever), 0);
  auto sink = shell("sink",
                    "trap 'while kill -0 $(cat $D/pid) 2>/dev/null; do sleep 0.01; done; "
                    "echo saved > $D/map; exit 0' TERM; echo up; " +
                        std::string(kForever),
                    1);
  sink.sink = true;
  auto ready = shell(
      "signal", "until [ -s $D/pid ] && grep -q up $D/log/sink.log; do :; done; kill -INT $PPID; exit 0", 0);
  const RunReport report = Supervisor(options).run({stubborn, sink, ready});
  ASSERT_EQ(report.failures.size(), 1u);
  EXPECT_EQ(report.failures[0].name, "stubborn");
  EXPECT_EQ(read(folder_ + "/map"), "saved\n");
}

TEST_F(StopTest, TreatsTwoSignalsOfOneKeyPressAsOne) {
  auto ready =
      shell("signal",
            "until grep -q up $D/log/merger.log; do :; done; kill -INT $PPID; kill -TERM $PPID; exit 0", 0);
  const RunReport report = Supervisor({}).run({service("merger", 1, "echo saved > $D/map; "), ready});
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_EQ(read(folder_ + "/map"), "saved\n");
}

TEST_F(StopTest, SecondKeyPressKillsAtOnce) {
  const auto stubborn = shell("stubborn", "trap 'kill -INT $PPID' TERM; echo up; " + std::string(kForever));
  const auto ready =
      shell("signal", "until grep -q up $D/log/stubborn.log; do :; done; kill -INT $PPID; exit 0");
  Options options;
  options.stop_budget_s = 50.0;
  options.one_press_s = 0.0;
  RunReport report;
  EXPECT_LT(secondsOf([&] { report = Supervisor(options).run({stubborn, ready}); }), 10.0);
  ASSERT_FALSE(report.failures.empty());  // the process that signals may be among them
  EXPECT_EQ(report.failures[0].name, "stubborn");
  EXPECT_EQ(report.failures[0].how, "killed at once on a second signal");
}

/// Service managers and terminals send several signals; the sinks must still have their time to save.
TEST_F(StopTest, LaterTermAndHangupDoNotKill) {
  Options options;
  options.one_press_s = 0.0;
  options.stop_budget_s = 20.0;
  const std::string more = "kill -TERM $PPID; kill -HUP $PPID; echo saved > $D/map; ";
  const auto ready =
      shell("signal", "until grep -q up $D/log/merger.log; do :; done; kill -HUP $PPID; exit 0");
  const auto report = Supervisor(options).run({service("merger", 1, more), ready});
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_EQ(report.signal, SIGHUP);
  EXPECT_EQ(read(folder_ + "/map"), "saved\n");
}

/// As services end: 128 + signal number.
std::string endingAfterSignal(const std::string& name, int number) {
  const std::string at = std::to_string(number);
  return "trap 'echo " + name + " >> $D/order; exit " + std::to_string(128 + number) + "' " + at +
         "; echo up; while :; do sleep 1000 & wait; done";
}

/// systemd's stop: every process gets the signal, the supervisor perhaps as the last one.
TEST_F(StopTest, SignalToAllProcessesIsAStop) {
  for (const bool includes_supervisor : {true, false}) {
    for (const auto policy : {RestartPolicy::kOnFailure, RestartPolicy::kNever}) {
      fs::remove_all(folder_ + "/log");
      std::vector<ProcessSpec> processes{shell("a", endingAfterSignal("a", SIGTERM)),
                                         shell("b", endingAfterSignal("b", SIGTERM), 1)};
      for (ProcessSpec& spec : processes) spec.restart = policy;
      std::vector<pid_t> pids;
      Callbacks callbacks;
      callbacks.on_start = [&](const std::string& name, pid_t pid) {
        if (name != "signal") pids.push_back(pid);
        std::ofstream(folder_ + "/pids") << (pids.size() == 2 ? "" : "x");
        if (pids.size() == 2) std::ofstream(folder_ + "/pids") << pids[0] << " " << pids[1];
      };
      processes.push_back(shell("signal",
                                "until grep -q up $D/log/a.log && grep -q up $D/log/b.log; do :; done; "
                                "kill -TERM $(cat $D/pids)" +
                                    std::string(includes_supervisor ? " $PPID" : "") + "; exit 0",
                                -1));
      const auto report = Supervisor({}).run(processes, callbacks);
      EXPECT_EQ(report.reason, EndReason::kSignal);
      EXPECT_EQ(report.signal, SIGTERM);
      EXPECT_EQ(report.exit_code(), 0);
    }
  }
}

TEST_F(StopTest, OneProcessThatASignalEndedIsRestartedOrStopsTheRunOrFails) {
  auto victim = shell("victim", "[ -e $D/second ] && exit 0; touch $D/second; kill -TERM $$; sleep 1000");
  victim.sink = true;
  const auto restarted = Supervisor({}).run({victim, service("other", 1)});
  EXPECT_EQ(restarted.restarts, 1);
  EXPECT_EQ(restarted.reason, EndReason::kSinksDone);
  fs::remove(folder_ + "/second");
  victim.restart = RestartPolicy::kNever;
  victim.stops_run = true;
  const auto stopped = Supervisor({}).run({victim, service("other", 1)});
  EXPECT_EQ(stopped.reason, EndReason::kSignal);
  EXPECT_EQ(stopped.exit_code(), 0);
  fs::remove(folder_ + "/second");
  victim.stops_run = false;
  const auto failed = Supervisor({}).run({victim, service("other", 1)});
  EXPECT_EQ(failed.reason, EndReason::kFailure);
  ASSERT_EQ(failed.failures.size(), 1u);
  EXPECT_EQ(failed.failures[0].how, "killed by signal 15 (Terminated)");
}

/// A merger without a map may exit a moment before the cameras do.
TEST_F(StopTest, SinkThatFailsShortlyBeforeTheSourcesEndIsNotRestarted) {
  auto source = shell("source", "until [ -e $D/failed ]; do sleep 0.01; done; sleep 0.1; exit 0", 0);
  auto sink = shell("sink", "echo started >> $D/starts; touch $D/failed; exit 1", 1);
  sink.sink = true;
  const RunReport report = Supervisor({}).run({source, sink});
  EXPECT_EQ(report.exit_code(), 1);
  ASSERT_EQ(report.failures.size(), 1u);
  EXPECT_EQ(report.failures[0].name, "sink");
  EXPECT_EQ(report.restarts, 0) << "announced, but not made";
  EXPECT_EQ(read(folder_ + "/starts"), "started\n");
}

/// nohup: the user wants the run to outlive the terminal.
TEST_F(StopTest, IgnoredHangupStaysIgnored) {
  const auto before = std::signal(SIGHUP, SIG_IGN);
  auto sink = shell("sink", "kill -HUP $$; kill -HUP $PPID; echo alive > $D/alive; exit 0");
  sink.sink = true;
  const auto report = Supervisor({}).run({sink});
  std::signal(SIGHUP, before);
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(read(folder_ + "/alive"), "alive\n");
}

/// The sources have ended, but a later stage never does.
TEST_F(StopTest, EndsAndNamesWhatRunsLongAfterTheSources) {
  Options options;
  options.end_within_s = 0.3;
  auto sink = shell("merger", endingAfterSignal("merger", SIGTERM), 2);
  sink.sink = true;
  const auto report = Supervisor(options).run({shell("world", "exit 0"), service("localizer", 1), sink});
  EXPECT_EQ(report.reason, EndReason::kFailure);
  ASSERT_EQ(report.failures.size(), 2u);
  EXPECT_EQ(report.failures[0].name, "localizer") << "the stage upstream first: the other waits for it";
  EXPECT_EQ(report.failures[0].how, "still running 0.3 s after the last other process had ended");
  EXPECT_EQ(report.failures[1].name, "merger");
  EXPECT_EQ(read(folder_ + "/order"), "localizer\nmerger\n") << "all end in order and save";
}

/// A new merger would wait for input that has ended. The other sinks end in order.
TEST_F(StopTest, DoesNotRestartSinkThatFailsAfterTheSources) {
  Options options;
  options.end_within_s = 60.0;
  auto failing = shell("merger_r1", "while [ ! -e " + folder_ + "/ended ]; do sleep 0.02; done; exit 1", 2);
  failing.sink = true;
  auto other = shell("merger_r2", "sleep 0.3; echo saved >> " + folder_ + "/order", 2);
  other.sink = true;
  Callbacks callbacks;
  callbacks.on_exit = [&](const std::string& name, const std::string&) {
    if (name == "camera") std::ofstream(folder_ + "/ended") << "\n";
  };
  const auto begin = std::chrono::steady_clock::now();
  const auto report = Supervisor(options).run({shell("camera", "exit 0"), failing, other}, callbacks);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
  EXPECT_EQ(report.restarts, 0);
  EXPECT_EQ(report.exit_code(), 1);
  ASSERT_EQ(report.failures.size(), 1u);
  EXPECT_EQ(report.failures[0].name, "merger_r1");
  EXPECT_EQ(report.failures[0].how, "exit code 1");
  EXPECT_EQ(read(folder_ + "/order"), "saved\n");
}

TEST_F(StopTest, WaitsWithoutLimitWhileASourceRuns) {
  Options options;
  options.end_within_s = 0.05;
  options.duration_s = 0.4;
  const auto report =
      Supervisor(options).run({shell("video", "exit 0"), service("camera", 0), service("merger", 1)});
  EXPECT_EQ(report.reason, EndReason::kDuration);
  EXPECT_EQ(report.exit_code(), 0);
}

}  // namespace
}  // namespace omnifleet::supervisor
