// What the launcher refuses before it starts a process: resources of other fleets, a network that is down.

#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "bus/domain_claim.h"
#include "bus/folder_claim.h"
#include "bus/shared_memory.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

constexpr int kBadOptions = 2;

struct Outcome {
  int code = -1;
  std::string text;
};

Outcome outcomeOf(const std::vector<std::string>& argv, const std::string& folder,
                  const std::map<std::string, std::string>& environment = {}) {
  Process process(argv, folder + "/output.log", environment);
  const auto code = process.wait(60s);
  return {code.value_or(-1), process.output()};
}

std::string fleetFile() {
  return sourceDir() + "/config/fleets/small.yaml";
}

TEST(Launch, RefusesRunDirectoryOfRunningFleet) {
  const std::string folder = freshDir("claimed");
  fs::create_directories(folder + "/out/trajectories");
  std::ofstream(folder + "/out/trajectories/r1.tum") << "of the running fleet\n";
  const bus::FolderClaim claim(folder + "/out", "/fleets/other.yaml", "");
  const Outcome second =
      outcomeOf({program("launch"), "run", fleetFile(), "--out", folder + "/out", "--domain", "66"}, folder);
  EXPECT_EQ(second.code, kBadOptions);
  EXPECT_THAT(second.text, AllOf(HasSubstr("in use by another running fleet (/fleets/other.yaml)"),
                                 HasSubstr("--out " + folder + "/out_2"), Not(HasSubstr("starting"))));
  EXPECT_TRUE(fs::exists(folder + "/out/trajectories/r1.tum"));
}

TEST(Launch, UsesDomainOfItsOptionRatherThanOfTheEnvironment) {
  const std::string folder = freshDir("domain");
  const bus::DomainClaim claim(67, "");
  const std::vector<std::string> run{program("launch"), "run", fleetFile(), "--out", folder + "/out"};
  std::vector<std::string> with_option = run;
  with_option.insert(with_option.end(), {"--domain", "67"});
  const Outcome option = outcomeOf(with_option, folder, {{"OMNIFLEET_DOMAIN", "68"}});
  EXPECT_EQ(option.code, kBadOptions);
  EXPECT_THAT(option.text, HasSubstr("DDS domain 67 is in use"));
  const Outcome variable = outcomeOf(run, folder, {{"OMNIFLEET_DOMAIN", "67"}});
  EXPECT_EQ(variable.code, kBadOptions);
  EXPECT_THAT(variable.text, HasSubstr("DDS domain 67 is in use"));
}

TEST(Launch, RefusesEmptyRunDirectory) {
  const std::string folder = freshDir("empty_out");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{program("launch"), "run", fleetFile()},
        {program("launch"), "replay", folder},
        {program("fleet_in_process"), fleetFile()},
        {program("classifier"), "--fleet", fleetFile()}}) {
    std::vector<std::string> argv = command;
    argv.insert(argv.end(), {"--out", ""});
    const Outcome outcome = outcomeOf(argv, folder);
    EXPECT_EQ(outcome.code, kBadOptions) << command.front();
    EXPECT_THAT(outcome.text, AllOf(HasSubstr("--out"), HasSubstr("empty"))) << command.front();
  }
}

/// "" as a folder would be the root of the file system.
TEST(Programs, RefuseEmptyPaths) {
  const std::string folder = freshDir("empty_paths");
  const std::vector<std::pair<std::vector<std::string>, std::string>> commands{
      {{program("launch"), "run", ""}, "fleet"},
      {{program("launch"), "replay", "", "--out", folder + "/out"}, "dataset"},
      {{program("import_mrclam"), folder, ""}, "OUT"},
      {{program("evaluate"), "", folder}, "OUT"},
      {{program("evaluate"), folder, ""}, "DATASET"},
      {{program("ceiling_view"), "", folder}, "OUT"},
      {{program("make_recording"), "arena.yaml", "--out", ""}, "--out"},
      {{program("calibrate"), folder, "--board", "7x5", "--square-m", "0.1", "--out", ""}, "--out"},
      {{program("fit_scale"), "pairs.csv", "--out", "a.yaml", "--overlay", ""}, "--overlay"},
      {{program("fit_scale"), "pairs.csv", "--out", "a.yaml", "--plot", ""}, "--plot"},
      {{program("pick_markers"), "image.png", "--out", "m.yaml", "--picture", ""}, "--picture"},
      {{program("command"), "", "--halt"}, "fleet"},
  };
  for (const auto& [argv, argument] : commands) {
    const Outcome outcome = outcomeOf(argv, folder);
    EXPECT_EQ(outcome.code, kBadOptions) << argv.front() << ": " << outcome.text;
    EXPECT_THAT(outcome.text, AllOf(HasSubstr(argument + ": "), HasSubstr("the value is empty; give a path")))
        << argv.front();
  }
  const Outcome demo =
      outcomeOf({"/bin/sh", "-c", "exec '" + sourceDir() + "/scripts/demo.sh' --out ''"}, folder);
  EXPECT_EQ(demo.code, kBadOptions);
  EXPECT_EQ(demo.text, "demo.sh: --out needs a directory\n");
}

