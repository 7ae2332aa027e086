#include "common/host_clock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <thread>

namespace omnifleet::services {
namespace {

TimeNs clockTime(clockid_t id) {
  timespec now{};
  ::clock_gettime(id, &now);
  return static_cast<TimeNs>(now.tv_sec) * 1000000000 + now.tv_nsec;
}

/// Differs after every boot, which restarts the monotonic clock.
std::string bootId() {
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string id;
  std::getline(file, id);
  return id;
}

}  // namespace

ClockReading readHostClocks() {
  constexpr int kTries = 3;  // the process may lose the processor between two readings
  ClockReading best;
  TimeNs shortest = std::numeric_limits<TimeNs>::max();
  for (int i = 0; i < kTries; ++i) {
    const TimeNs before = clockTime(CLOCK_BOOTTIME), system = clockTime(CLOCK_REALTIME);
    const TimeNs after = clockTime(CLOCK_BOOTTIME);
    if (after - before >= shortest) continue;
    shortest = after - before;
    best = {system, before + (after - before) / 2};
  }
  return best;
}

HostClock::HostClock(ReadClocks read) : read_(std::move(read)), offset_ns_(0) {
  const ClockReading now = read_();
  offset_ns_ = now.system_ns - now.monotonic_ns;
}

TimeNs HostClock::jump() const {
  const ClockReading now = read_();
  return now.system_ns - (now.monotonic_ns + offset_ns_);
}

SharedClock::SharedClock(const std::string& out, ReadClocks read) : clock_(read) {
  if (out.empty()) return;
  file_ = ::open((out + "/.clock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file_ < 0) return;
  if (::flock(file_, LOCK_EX | LOCK_NB) == 0) {
    publishOffset();
    ::flock(file_, LOCK_SH | LOCK_NB);
    return;
  }
  // The process that begins the run holds the exclusive lock for a moment. flock() has no timeout, and that
  // process may be suspended meanwhile, so this polls.
  constexpr int kTries = 50;
  constexpr auto kPause = std::chrono::milliseconds(10);
  bool locked = false;
  for (int i = 0; i < kTries && !locked; ++i) {
    locked = ::flock(file_, LOCK_SH | LOCK_NB) == 0;
    if (!locked) std::this_thread::sleep_for(kPause);
  }
  if (const auto offset_ns = agreedOffset(); locked && offset_ns)
    clock_ = HostClock(std::move(read), *offset_ns);
}

SharedClock::~SharedClock() {
  if (file_ >= 0) ::close(file_);
}

void SharedClock::publishOffset() const {
  const std::string line = fmt::format("{} {}\n", bootId(), clock_.offset());
  if (::ftruncate(file_, 0) != 0) return;
  // Without the line another process uses its own clock.
  [[maybe_unused]] const auto written = ::pwrite(file_, line.data(), line.size(), 0);
}

std::optional<TimeNs> SharedClock::agreedOffset() const {
  std::array<char, 128> text{};
  const auto size = ::pread(file_, text.data(), text.size() - 1, 0);
  const std::string boot = bootId() + " ";
  if (size <= 0 || std::string(text.data()).rfind(boot, 0) != 0) return std::nullopt;
  char* end = nullptr;
  const long long offset_ns = std::strtoll(text.data() + boot.size(), &end, 10);
  if (*end != '\n') return std::nullopt;
  return offset_ns;
}

ClockWatch::ClockWatch(const HostClock& clock, TimeNs limit_ns)
    : clock_(clock), limit_ns_(limit_ns), reported_ns_(clock.jump()) {}

TimeNs ClockWatch::check() {
  const TimeNs jump_ns = clock_.jump();
  const TimeNs change_ns = jump_ns - reported_ns_;
  if (std::abs(change_ns) < limit_ns_) return 0;
  reported_ns_ = jump_ns;
  return change_ns;
}

std::string clockSet(TimeNs jump_ns) {
  return fmt::format("set {} by {:.3f} s", jump_ns < 0 ? "back" : "forward",
                     1e-9 * static_cast<double>(std::abs(jump_ns)));
}

}  // namespace omnifleet::services
