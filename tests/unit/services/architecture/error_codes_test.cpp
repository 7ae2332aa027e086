// Every error code of topic service/status is documented.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "observation/error_code.h"

namespace omnifleet {
namespace {

std::set<std::string> linesOf(const std::string& name) {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  std::ifstream file(std::filesystem::path(source ? source : ".") / name);
  EXPECT_TRUE(file.is_open()) << name;
  std::set<std::string> lines;
  for (std::string line; std::getline(file, line);) {
    line.erase(line.find_last_not_of(" \t\r") + 1);
    lines.insert(line);
  }
  return lines;
}

bool anyContains(const std::set<std::string>& lines, const std::string& text) {
  for (const std::string& line : lines) {
    if (line.find(text) != std::string::npos) return true;
  }
  return false;
}

TEST(ErrorCodes, AreDocumentedInIdlReadmeAndTroubleshootingGuide) {
  const std::set<std::string> contract = linesOf("idl/README.md");
  const std::set<std::string> guide = linesOf("docs/guide/troubleshooting.md");
  for (int i = 1; i < static_cast<int>(ErrorCode::kCount); ++i) {
    const std::string code = toString(static_cast<ErrorCode>(i));
    EXPECT_TRUE(anyContains(contract, "`" + code + "`")) << code << " is missing in idl/README.md";
    EXPECT_EQ(guide.count("## " + code), 1u) << code << " has no section in docs/guide/troubleshooting.md";
  }
}

}  // namespace
}  // namespace omnifleet
