#pragma once

// External test data and temporary folders for tests.

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace omnifleet::test {

/// Path of `name` in the folder of the external test data ($OMNIFLEET_DATA, default ../shared/data beside the
/// sources); empty when it does not exist. Use with OMNIFLEET_NEEDS_DATA.
inline std::string dataPath(const std::string& name) {
  const char* own = std::getenv("OMNIFLEET_DATA");
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  const std::filesystem::path base =
      own ? std::filesystem::path(own)
          : std::filesystem::path(source ? source : ".") / ".." / "shared" / "data";
  const std::filesystem::path path = base / name;
  return std::filesystem::exists(path) ? path.string() : std::string();
}

/// A new temporary folder; the destructor removes it.
class TempFolder {
 public:
  TempFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "omnifleet-test-XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace omnifleet::test

/// Defines `path`, or skips the test with a message.
#define OMNIFLEET_NEEDS_DATA(path, name)                    \
  const std::string path = omnifleet::test::dataPath(name); \
  if (path.empty()) GTEST_SKIP() << "test data missing: " << (name)
