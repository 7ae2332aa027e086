// Scripts that install and build first reject unknown options.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace {

namespace fs = std::filesystem;

struct Outcome {
  int exit_code = -1;
  std::string output;
};

/// Runs a script with stub tools that fail with exit code 99, so that it cannot install or build.
Outcome run(const std::string& script, const std::string& arguments) {
  const fs::path folder = fs::path(testing::TempDir()) / ("omnifleet_scripts_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  for (const char* tool : {"cmake", "ctest", "apt-get", "dpkg-query", "sudo"}) {
    std::ofstream(folder / tool) << "#!/bin/sh\necho TOOL CALLED\nexit 99\n";
    fs::permissions(folder / tool, fs::perms::owner_all);
  }
  const std::string command = "PATH=" + folder.string() + ":$PATH OMNIFLEET_BUILD_DIR=" + folder.string() +
                              " " + std::getenv("OMNIFLEET_SOURCE_DIR") + "/scripts/" + script + " " +
                              arguments + " 2>&1";
  Outcome outcome;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (!pipe) return outcome;
  std::array<char, 4096> buffer;
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.output.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  fs::remove_all(folder);
  return outcome;
}

TEST(Scripts, RejectUnknownOptionsBeforeBuilding) {
  const std::pair<const char*, const char*> calls[] = {
      {"setup.sh", "--bogus"},
      {"demo.sh", "--bogus"},
      {"bench.sh", "--bogus"},
      {"bench.sh", "--smoke more"},
      {"test.sh", "--bogus"},
      {"test.sh", "-R one another"},
      {"test.sh", "-j2 -L"},
      {"experiments/choi.sh", "--bogus"},
      {"experiments/ahmed.sh", "--bogus"},
      {"experiments/ahmed.sh", "--seeds 5"},
      {"experiments/fernandez.sh", "--bogus"},
      {"experiments/fernandez.sh", "--seeds 5"},
      {"experiments/fernandez.sh", "--seeds 6-5"},
      {"demo.sh", "fernandez --realtime"},
      {"experiments/rooms.sh", "--width 0"},
      {"experiments/pairs.sh", "--jobs 0"},
      {"experiments/appearance.sh", "--bogus"},
      {"experiments/appearance.sh", "--out"},
      {"experiments/exploration.sh", "--bogus"},
      {"experiments/exploration.sh", "--seeds 5"},
      {"experiments/exploration.sh", "--seeds 6-5"},
  };
  for (const auto& [script, arguments] : calls) {
    const Outcome outcome = run(script, arguments);
    EXPECT_EQ(outcome.exit_code, 2) << script << " " << arguments << ": " << outcome.output;
    EXPECT_EQ(outcome.output.find("TOOL CALLED"), std::string::npos) << script << " " << arguments;
  }
}

TEST(Scripts, AcceptKnownOptions) {
  for (const char* arguments : {"-L slow", "-R 'a|b' -j4 -V", "--timeout 5 --output-on-failure", ""}) {
    const Outcome outcome = run("test.sh", arguments);
    EXPECT_NE(outcome.exit_code, 2) << arguments << ": " << outcome.output;
    EXPECT_EQ(outcome.output.find("unknown option"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("TOOL CALLED"), std::string::npos) << outcome.output;
  }
  for (const char* arguments : {"--smoke --benchmark_filter=map", "--benchmark_out=x"})
    EXPECT_EQ(run("bench.sh", arguments).output.find("unknown option"), std::string::npos) << arguments;
}

}  // namespace
