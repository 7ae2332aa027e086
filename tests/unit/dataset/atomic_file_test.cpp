#include "dataset/atomic_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <fstream>

#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::HasSubstr;

std::size_t filesIn(const std::string& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(WriteAtomic, ReplacesWholeFileAndLeavesNoTemporary) {
  const test::TempFolder folder;
  writeAtomic(folder / "deep/er/map.txt", "first");
  writeAtomic(folder / "deep/er/map.txt", std::string(100000, 'x'));
  EXPECT_EQ(readFile(folder / "deep/er/map.txt"), std::string(100000, 'x'));
  EXPECT_EQ(filesIn(folder / "deep/er"), 1u);
}

/// Limits the size of files that this process writes, while it exists. write() then fails as on a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &old_);
    rlimit limit = old_;
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { ::setrlimit(RLIMIT_FSIZE, &old_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit old_{};
};

TEST(WriteAtomic, ReportsFailedWriteAndKeepsOldFile) {
  const test::TempFolder folder;
  writeAtomic(folder / "map.txt", "old");
  std::string message;
  {
    const FileSizeLimit limit(1000);
    try {
      writeAtomic(folder / "map.txt", std::string(100000, 'x'));
    } catch (const std::runtime_error& error) {
      message = error.what();
    }
  }
  EXPECT_THAT(message, HasSubstr("map.txt: cannot be written: File too large"));
  EXPECT_EQ(readFile(folder / "map.txt"), "old");
  EXPECT_EQ(filesIn(folder.path()), 1u) << "no temporary file remains";
}

TEST(WriteAtomic, NamesTargetThatCannotBeCreated) {
  const test::TempFolder folder;
  writeAtomic(folder / "file", "x");
  try {
    writeAtomic(folder / "file/below/map.txt", "y");
    FAIL() << "a file accepted as a directory";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("file/below: cannot be created"));
  }
}

TEST(AtomicFile, ChangesTargetOnlyOnCommit) {
  const test::TempFolder folder;
  writeAtomic(folder / "map.bt", "old");
  {
    const AtomicFile file(folder / "map.bt");
    EXPECT_EQ(std::filesystem::path(file.temporaryPath()).extension(), ".bt");
    std::ofstream(file.temporaryPath()) << "half";
  }
  EXPECT_EQ(readFile(folder / "map.bt"), "old") << "without commit nothing changes";
  AtomicFile file(folder / "map.bt");
  std::ofstream(file.temporaryPath()) << "new";
  file.commit();
  EXPECT_EQ(readFile(folder / "map.bt"), "new");
  AtomicFile never(folder / "never.bt");
  EXPECT_THROW(never.commit(), std::runtime_error) << "nothing was written";
}

TEST(ReadFile, RejectsMissingFileAndFolder) {
  const test::TempFolder folder;
  EXPECT_THROW(readFile(folder / "missing"), std::runtime_error);
  EXPECT_THROW(readFile(folder.path()), std::runtime_error);
}

}  // namespace
}  // namespace omnifleet::dataset
