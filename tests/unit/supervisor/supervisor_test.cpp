// Tests with real children of /bin/sh. No test sleeps for safety: children communicate by files and signals,
// and the time bounds are those of the contract.

#include "supervisor/supervisor.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace omnifleet::supervisor {
namespace {

namespace fs = std::filesystem;

class SupervisorTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = testing::TempDir() + "supervisor_XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override {
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a child was left behind";
    EXPECT_EQ(errno, ECHILD);
    fs::remove_all(folder_);
  }

  ProcessSpec shell(const std::string& name, const std::string& script, int level = 0) const {
    ProcessSpec spec;
    spec.name = name;
    spec.argv = {"sh", "-c", script};
    spec.env = {{"D", folder_}};
    spec.log_path = log(name);
    spec.level = level;
    return spec;
  }
  /// A service that runs until SIGTERM and then appends its name to the file `order`.
  ProcessSpec service(const std::string& name, int level, const std::string& at_end = "") const {
    return shell(
        name, "trap '" + at_end + "echo " + name + " >> $D/order; exit 0' TERM; echo up; " + kForever, level);
  }
  std::string log(const std::string& name) const { return folder_ + "/log/" + name + ".log"; }
  std::string read(const std::string& path) const {
    std::ifstream file(path);
    return std::string(std::istreambuf_iterator<char>(file), {});
  }

  /// The trap interrupts `wait`; `sleep` alone would not end.
  static constexpr const char* kForever = "while :; do sleep 1000 & wait; done";
  std::string folder_;
};

bool alive(pid_t pid) {
  return kill(pid, 0) == 0;
}

