#include "launch/progress.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <map>
#include <memory>
#include <optional>
#include <system_error>

#include "bus/topics.h"
#include "launch/console.h"
#include "launch/watch.h"

namespace omnifleet::launch {

using std::chrono::steady_clock;

std::string progressLine(std::uint64_t done, const ExpectedFrames& expected, double seconds, bool ended) {
  // A rate over less than one second is not meaningful.
  const double rate = seconds >= 1.0 ? static_cast<double>(done) / seconds : 0.0;
  const std::uint64_t total = expected.frames;
  const std::string share = total > 0 && !expected.at_most ? fmt::format("/{}", total) : "";
  std::string line =
      fmt::format("{}{} {} per robot", done, share, done == 1 && share.empty() ? "frame" : "frames");
  if (expected.at_most) line += fmt::format(" (at most {})", total);
  if (ended && total > 0 && done < total && !expected.at_most) line += " (robot with the fewest frames)";
  if (rate > 0) line += fmt::format(", {:.1f} frames/s", rate);
  if (total == 0) return line + fmt::format(", {:.0f} s", seconds);
  if (rate > 0 && done < total && !ended) {
    line += fmt::format(", {}{:.0f} s left", expected.at_most ? "at most " : "",
                        static_cast<double>(total - done) / rate);
  }
  return line;
}

namespace {

/// Lines from the launcher.
class Notes {
 public:
  explicit Notes(int pipe_end) : pipe_end_(pipe_end) { fcntl(pipe_end, F_SETFL, O_NONBLOCK); }

  /// Calls `note(line)` for each complete line. Returns false when the other end is closed.
  template <class Note>
  bool read(Note note) {
    char bytes[512];
    for (ssize_t size = 0; (size = ::read(pipe_end_, bytes, sizeof bytes)) != 0;) {
      if (size < 0) return errno == EAGAIN || errno == EINTR;
      text_.append(bytes, static_cast<std::size_t>(size));
      for (std::size_t end = 0; (end = text_.find('\n')) != std::string::npos; text_.erase(0, end + 1))
        note(text_.substr(0, end));
    }
    return false;
  }

 private:
  int pipe_end_;
  std::string text_;
};

/// The process that listens to service/status.
class Listener {
 public:
  explicit Listener(const Listening& listening)
      : expected_(listening.expected),
        host_(listening.host),
        terminal_(isatty(STDERR_FILENO) == 1),
        interval_(terminal_ ? 200 : 5000),
        bus_(bus::makeDdsBus(listenerOptions(listening))),
        reader_(bus_->reader(topics_.service_status)),
        watch_(*bus_, topics_, expected(listening), listening.host, steady_clock::now()) {}

  /// Runs until the other end of the pipe is closed.
  void run(int pipe_end) {
    Notes notes(pipe_end);
    while (notes.read([&](const std::string& what) { watch_.failing(what, steady_clock::now()); })) {
      bus_->wait(std::chrono::milliseconds(100));
      while (reader_->take(sample_)) onStatus();
      for (const std::string& change : watch_.check(steady_clock::now())) printLine(change);
      showWhenDue();
    }
    if (shown_ > 0) show("\n", true);
  }

 private:
  /// The services of this host and the launchers of the other ones.
  static std::vector<std::string> expected(const Listening& listening) {
    std::vector<std::string> names = listening.services;
    for (const std::string& host : listening.other_hosts) names.push_back("launch " + host);
    return names;
  }

  void onStatus() {
    const std::string service = sample_.service().to_string(), instance = sample_.instance().to_string();
    if (service == "launch" && instance == host_) return;  // this launcher publishes it itself
    const std::string name = instance.empty() ? service : service + " " + instance;
    const std::string error = sample_.last_error().to_string();
    if (!error.empty() && last_error_[name] != error) {
      last_error_[name] = error;
      printLine(name + ": [" + sample_.error_code().to_string() + "] " + error);
    }
    if (service == "global_merger") done_[instance] = sample_.processed();
    watch_.heard(name, sample_.state() == v1::SERVICE_FINISHED, steady_clock::now());
  }

