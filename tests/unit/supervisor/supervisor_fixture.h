#pragma once

// Real children of /bin/sh. No test sleeps for safety: children communicate by files and signals, and the
// time bounds are those of the contract.

#include "supervisor/supervisor.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>

namespace omnifleet::supervisor {

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

inline bool alive(pid_t pid) {
  return kill(pid, 0) == 0;
}

inline double secondsOf(const std::function<void()>& what) {
  const auto begun = std::chrono::steady_clock::now();
  what();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

/// Sends a signal to this process when `processes` have started (the supervisor reports each start).
inline Callbacks signalWhenStarted(int processes, int number) {
  Callbacks callbacks;
  callbacks.on_start = [left = processes, number](const std::string&, pid_t) mutable {
    if (--left == 0) kill(getpid(), number);
  };
  return callbacks;
}

}  // namespace omnifleet::supervisor