TEST(Launch, NamesVariableOfTheEnvironmentWithAWrongValue) {
  const std::string folder = freshDir("wrong_domain");
  for (const std::vector<std::string>& argv :
       {std::vector<std::string>{program("launch"), "run", fleetFile(), "--out", folder + "/out"},
        {program("status"), "--once"},
        {program("command"), fleetFile(), "--halt"},
        {program("classifier"), "--fleet", fleetFile()}}) {
    const Outcome outcome = outcomeOf(argv, folder, {{"OMNIFLEET_DOMAIN", "abc"}});
    EXPECT_EQ(outcome.code, kBadOptions) << argv.front();
    EXPECT_THAT(outcome.text,
                HasSubstr("'abc' (from the environment variable OMNIFLEET_DOMAIN) is not a whole "
                          "number within [0, 232]"));
  }
}

TEST(Launch, NamesLoopbackInterfaceThatIsDown) {
  const std::string folder = freshDir("loopback");
  if (outcomeOf({"/usr/bin/unshare", "-n", "/bin/true"}, folder).code != 0)
    GTEST_SKIP() << "network namespaces are not permitted here";
  const auto begin = std::chrono::steady_clock::now();
  const Outcome outcome = outcomeOf({"/usr/bin/unshare", "-n", program("launch"), "run", fleetFile(), "--out",
                                     folder + "/out", "--domain", "66"},
                                    folder);
  EXPECT_EQ(outcome.code, kBadOptions);
  EXPECT_THAT(outcome.text, HasSubstr("ip link set lo up"));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s) << "the old behaviour took 30 s";
}

/// 64 MiB, of which a running fleet has reserved 60.
TEST(Launch, RefusesToStartWithSharedMemoryThatAnotherFleetNeeds) {
  const std::string folder = freshDir("memory");
  const std::string script = "mount -t tmpfs -o size=64m none /dev/shm && ";
  if (outcomeOf({"/usr/bin/unshare", "-m", "/bin/sh", "-c", script + "true"}, folder).code != 0)
    GTEST_SKIP() << "private mounts are not permitted here";
  // The lock of the first fleet is held by the shell.
  const std::string reserve =
      "exec 9>/dev/shm/omnifleet_fleet_1 && flock 9 && echo '62914560 /runs/first' >&9 && ";
  const std::string launch =
      "exec " + program("launch") + " run " + fleetFile() + " --out " + folder + "/out --domain 66";
  const Outcome outcome =
      outcomeOf({"/usr/bin/unshare", "-m", "/bin/sh", "-c", script + reserve + launch}, folder);
  EXPECT_EQ(outcome.code, kBadOptions);
  EXPECT_THAT(outcome.text, AllOf(HasSubstr("MiB free, but the frames of the cameras need"),
                                  HasSubstr("60 MiB by the fleet with --out /runs/first")));
}

/// A symbolic link to a script in a folder of PATH.
TEST(Scripts, RunThroughSymbolicLinks) {
  const std::string folder = freshDir("links");
  const std::string build = fs::path(program("launch")).parent_path().parent_path().string();
  int scripts = 0;
  for (const auto& entry : fs::directory_iterator(sourceDir() + "/scripts")) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".sh" || name == "common.sh") continue;
    fs::create_symlink(entry.path(), folder + "/" + name);
    const Outcome outcome = outcomeOf({"/bin/sh", "-c", "cd / && exec '" + folder + "/" + name + "' --help"},
                                      folder, {{"OMNIFLEET_BUILD_DIR", build}});
    EXPECT_EQ(outcome.code, 0) << name << ": " << outcome.text;
    ++scripts;
  }
  EXPECT_GE(scripts, 13);
}

}  // namespace
}  // namespace omnifleet::test
