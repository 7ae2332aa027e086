#include "launch/progress.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <system_error>

#include "bus/dds_bus.h"
#include "bus/topics.h"

namespace omnifleet::launch {

using std::chrono::steady_clock;

std::string progressLine(std::uint64_t done, const ExpectedFrames& expected, double seconds, bool ended) {
  // Over less than a second a rate says nothing.
  const double rate = seconds >= 1.0 ? static_cast<double>(done) / seconds : 0.0;
  const std::uint64_t total = expected.frames;
  const std::string share = total > 0 && !expected.at_most ? fmt::format("/{}", total) : "";
  std::string line = fmt::format("{}{} frames per robot", done, share);
  if (expected.at_most) line += fmt::format(" (at most {})", total);
  if (rate > 0) line += fmt::format(", {:.1f} frames/s", rate);
  if (total == 0) return line + fmt::format(", {:.0f} s", seconds);
  if (rate > 0 && done < total && !ended) {
    line += fmt::format(", {}{:.0f} s left", expected.at_most ? "at most " : "",
                        static_cast<double>(total - done) / rate);
  }
  return line;
}

namespace {

bool closed(int pipe_end) {
  pollfd state{pipe_end, POLLIN, 0};
  return poll(&state, 1, 0) > 0;
}

/// Until `stop` is closed at its other end.
void listen(int domain, const ExpectedFrames& expected, int stop) {
  bus::DdsBusOptions options;
  options.name = "omnifleet_launch";
  options.domain = domain;
  options.lease = std::chrono::seconds(30);  // a busy machine must not make the fleet think that it has gone
  const auto bus = bus::makeDdsBus(options);
  auto reader = bus->reader(bus::Topics(bus::RunMode::kLive).service_status);
  const bool terminal = isatty(STDERR_FILENO) == 1;
  const auto interval = std::chrono::milliseconds(terminal ? 200 : 5000);
  std::map<std::string, std::uint64_t> done;      // of each merger
  std::map<std::string, std::string> last_error;  // of each process
  v1::ServiceStatus sample;
  std::optional<steady_clock::time_point> first_frame;
  auto printed = steady_clock::now();
  std::uint64_t shown = 0;
  const auto show = [&](const char* end, bool ended) {
    const double seconds =
        first_frame ? std::chrono::duration<double>(steady_clock::now() - *first_frame).count() : 0.0;
    std::fprintf(stderr, "%s%s%s", terminal ? "\r\033[K" : "",
                 progressLine(shown, expected, seconds, ended).c_str(), end);
  };
  while (!closed(stop)) {
    bus->wait(std::chrono::milliseconds(100));
    while (reader->take(sample)) {
      const std::string service = sample.service().to_string(), instance = sample.instance().to_string();
      const std::string who = instance.empty() ? service : service + " " + instance;
      const std::string error = sample.last_error().to_string();
      if (!error.empty() && last_error[who] != error) {
        last_error[who] = error;
        std::fprintf(stderr, "%s%s: %s\n", terminal ? "\r\033[K" : "", who.c_str(), error.c_str());
      }
      if (service == "global_merger") done[instance] = sample.processed();
    }
    std::uint64_t least = done.empty() ? 0 : UINT64_MAX;
    for (const auto& [merger, count] : done) least = std::min(least, count);
    if (least > 0 && !first_frame) first_frame = steady_clock::now();
    if (least > shown && steady_clock::now() - printed >= interval) {
      shown = least;
      printed = steady_clock::now();
      show(terminal ? "" : "\n", false);
    }
    shown = std::max(shown, least);
  }
  if (shown > 0) show("\n", true);
}

}  // namespace

Progress::Progress(int domain, const ExpectedFrames& expected) {
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
    try {
      listen(domain, expected, ends[0]);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "no progress is shown: %s\n", error.what());
    }
    std::fflush(nullptr);
    _exit(0);
  }
  close(ends[0]);
  stop_ = ends[1];
}

Progress::~Progress() {
  close(stop_);
  int status = 0;
  while (waitpid(listener_, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status))
    std::fprintf(stderr, "the progress line was lost (signal %d); the run was not touched\n",
                 WTERMSIG(status));
}

}  // namespace omnifleet::launch
