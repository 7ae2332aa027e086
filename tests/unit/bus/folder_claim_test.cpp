// A run directory belongs to one fleet at a time.

#include "bus/folder_claim.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

#include "options/options.h"

namespace omnifleet::bus {
namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

class RunDirectory : public testing::Test {
 protected:
  RunDirectory() { fs::create_directories(folder); }
  ~RunDirectory() override { fs::remove_all(folder); }
  /// Empty when the directory can be claimed.
  std::string problem(const std::string& fleet, const std::string& host) const {
    try {
      const FolderClaim claim(folder, fleet, host);
    } catch (const options::Error& error) {
      return error.what();
    }
    return {};
  }
  std::string folder = (fs::path(testing::TempDir()) / ("claim" + std::to_string(::getpid()))).string();
};

TEST_F(RunDirectory, IsRefusedToSecondFleetUntilFirstOneEnds) {
  {
    const FolderClaim claim(folder, "/fleets/a.yaml", "");
    EXPECT_THAT(problem("/fleets/b.yaml", ""),
                AllOf(HasSubstr("--out " + folder), HasSubstr("/fleets/a.yaml"), HasSubstr(folder + "_2")));
    EXPECT_NE(problem("/fleets/a.yaml", ""), "") << "the same fleet a second time";
    EXPECT_NE(problem("/fleets/a.yaml", "pcA"), "");
  }
  EXPECT_TRUE(fs::is_empty(folder));
  EXPECT_EQ(problem("/fleets/b.yaml", ""), "");
}

TEST_F(RunDirectory, IsSharedByPartsOfOneFleet) {
  {
    const FolderClaim claim(folder, "/fleets/a.yaml", "pcA");
    EXPECT_EQ(problem("/fleets/a.yaml", "pcB"), "");
    const FolderClaim other(folder, "/fleets/a.yaml", "pcB");
    EXPECT_THAT(problem("/fleets/a.yaml", "pcA"), HasSubstr("/fleets/a.yaml, --host pcA"));
    EXPECT_NE(problem("/fleets/a.yaml", ""), "") << "the whole fleet";
    EXPECT_NE(problem("/fleets/b.yaml", "pcC"), "") << "a part of another fleet";
  }
  EXPECT_TRUE(fs::is_empty(folder));
  EXPECT_EQ(problem("/fleets/b.yaml", "pcC"), "");
}

TEST_F(RunDirectory, IsFreeAfterLauncherWasKilled) {
  const pid_t child = ::fork();
  if (child == 0) {
    const FolderClaim claim(folder, "/fleets/a.yaml", "pcA");
    ::raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_FALSE(fs::is_empty(folder));
  EXPECT_EQ(problem("/fleets/b.yaml", "pcA"), "");
  EXPECT_EQ(problem("/fleets/b.yaml", ""), "");
}

}  // namespace
}  // namespace omnifleet::bus