double secondsOf(const std::function<void()>& what) {
  const auto begun = std::chrono::steady_clock::now();
  what();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

/// Sends a signal to this process when `processes` have started (the supervisor reports each start).
Callbacks signalWhenStarted(int processes, int number) {
  Callbacks callbacks;
  callbacks.on_start = [left = processes, number](const std::string&, pid_t) mutable {
    if (--left == 0) kill(getpid(), number);
  };
  return callbacks;
}

TEST_F(SupervisorTest, EndsWhenSinksAreDone) {
  auto sink = shell("sink", "exit 0", 1);
  sink.sink = true;
  const auto report = Supervisor({}).run({service("source", 0), sink});
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_EQ(report.restarts, 0);
}

TEST_F(SupervisorTest, WithoutSinksEndsWhenAllAreDone) {
  const auto report = Supervisor({}).run({shell("a", "echo a > $D/a"), shell("b", "echo b > $D/b")});
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(read(folder_ + "/a") + read(folder_ + "/b"), "a\nb\n");
}

TEST_F(SupervisorTest, LogsStdoutAndStderrOfEachProcess) {
  Supervisor({}).run({shell("talker", "echo out; echo err >&2"), shell("other", "echo other")});
  EXPECT_EQ(read(log("talker")), "out\nerr\n");
  EXPECT_EQ(read(log("other")), "other\n");
}

TEST_F(SupervisorTest, PassesOnlyTheEnvironment) {
  auto spec = shell("env", "echo $EXTRA; ls /proc/self/fd | wc -l; readlink /proc/self/fd/0");
  spec.env["EXTRA"] = "extra value";
  const int leaked = dup(STDERR_FILENO);  // a descriptor without close-on-exec, as libraries leave it
  Supervisor({}).run({spec});
  close(leaked);
  EXPECT_EQ(read(log("env")), "extra value\n4\n/dev/null\n");  // 0, 1, 2 and the folder that ls reads
}

TEST_F(SupervisorTest, StopsUpstreamFirst) {
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

TEST_F(SupervisorTest, KillsAndReportsProcessThatDoesNotEnd) {
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

TEST_F(SupervisorTest, PassesIncarnationFromSecondStartOn) {
  auto spec =
      shell("cat", "echo \"$@\" >> $D/incarnations; [ $(wc -l < $D/incarnations) -ge 3 ] || kill -9 $$");
  spec.argv.push_back("name");
  spec.incarnation_option = "--incarnation";
  spec.sink = true;
  EXPECT_EQ(Supervisor({}).run({spec}).restarts, 2);
  EXPECT_EQ(read(folder_ + "/incarnations"), "\n--incarnation 2\n--incarnation 3\n");
}

TEST_F(SupervisorTest, RestartsProcessKilledByItself) {
  // Kills itself in its first incarnation and succeeds in its second.
  auto spec = shell("restarting", "if [ -e $D/second ]; then exit 0; fi; touch $D/second; kill -9 $$");
  spec.sink = true;
  std::vector<double> delays;
  Callbacks callbacks;
  callbacks.on_restart = [&](const Restart& restart) { delays.push_back(restart.delay_s); };
  RunReport report;
  const double took = secondsOf([&] { report = Supervisor({}).run({spec}, callbacks); });
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(report.restarts, 1);
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_EQ(delays, std::vector<double>{0.1});
  EXPECT_GE(took, 0.1);
  EXPECT_NE(read(log("restarting")).find("killed by signal 9 (Killed); restart in 0.10 s"),
            std::string::npos);
}

TEST_F(SupervisorTest, RestartsProcessKilledByOthers) {
  std::vector<pid_t> pids;
  Callbacks callbacks;
  callbacks.on_start = [&](const std::string& name, pid_t pid) {
    if (name != "victim") return;
    pids.push_back(pid);
    kill(pids.size() == 1 ? pid : getpid(), pids.size() == 1 ? SIGKILL : SIGTERM);
  };
  const auto report = Supervisor({}).run({service("victim", 0), service("other", 1)}, callbacks);
  ASSERT_EQ(pids.size(), 2U);
  EXPECT_NE(pids[0], pids[1]);
  EXPECT_EQ(report.restarts, 1);
  EXPECT_EQ(report.exit_code(), 0);
}

/// What keeps failing must not end the others.
TEST_F(SupervisorTest, KeepsRestartingProcessThatKeepsFailing) {
  Options options;
  options.restart_delay_s = 0.001;
  options.restart_cap_s = 0.002;
  Callbacks callbacks;
  std::vector<Restart> restarts;
  callbacks.on_restart = [&](const Restart& restart) {
    restarts.push_back(restart);
    if (restarts.size() == 100) kill(getpid(), SIGTERM);
  };
  const auto report =
      Supervisor(options).run({shell("bad", "echo no luck; exit 3"), service("good", 1)}, callbacks);
  EXPECT_EQ(report.reason, EndReason::kSignal);
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_EQ(restarts.back().name, "bad");
  EXPECT_EQ(restarts.back().how, "exit code 3");
  EXPECT_EQ(restarts.back().early_failures, 100);
  ASSERT_EQ(report.degraded.size(), 1u) << "it did not run at the end";
  EXPECT_EQ(report.degraded[0].name, "bad");
  EXPECT_EQ(report.degraded[0].how, "failed 100 times, the last time with exit code 3");
  EXPECT_EQ(report.degraded[0].last_lines.front(), "no luck");
}

TEST_F(SupervisorTest, FailureWithoutRestartPolicyEndsRun) {
  auto spec = shell("replayed", "echo broken; exit 4");
  spec.restart = RestartPolicy::kNever;
  const auto report = Supervisor({}).run({spec, service("other", 1)});
  EXPECT_EQ(report.reason, EndReason::kFailure);
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].how, "exit code 4");
  EXPECT_EQ(report.exit_code(), 1);
}

TEST_F(SupervisorTest, NamesMissingProgram) {
  ProcessSpec spec = shell("missing", "");
  spec.argv = {folder_ + "/no_such_program"};
  const auto report = Supervisor({}).run({service("other", 0), spec});
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].name, "missing");
  EXPECT_NE(report.failures[0].how.find("No such file or directory"), std::string::npos);
}

TEST_F(SupervisorTest, NamesLogThatCannotBeWritten) {
  ProcessSpec spec = shell("mute", "exit 0");
  spec.log_path = "/proc/no/such/place.log";
  const auto report = Supervisor({}).run({spec});
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_NE(report.failures[0].how.find("/proc/no/such/place.log"), std::string::npos);
}

TEST_F(SupervisorTest, StopsSuccessfullyAfterDuration) {
  Options options;
  options.duration_s = 0.2;
  RunReport report;
  const double took = secondsOf([&] {
    report = Supervisor(options).run({service("a", 0), service("b", 1)});
  });
  EXPECT_EQ(report.reason, EndReason::kDuration);
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_GE(took, 0.2);
  EXPECT_LT(took, 0.2 + 2.0);
}

