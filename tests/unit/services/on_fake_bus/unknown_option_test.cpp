// A fleet in one process rejects unknown options and an unknown leader.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "fleet_in_process/in_process.h"
#include "options/options.h"

namespace omnifleet {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

TEST(UnknownOption, IsRejectedInEveryService) {
  const fs::path folder = fs::temp_directory_path() / ("omnifleet_unknown_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  for (const char* service :
       {"camera", "local_mapper", "classifier", "formation", "global_merger", "localizer", "world"}) {
    const fs::path overlay = folder / "typo.yaml";
    std::ofstream(overlay) << "services: {" << service << ": {no_such_option: 1}}\n";
    services::InProcessRun run;
    run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
    run.overlays = {overlay};
    run.out = folder / "out";
    try {
      services::runInProcess(run);
      ADD_FAILURE() << service << ": the option must be rejected";
    } catch (const options::Error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("typo.yaml"), HasSubstr("no_such_option"))) << service;
    }
    EXPECT_FALSE(fs::exists(run.out)) << service;
  }
  fs::remove_all(folder);
}

TEST(UnknownLeader, IsRejectedWithFileAndKey) {
  const fs::path folder = fs::temp_directory_path() / ("omnifleet_leader_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const fs::path overlay = folder / "leader.yaml";
  std::ofstream(overlay) << "services: {formation: {leader: r9}}\n";
  services::InProcessRun run;
  run.fleet_file = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
  run.overlays = {overlay};
  try {
    services::runInProcess(run);
    ADD_FAILURE() << "the leader must be rejected";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("leader.yaml"), HasSubstr("leader"),
                                    HasSubstr("'r9' is not a robot"), HasSubstr("r1, r2")));
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace omnifleet