  void printLine(const std::string& line) const { print((terminal_ ? "\r\033[K" : "") + line + "\n"); }

  void showWhenDue() {
    std::uint64_t least = done_.empty() ? 0 : UINT64_MAX;
    for (const auto& [merger, count] : done_) least = std::min(least, count);
    if (least > 0 && !first_frame_) first_frame_ = steady_clock::now();
    const bool due = least > shown_ && steady_clock::now() - printed_ >= interval_;
    shown_ = std::max(shown_, least);
    if (!due) return;
    printed_ = steady_clock::now();
    show(terminal_ ? "" : "\n", false);
  }

  void show(const char* end, bool ended) const {
    const double seconds =
        first_frame_ ? std::chrono::duration<double>(steady_clock::now() - *first_frame_).count() : 0.0;
    print((terminal_ ? "\r\033[K" : "") + progressLine(shown_, expected_, seconds, ended) + end);
  }

  ExpectedFrames expected_;
  std::string host_;
  bool terminal_;
  std::chrono::milliseconds interval_;
  bus::Topics topics_{bus::RunMode::kLive};
  std::unique_ptr<bus::Bus> bus_;
  std::unique_ptr<bus::Reader<v1::ServiceStatus>> reader_;
  Watch watch_;
  v1::ServiceStatus sample_;
  std::map<std::string, std::uint64_t> done_;      // per merger
  std::map<std::string, std::string> last_error_;  // per process
  std::optional<steady_clock::time_point> first_frame_;
  steady_clock::time_point printed_ = steady_clock::now();
  std::uint64_t shown_ = 0;
};

}  // namespace

bus::DdsBusOptions listenerOptions(const Listening& listening) {
  bus::DdsBusOptions options;
  options.name = "omnifleet_launch";
  options.domain = listening.domain;
  listening.network.apply(options);
  if (!listening.network.leavesHost()) options.lease = std::chrono::seconds(30);
  return options;
}

Progress::Progress(const Listening& listening) {
  int ends[2] = {-1, -1};
  if (pipe2(ends, O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  listener_ = fork();
  if (listener_ < 0) {
    const int error = errno;
    for (const int end : ends) close(end);
    throw std::system_error(error, std::generic_category(), "fork");
  }
  if (listener_ == 0) {
    close(ends[1]);
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // the launcher may be killed while this process hangs
    try {
      Listener(listening).run(ends[0]);
    } catch (const std::exception& error) {
      print(std::string("progress display not available: ") + error.what() + "\n");
    }
    _exit(0);
  }
  close(ends[0]);
  pipe_ = ends[1];
  fcntl(pipe_, F_SETFL, O_NONBLOCK);
}

void Progress::noteFailing(const std::string& what) {
  const std::string line = what + "\n";
  // A full pipe: the listener hangs, and the note would have no reader.
  if (write(pipe_, line.data(), line.size()) < 0) return;
}

Progress::~Progress() {
  close(pipe_);
  // Deadlock between discovery and a timer of Fast DDS 2.9 (docs/methods/dds.md).
  const int pid_fd = static_cast<int>(syscall(SYS_pidfd_open, listener_, 0));
  pollfd ended{pid_fd, POLLIN, 0};
  const bool hangs =
      pid_fd >= 0 && poll(&ended, 1, static_cast<int>(std::chrono::milliseconds(kEnd).count())) == 0;
  if (pid_fd >= 0) close(pid_fd);
  if (hangs) kill(listener_, SIGKILL);
  int status = 0;
  while (waitpid(listener_, &status, 0) < 0 && errno == EINTR) {
  }
  if (hangs) {
    print("the progress display did not end and was killed; the run is not affected\n");
  } else if (WIFSIGNALED(status)) {
    print(
        fmt::format("the progress display ended by signal {}; the run is not affected\n", WTERMSIG(status)));
  }
}

}  // namespace omnifleet::launch