TEST_F(SupervisorTest, ReportsErrorWhileStopping) {
  const auto clumsy =
      shell("clumsy", "trap 'echo could not save; exit 7' TERM; echo up; " + std::string(kForever));
  const auto ready = shell("signal", "until grep -q up $D/log/clumsy.log; do :; done; kill -INT $PPID");
  const auto report = Supervisor({}).run({clumsy, ready});
  ASSERT_EQ(report.failures.size(), 1U);
  EXPECT_EQ(report.failures[0].how, "exit code 7");
  EXPECT_EQ(report.failures[0].last_lines.back(), "could not save");
}

TEST_F(SupervisorTest, LeavesNoGrandchildren) {
  // One grandchild is in the process group of its parent. The other has left it: after setsid only a
  // subreaper can reap it.
  const auto report = Supervisor({}).run(
      {shell("mother", "sleep 1000 & echo $! > $D/pids; setsid sleep 1000 & echo $! >> $D/pids; exit 0")});
  EXPECT_EQ(report.exit_code(), 0);
  std::ifstream pids(folder_ + "/pids");
  int count = 0;
  for (pid_t pid = 0; pids >> pid; ++count) EXPECT_FALSE(alive(pid)) << pid;
  EXPECT_EQ(count, 2);
}

TEST_F(SupervisorTest, ChildrenEndWithSupervisor) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t supervisor = fork();
  ASSERT_GE(supervisor, 0);
  if (supervisor == 0) {
    Callbacks callbacks;
    callbacks.on_start = [&](const std::string&, pid_t pid) {
      if (write(ends[1], &pid, sizeof(pid)) != sizeof(pid)) _exit(1);
    };
    ProcessSpec sleeper = shell("child", "");
    sleeper.argv = {"sleep", "1000"};
    Supervisor({}).run({sleeper}, callbacks);
    _exit(0);
  }
  close(ends[1]);
  pid_t child = -1;
  ASSERT_EQ(::read(ends[0], &child, sizeof(child)), static_cast<ssize_t>(sizeof(child)));
  const int pidfd = static_cast<int>(syscall(SYS_pidfd_open, child, 0));
  kill(supervisor, SIGKILL);
  waitpid(supervisor, nullptr, 0);
  pollfd ended{pidfd, POLLIN, 0};
  EXPECT_EQ(poll(&ended, 1, 10000), 1) << "the child outlived its supervisor";
  close(pidfd);
  close(ends[0]);
}

TEST_F(SupervisorTest, IgnoresEarlierChildren) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    pause();
    _exit(0);
  }
  Supervisor({}).run({shell("a", "exit 0")});
  EXPECT_TRUE(alive(child));
  kill(child, SIGKILL);
  EXPECT_EQ(waitpid(child, nullptr, 0), child);
}

