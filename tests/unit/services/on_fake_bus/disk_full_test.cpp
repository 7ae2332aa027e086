// A disk that fills up: the old map stays whole, the run tells what could not be written and goes on.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "fleet_in_process/in_process.h"
#include "options/options.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// Files of this process cannot grow beyond `bytes` while it lives: what a full disk does to write().
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &old_);
    rlimit limit = old_;
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() { ::setrlimit(RLIMIT_FSIZE, &old_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit old_{};
};

std::map<std::string, std::string> mapFiles(const fs::path& out) {
  std::map<std::string, std::string> files;
  for (const char* name : {"map.bt", "map.pgm", "map.yaml", "map.png", "objects.geojson"}) {
    std::ifstream file(out / name, std::ios::binary);
    std::stringstream content;
    content << file.rdbuf();
    files[name] = content.str();
  }
  return files;
}

TEST(DiskFull, TheOldMapStaysWholeAndTheRunSaysSo) {
  const fs::path out = fs::temp_directory_path() / ("omnifleet_disk_full_" + std::to_string(::getpid()));
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.out = out;
  ASSERT_TRUE(services::runInProcess(run));
  const auto before = mapFiles(out);
  for (const auto& [name, bytes] : before) EXPECT_FALSE(bytes.empty()) << name;

  // Another run into the same place: another map, and no room for it. Whom this one never locates has no
  // path.
  std::ofstream(out / "trajectories" / "gone.tum") << "1 0 0 0 0 0 0 1\n";
  std::ofstream(out / "covariances" / "gone.csv") << "1\n";
  std::ofstream(out / "trajectories" / "notes.txt") << "of a person\n";
  const fs::path overlay = out / "overlay.yaml";
  std::ofstream(overlay) << "world: {seed: 2}\n";
  run.overlays = {overlay};
  run.log_level = "off";
  std::string told;
  run.on_problem = [&](const std::string& service, const std::string& problem) {
    told += service + ": " + problem + "\n";
  };
  {
    const FullDisk full(100);
    EXPECT_FALSE(services::runInProcess(run)) << "the caller must know";
  }
  for (const auto& [name, bytes] : mapFiles(out)) {
    if (name == "map.yaml") continue;  // small enough to fit
    EXPECT_TRUE(bytes == before.at(name)) << name << " was damaged";
    EXPECT_THAT(told, HasSubstr(name + ": cannot be written"));
  }
  EXPECT_FALSE(fs::exists(out / "trajectories" / "gone.tum"));
  EXPECT_FALSE(fs::exists(out / "covariances" / "gone.csv"));
  EXPECT_TRUE(fs::exists(out / "trajectories" / "notes.txt"));
  EXPECT_THAT(told, HasSubstr("tracks")) << "the rows beside the map are given up, too";
  for (const auto& entry : fs::directory_iterator(out)) {
    EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry.path() << " was left behind";
  }
  fs::remove_all(out);
}

TEST(DiskFull, AnOutputThatCannotBeMadeIsNamedBeforeTheRun) {
  const fs::path out = fs::temp_directory_path() / ("omnifleet_no_out_" + std::to_string(::getpid()));
  std::ofstream(out) << "a file where the folder would be";
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.out = out;
  const auto everyRound = [](std::uint64_t) { ADD_FAILURE() << "it ran"; };
  try {
    services::runInProcess(run, everyRound);
    ADD_FAILURE() << "taken";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(out.string()));
  }
  fs::remove_all(out);
}

TEST(DiskFull, ARowFileThatCannotBeMadeIsGivenUpAndTheMapIsSaved) {
  const fs::path out = fs::temp_directory_path() / ("omnifleet_no_rows_" + std::to_string(::getpid()));
  fs::create_directories(out);
  std::ofstream(out / "tracks") << "a file where the folder would be";
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.out = out;
  run.log_level = "off";
  std::string told;
  run.on_problem = [&](const std::string& service, const std::string& problem) {
    told += service + ": " + problem + "\n";
  };
  EXPECT_TRUE(services::runInProcess(run));
  EXPECT_THAT(told, HasSubstr("tracks: cannot be"));
  EXPECT_FALSE(mapFiles(out).at("map.bt").empty());
  fs::remove_all(out);
}

}  // namespace
}  // namespace omnifleet
