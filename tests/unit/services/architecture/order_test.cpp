// The layers of CONTRIBUTING, checked in the sources: dependencies point in one direction.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace omnifleet {
namespace {

namespace fs = std::filesystem;

fs::path root() {
  const char* folder = std::getenv("OMNIFLEET_SOURCE_DIR");
  if (!folder) throw std::runtime_error("OMNIFLEET_SOURCE_DIR is not set; run through ctest");
  return folder;
}

std::string text(const fs::path& path) {
  std::ifstream file(path);
  std::stringstream content;
  content << file.rdbuf();
  return content.str();
}

std::vector<fs::path> sources(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".h" || extension == ".cpp") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The included paths of a file.
std::vector<std::string> includes(const fs::path& file) {
  static const std::regex kInclude(R"(#\s*include\s*["<]([^">]+)[">])");
  const std::string content = text(file);
  std::vector<std::string> found;
  for (std::sregex_iterator at(content.begin(), content.end(), kInclude), end; at != end; ++at)
    found.push_back((*at)[1]);
  return found;
}

std::string topFolder(const std::string& include) {
  return include.substr(0, include.find('/'));
}

/// The libraries from the bottom up, in the order of libs/CMakeLists.txt.
std::vector<std::string> layers() {
  std::smatch list;
  const std::string content = text(root() / "libs/CMakeLists.txt");
  if (!std::regex_search(content, list, std::regex(R"(IN ITEMS([^)]*)\))")))
    throw std::runtime_error("libs/CMakeLists.txt has no list of libraries");
  std::istringstream words(list[1].str());
  return {std::istream_iterator<std::string>(words), std::istream_iterator<std::string>()};
}

bool isDds(const std::string& include) {
  static const std::regex kDds(R"(^(fastdds|fastrtps|fastcdr|dds)/.*|.*(PubSubTypes|CdrAux)\.h.*|^idl/.*)");
  return std::regex_match(include, kDds);
}

TEST(Layering, LibraryIncludesOnlyLowerLibraries) {
  const auto order = layers();
  ASSERT_GE(order.size(), 15u);
  std::size_t seen = 0;
  for (auto library = order.begin(); library != order.end(); ++library) {
    for (const fs::path& file : sources(root() / "libs" / *library)) {
      for (const std::string& include : includes(file)) {
        const auto other = std::find(order.begin(), order.end(), topFolder(include));
        if (other == order.end() || include.find('/') == std::string::npos) continue;
        ++seen;
        EXPECT_LE(other - order.begin(), library - order.begin()) << file << " includes " << include;
      }
    }
  }
  EXPECT_GT(seen, 100u) << "no sources found";
}

TEST(Layering, EveryLibraryFolderIsInTheList) {
  const auto order = layers();
  for (const auto& entry : fs::directory_iterator(root() / "libs")) {
    if (!entry.is_directory()) continue;
    EXPECT_NE(std::find(order.begin(), order.end(), entry.path().filename().string()), order.end())
        << entry.path() << " is not in the list of libs/CMakeLists.txt";
  }
}

/// The logic of a stage is its own library (services/<stage>/CMakeLists.txt). The bus is used above it, in
/// service.h.
TEST(Layering, StageLogicDependsNeitherOnBusNorOnIdl) {
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(root() / "services")) {
    const std::string list = text(entry.path() / "CMakeLists.txt");
    for (const fs::path& file : entry.is_directory() ? sources(entry.path()) : std::vector<fs::path>{}) {
      if (file.extension() != ".cpp" || list.find(file.filename().string()) == std::string::npos) continue;
      ++files;
      for (const std::string& include : includes(file)) {
        EXPECT_FALSE(isDds(include)) << file << " includes " << include;
        EXPECT_NE(topFolder(include), "bus") << file << " includes " << include;
        EXPECT_NE(topFolder(include), "adapters") << file << " includes " << include;
      }
    }
  }
  EXPECT_GT(files, 15u) << "no sources found";
}

}  // namespace
}  // namespace omnifleet