TEST_F(SupervisorTest, SecondKeyPressKillsAtOnce) {
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
TEST_F(SupervisorTest, LaterTermAndHangupDoNotKill) {
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
TEST_F(SupervisorTest, SignalToAllProcessesIsAStop) {
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

TEST_F(SupervisorTest, OneProcessThatASignalEndedIsRestartedOrFails) {
  auto victim = shell("victim", "[ -e $D/second ] && exit 0; touch $D/second; kill -TERM $$; sleep 1000");
  victim.sink = true;
  const auto restarted = Supervisor({}).run({victim, service("other", 1)});
  EXPECT_EQ(restarted.restarts, 1);
  EXPECT_EQ(restarted.reason, EndReason::kSinksDone);
  fs::remove(folder_ + "/second");
  victim.restart = RestartPolicy::kNever;
  const auto failed = Supervisor({}).run({victim, service("other", 1)});
  EXPECT_EQ(failed.reason, EndReason::kFailure);
  ASSERT_EQ(failed.failures.size(), 1u);
  EXPECT_EQ(failed.failures[0].how, "killed by signal 15 (Terminated)");
}

/// nohup: the user wants the run to outlive the terminal.
TEST_F(SupervisorTest, IgnoredHangupStaysIgnored) {
  const auto before = std::signal(SIGHUP, SIG_IGN);
  auto sink = shell("sink", "kill -HUP $$; kill -HUP $PPID; echo alive > $D/alive; exit 0");
  sink.sink = true;
  const auto report = Supervisor({}).run({sink});
  std::signal(SIGHUP, before);
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(read(folder_ + "/alive"), "alive\n");
}

/// The sources have ended, but a later stage never does.
TEST_F(SupervisorTest, EndsAndNamesWhatRunsLongAfterTheSources) {
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

TEST_F(SupervisorTest, WaitsWithoutLimitWhileASourceRuns) {
  Options options;
  options.end_within_s = 0.05;
  options.duration_s = 0.4;
  const auto report =
      Supervisor(options).run({shell("video", "exit 0"), service("camera", 0), service("merger", 1)});
  EXPECT_EQ(report.reason, EndReason::kDuration);
  EXPECT_EQ(report.exit_code(), 0);
}

TEST_F(SupervisorTest, RestoresSignalMask) {
  sigset_t before, after;
  pthread_sigmask(SIG_SETMASK, nullptr, &before);
  Supervisor({}).run({shell("a", "exit 0")});
  pthread_sigmask(SIG_SETMASK, nullptr, &after);
  EXPECT_EQ(sigismember(&before, SIGINT), sigismember(&after, SIGINT));
  EXPECT_EQ(sigismember(&before, SIGTERM), sigismember(&after, SIGTERM));
}

TEST_F(SupervisorTest, RejectsInvalidList) {
  EXPECT_THROW(Supervisor({}).run({}), options::Error);
  EXPECT_THROW(Supervisor({}).run({shell("a", "exit 0"), shell("a", "exit 0")}), options::Error);
  ProcessSpec empty;
  empty.name = "empty";
  EXPECT_THROW(Supervisor({}).run({empty}), options::Error);
}

TEST_F(SupervisorTest, RunsHundredProcesses) {
  std::vector<ProcessSpec> processes;
  for (int i = 0; i < 100; ++i) processes.push_back(shell("p" + std::to_string(i), "exit 0", i % 7));
  const auto report = Supervisor({}).run(processes, signalWhenStarted(1000, SIGINT));
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(report.exit_code(), 0);
}

TEST_F(SupervisorTest, DoesNotRestartProcessThatRefusesFirstStart) {
  ProcessSpec refusing = shell("refusing", "echo x >> $D/starts; exit 2");
  refusing.refusal_code = 2;
  const RunReport report = Supervisor({}).run({refusing, service("other", 1)});
  EXPECT_EQ(report.reason, EndReason::kFailure);
  ASSERT_EQ(report.failures.size(), 1u);
  EXPECT_EQ(report.failures[0].how, "exit code 2");
  EXPECT_EQ(report.restarts, 0);
  EXPECT_EQ(read(folder_ + "/starts"), "x\n");
}

/// A camera that was unplugged cannot be opened for a while. It has run before, so it is restarted.
TEST_F(SupervisorTest, RestartsProcessThatRefusesLaterStart) {
  ProcessSpec flaky = shell("flaky",
                            "echo x >> $D/starts; n=$(wc -l < $D/starts); [ $n = 1 ] && exit 1; "
                            "[ $n = 2 ] && exit 2; exit 0");
  flaky.refusal_code = 2;
  flaky.sink = true;
  const RunReport report = Supervisor({}).run({flaky});
  EXPECT_EQ(report.reason, EndReason::kSinksDone);
  EXPECT_EQ(report.restarts, 2);
}

/// The sink saves the map and must not be killed with the other processes when the machine is busy.
TEST_F(SupervisorTest, SinkHasGraceTimeBeyondBudget) {
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

TEST_F(SupervisorTest, TreatsTwoSignalsOfOneKeyPressAsOne) {
  auto ready =
      shell("signal",
            "until grep -q up $D/log/merger.log; do :; done; kill -INT $PPID; kill -TERM $PPID; exit 0", 0);
  const RunReport report = Supervisor({}).run({service("merger", 1, "echo saved > $D/map; "), ready});
  EXPECT_EQ(report.exit_code(), 0);
  EXPECT_EQ(read(folder_ + "/map"), "saved\n");
}

}  // namespace
}  // namespace omnifleet::supervisor
