// Rules of the architecture: which folder may include which headers, and where the truth may be used.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

fs::path source() {
  return std::getenv("OMNIFLEET_SOURCE_DIR");
}

std::vector<fs::path> sources(const std::string& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(source() / folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".h" || extension == ".cpp") files.push_back(entry.path());
  }
  return files;
}

/// Lines of files below `folder` that match `pattern`, except in paths that contain one of `allowed`.
std::vector<std::string> offenders(const std::string& folder, const std::string& pattern,
                                   const std::vector<std::string>& allowed) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (const fs::path& file : sources(folder)) {
    const std::string name = fs::relative(file, source()).string();
    bool skip = false;
    for (const std::string& part : allowed) skip = skip || name.find(part) != std::string::npos;
    if (skip) continue;
    std::ifstream text(file);
    int number = 0;
    for (std::string line; std::getline(text, line);) {
      ++number;
      if (std::regex_search(line, regex)) found.push_back(name + ":" + std::to_string(number) + ": " + line);
    }
  }
  return found;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

TEST(Layers, OnlyBusDependsOnDds) {
  const auto found =
      offenders("libs", R"(#include *[<"](fastdds|fastrtps|fastcdr|dds/|idl/|bus/))", {"libs/bus/"});
  EXPECT_TRUE(found.empty()) << joined(found);
  EXPECT_FALSE(offenders("libs", R"(#include *[<"]fastdds)", {}).empty())
      << "the pattern must match the bus itself";
}

TEST(Layers, ServicesUseOnlyTheBusInterface) {
  const auto found = offenders("services", R"(#include *[<"](fastdds|fastrtps|fastcdr|dds/))", {});
  EXPECT_TRUE(found.empty()) << joined(found);
}

TEST(Layers, LibrariesDoNotDependOnServices) {
  const auto found = offenders(
      "libs",
      R"(#include *"(camera|local_mapper|classifier|localizer|global_merger|formation|world|adapters|common)/)",
      {});
  EXPECT_TRUE(found.empty()) << joined(found);
}

TEST(Layers, OnlyEvaluateReadsGroundTruth) {
  const auto libs =
      offenders("libs", R"(#include *"dataset/ground_truth\.h")", {"libs/dataset/", "libs/evaluation/"});
  const auto services =
      offenders("services", R"(#include *"dataset/ground_truth\.h")", {"services/evaluate/"});
  EXPECT_TRUE(libs.empty()) << joined(libs);
  EXPECT_TRUE(services.empty()) << joined(services);
}

TEST(Layers, OnlyWorldAndItsCamerasUseTruthTopic) {
  const auto found =
      offenders("services", R"(world_truth|v1::Truth)", {"services/world/", "services/camera/arena_service"});
  EXPECT_TRUE(found.empty()) << joined(found);
}

}  // namespace
