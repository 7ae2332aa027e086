// Starting, restarting and reporting processes. stopping_test.cpp has the signals.

#include "tests/unit/supervisor/supervisor_fixture.h"

#include <poll.h>
#include <sys/syscall.h>

#include <sstream>

namespace omnifleet::supervisor {
namespace {

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

}  // namespace
}  // namespace omnifleet::supervisor
