#include "bus/wake_event.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <stdexcept>

namespace omnifleet::bus {

WakeEvent::WakeEvent() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0) throw std::runtime_error("eventfd failed: no file descriptor left");
}

WakeEvent::~WakeEvent() {
  ::close(fd_);
}

void WakeEvent::signal() noexcept {
  const int saved = errno;
  const std::uint64_t one = 1;
  // Fails only when the counter is full; the event is then signalled already.
  [[maybe_unused]] const auto written = ::write(fd_, &one, sizeof one);
  errno = saved;
}

bool WakeEvent::wait(std::chrono::nanoseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    std::uint64_t count = 0;
    if (::read(fd_, &count, sizeof count) == sizeof count) return true;
    const auto left = deadline - std::chrono::steady_clock::now();
    if (left <= std::chrono::nanoseconds(0)) return false;
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec duration{seconds.count(), static_cast<long>((left - seconds).count())};
    pollfd descriptor{fd_, POLLIN, 0};
    ::ppoll(&descriptor, 1, &duration, nullptr);  // on EINTR the handler may have signalled; the loop checks
  }
}

}  // namespace omnifleet::bus
