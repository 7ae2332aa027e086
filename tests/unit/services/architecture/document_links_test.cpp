// Every relative link of the documents leads to a file, and to a heading of it.

#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace omnifleet {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> documents(const fs::path& root) {
  std::vector<fs::path> found{root / "README.md", root / "CONTRIBUTING.md", root / "CHANGELOG.md"};
  for (const char* folder : {"docs", "idl"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      if (entry.path().extension() == ".md") found.push_back(entry.path());
    }
  }
  return found;
}

/// Lines outside of code blocks.
std::vector<std::string> proseOf(const fs::path& document) {
  std::ifstream file(document);
  EXPECT_TRUE(file.is_open()) << document;
  std::vector<std::string> lines;
  bool is_code = false;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("```", 0) == 0) is_code = !is_code;
    if (!is_code) lines.push_back(line);
  }
  return lines;
}

/// Anchor of a heading as GitHub makes it: lower case, spaces become hyphens, punctuation vanishes, letters
/// beyond ASCII stay.
std::string anchorOf(std::string heading) {
  heading = std::regex_replace(heading, std::regex(R"(\[([^\]]*)\]\([^)]*\))"), "$1");
  std::string anchor;
  for (std::size_t i = heading.find_first_not_of("# "); i < heading.size(); ++i) {
    const auto c = static_cast<unsigned char>(heading[i]);
    if (c == 0xE2)
      i += 2;  // U+2000 to U+2FFF: dashes, quotes, arrows
    else if (c == ' ')
      anchor += '-';
    else if (c >= 0x80 || std::isalnum(c) || c == '-' || c == '_')
      anchor += static_cast<char>(std::tolower(c));
  }
  return anchor;
}

std::set<std::string> anchorsOf(const fs::path& document) {
  std::set<std::string> anchors;
  for (const std::string& line : proseOf(document)) {
    if (line.rfind('#', 0) == 0) anchors.insert(anchorOf(line));
  }
  return anchors;
}

TEST(Documents, HaveRelativeLinksThatResolve) {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  const fs::path root = source ? source : ".";
  const std::regex link(R"(\]\(([^)\s]+)\))");
  int links = 0;
  for (const fs::path& document : documents(root)) {
    std::string prose;  // a link's text may be on two lines
    for (const std::string& line : proseOf(document)) prose += line + '\n';
    for (std::sregex_iterator i(prose.begin(), prose.end(), link), end; i != end; ++i) {
      const std::string target = (*i)[1];
      if (target.find("://") != std::string::npos) continue;
      ++links;
      const std::size_t hash = target.find('#');
      const std::string file = target.substr(0, hash);
      const fs::path path = file.empty() ? document : document.parent_path() / file;
      EXPECT_TRUE(fs::exists(path)) << document << " links " << target;
      if (hash == std::string::npos || path.extension() != ".md" || !fs::exists(path)) continue;
      EXPECT_EQ(anchorsOf(path).count(target.substr(hash + 1)), 1u)
          << document << " links " << target << ": no such heading";
    }
  }
  EXPECT_GT(links, 200);
}

}  // namespace
}  // namespace omnifleet
