// A full disk: the old map stays intact, the run reports what could not be written and continues.

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

/// During its lifetime files of this process cannot exceed `bytes`, which write() reports as a full disk
/// does.
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

TEST(DiskFull, KeepsOldMapAndReportsFailure) {
  const fs::path out = fs::temp_directory_path() / ("omnifleet_disk_full_" + std::to_string(::getpid()));
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.out = out;
  ASSERT_TRUE(services::runInProcess(run));
  const auto before = mapFiles(out);
  for (const auto& [name, bytes] : before) EXPECT_FALSE(bytes.empty()) << name;

  // A second run with another map into the same folder, with no space left. Robots that this run never
  // localizes must have no trajectory files.
  std::ofstream(out / "trajectories" / "gone.tum") << "1 0 0 0 0 0 0 1\n";
  std::ofstream(out / "covariances" / "gone.csv") << "1\n";
  std::ofstream(out / "localization" / "gone.csv") << "1\n";
  std::ofstream(out / "trajectories" / "notes.txt") << "a user's notes\n";
  const fs::path overlay = out / "overlay.yaml";
  std::ofstream(overlay) << "world: {seed: 2}\n";
  run.overlays = {overlay};
  run.log_level = "off";
  std::string log;
  run.on_message = [&](const std::string& service, const Message& message) {
    log += service + ": " + toLogLine(message) + "\n";
  };
  {
    const FullDisk full(100);
    EXPECT_FALSE(services::runInProcess(run)) << "the failure must be returned";
  }
  for (const auto& [name, bytes] : mapFiles(out)) {
    if (name == "map.yaml") continue;  // small enough to fit
    EXPECT_TRUE(bytes == before.at(name)) << name << " must be unchanged";
    EXPECT_THAT(log, HasSubstr("/" + name + ": "));
  }
  EXPECT_FALSE(fs::exists(out / "trajectories" / "gone.tum"));
  EXPECT_FALSE(fs::exists(out / "covariances" / "gone.csv"));
  EXPECT_FALSE(fs::exists(out / "localization" / "gone.csv"));
  EXPECT_TRUE(fs::exists(out / "trajectories" / "notes.txt"));
  EXPECT_THAT(log, HasSubstr("tracks")) << "side outputs must be reported as well";
  EXPECT_THAT(log, HasSubstr("[file_write_failed] map not saved completely"));
  for (const auto& entry : fs::directory_iterator(out)) {
    EXPECT_EQ(entry.path().string().find(".tmp"), std::string::npos) << entry.path() << " must be removed";
  }
  fs::remove_all(out);
}

TEST(DiskFull, NamesUnusableOutputBeforeRun) {
  const fs::path out = fs::temp_directory_path() / ("omnifleet_no_out_" + std::to_string(::getpid()));
  std::ofstream(out) << "a file in place of the folder";
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.out = out;
  const auto everyRound = [](std::uint64_t) { ADD_FAILURE() << "the run must not start"; };
  try {
    services::runInProcess(run, everyRound);
    ADD_FAILURE() << "the output must be rejected";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(out.string()));
  }
  fs::remove_all(out);
}

TEST(DiskFull, SavesMapWhenSideOutputFails) {
  const fs::path out = fs::temp_directory_path() / ("omnifleet_no_rows_" + std::to_string(::getpid()));
  fs::create_directories(out);
  std::ofstream(out / "tracks") << "a file in place of the folder";
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.out = out;
  run.log_level = "off";
  std::string log;
  run.on_message = [&](const std::string& service, const Message& message) {
    log += service + ": " + toLogLine(message) + "\n";
  };
  EXPECT_TRUE(services::runInProcess(run));
  EXPECT_THAT(log, AllOf(HasSubstr("[file_write_failed]"), HasSubstr("tracks")));
  EXPECT_FALSE(mapFiles(out).at("map.bt").empty());
  fs::remove_all(out);
}

}  // namespace
}  // namespace omnifleet
