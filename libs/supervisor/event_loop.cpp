#include "supervisor/event_loop.h"

#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <stdexcept>

namespace omnifleet::supervisor {
namespace {

constexpr std::uint64_t kSignalKey = ~0ULL, kTimerKey = ~0ULL - 1;

int checked(int result, const char* what) {
  if (result < 0) throw std::runtime_error(std::string(what) + ": " + std::strerror(errno));
  return result;
}

void add(int epoll, int fd, std::uint64_t key) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = key;
  checked(epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event), "epoll_ctl");
}

itimerspec at(double deadline_s) {
  itimerspec spec{};
  if (!std::isfinite(deadline_s)) return spec;  // disarmed
  const double whole = std::floor(deadline_s);
  spec.it_value.tv_sec = static_cast<time_t>(whole);
  spec.it_value.tv_nsec = std::max(1L, static_cast<long>((deadline_s - whole) * 1e9));
  return spec;
}

}  // namespace

EventLoop::EventLoop() {
  const sigset_t stops = stopSignals();
  epoll_ = Descriptor(checked(epoll_create1(EPOLL_CLOEXEC), "epoll_create1"));
  signals_ = Descriptor(checked(signalfd(-1, &stops, SFD_CLOEXEC | SFD_NONBLOCK), "signalfd"));
  timer_ = Descriptor(checked(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK), "timerfd_create"));
  add(epoll_.get(), signals_.get(), kSignalKey);
  add(epoll_.get(), timer_.get(), kTimerKey);
}

void EventLoop::watch(const Child& child, std::uint64_t key) {
  add(epoll_.get(), child.pidfd.get(), key);
}

double EventLoop::clock() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Events EventLoop::wait(double deadline_s) {
  const itimerspec spec = at(deadline_s);
  checked(timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr), "timerfd_settime");
  std::array<epoll_event, 64> ready;
  const int count = epoll_wait(epoll_.get(), ready.data(), static_cast<int>(ready.size()), -1);
  if (count < 0 && errno != EINTR) checked(count, "epoll_wait");
  Events events;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t key = ready[static_cast<std::size_t>(i)].data.u64;
    signalfd_siginfo info{};
    if (key == kSignalKey) {
      if (read(signals_.get(), &info, sizeof(info)) == sizeof(info))
        events.stop_signal = static_cast<int>(info.ssi_signo);
    } else if (key != kTimerKey) {
      events.ended.push_back(key);
    }
  }
  return events;
}

}  // namespace omnifleet::supervisor
