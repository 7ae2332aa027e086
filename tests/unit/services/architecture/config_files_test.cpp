// Loads every YAML file in config/ as the programs do, and checks every option of every service.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "common/check_options.h"
#include "fleet/fleet.h"

namespace {

namespace fs = std::filesystem;
using omnifleet::fleet::Fleet;

std::vector<std::string> files(const std::string& folder) {
  std::vector<std::string> found;
  const fs::path root = fs::path(std::getenv("OMNIFLEET_SOURCE_DIR")) / "config" / folder;
  if (!fs::exists(root)) return found;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (entry.path().extension() == ".yaml") found.push_back(entry.path().string());
  }
  std::sort(found.begin(), found.end());
  return found;
}

TEST(ConfigFiles, FleetsAreValid) {
  const auto fleets = files("fleets");
  ASSERT_FALSE(fleets.empty());
  for (const std::string& file : fleets) {
    ASSERT_NO_THROW(omnifleet::services::checkOptions(Fleet::load(file, "", {}))) << file;
  }
}

TEST(ConfigFiles, ArenasAreValid) {
  const auto arenas = files("arenas");
  ASSERT_FALSE(arenas.empty());
  for (const std::string& file : arenas) ASSERT_NO_THROW(omnifleet::synthetic::Arena::load(file)) << file;
}

TEST(ConfigFiles, PaperOverlaysAreValidWithDemoFleet) {
  const std::string demo = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/demo.yaml";
  for (const std::string& overlay : files("papers")) {
    ASSERT_NO_THROW(omnifleet::services::checkOptions(Fleet::load(demo, "", {overlay}))) << overlay;
  }
}

TEST(ConfigFiles, EveryYamlFileIsCheckedByATest) {
  const auto all = files("");
  const auto loaded = files("fleets").size() + files("arenas").size() + files("papers").size();
  EXPECT_EQ(all.size(), loaded) << "no test checks a folder of config/";
}

TEST(ConfigFiles, ErrorNamesFileLineAndKey) {
  const std::string demo = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/demo.yaml";
  const std::string overlay = testing::TempDir() + "/mistake.yaml";
  std::FILE* file = std::fopen(overlay.c_str(), "w");
  ASSERT_NE(file, nullptr);
  std::fputs("services:\n  localizer:\n    estimator:\n      solver_iterations: -3\n", file);
  std::fclose(file);
  try {
    omnifleet::services::checkOptions(Fleet::load(demo, "", {overlay}));
    FAIL() << "a negative count must be rejected";
  } catch (const omnifleet::options::Error& error) {
    EXPECT_THAT(error.what(),
                testing::HasSubstr("mistake.yaml:4: services.localizer.estimator.solver_iterations"));
    EXPECT_THAT(error.what(), testing::HasSubstr("-3"));
  }
}

}  // namespace
