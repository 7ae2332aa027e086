#include "launch/console.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>

namespace omnifleet::launch {
namespace {

/// stderr of this process as a pipe, for the lifetime of the object.
class StderrPipe {
 public:
  StderrPipe() : before_(dup(STDERR_FILENO)) {
    int ends[2];
    if (pipe(ends) != 0) abort();
    dup2(ends[1], STDERR_FILENO);
    close(ends[1]);
    reader_ = ends[0];
  }
  ~StderrPipe() {
    dup2(before_, STDERR_FILENO);
    close(before_);
    closeReader();
  }
  void closeReader() {
    if (reader_ >= 0) close(reader_);
    reader_ = -1;
  }
  std::string read() const {
    std::string text(1 << 20, '\0');
    const ssize_t size = ::read(reader_, text.data(), text.size());
    return text.substr(0, size < 0 ? 0 : static_cast<std::size_t>(size));
  }

 private:
  int before_, reader_ = -1;
};

TEST(Print, WritesWhatIsRead) {
  const StderrPipe pipe;
  print("one\n");
  print("two\n");
  EXPECT_EQ(pipe.read(), "one\ntwo\n");
}

/// A pager that was stopped: the launcher must go on.
TEST(Print, DropsWhatNobodyReads) {
  const StderrPipe pipe;
  const std::string text(1 << 22, 'x');  // more than any pipe holds
  print(text);
  const std::string got = pipe.read();
  EXPECT_GT(got.size(), 0u);
  EXPECT_LT(got.size(), text.size());
}

TEST(Print, SurvivesReaderThatIsGone) {
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  {
    StderrPipe pipe;
    pipe.closeReader();
    print("nobody\n");
  }
  std::signal(SIGPIPE, before);
}

}  // namespace
}  // namespace omnifleet::launch
