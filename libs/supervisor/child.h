#pragma once

#include <sys/types.h>
#include <string>

#include "supervisor/supervisor.h"

namespace omnifleet::supervisor {

/// A file descriptor with an owner.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() { reset(); }
  Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept;
  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  int release();
  void reset();

 private:
  int fd_ = -1;
};

/// A started process: in a process group of its own, stdin /dev/null, no descriptor inherited beyond stdout
/// and stderr, signal mask clear, killed by the kernel when the thread that started it dies.
struct Child {
  pid_t pid = -1;
  Descriptor pidfd;
};

/// How a process ended.
struct Death {
  bool exited = false;  ///< else killed
  int value = 0;        ///< exit code or signal
  std::string describe() const;
};

/// Throws std::runtime_error ("NAME: …: reason") where the log cannot be opened, or the program not be
/// executed.
Child spawn(const ProcessSpec& spec);

/// Reaps a child whose pidfd is readable.
Death reap(const Child& child);

/// Appends one line to a process's log.
void appendToLog(const ProcessSpec& spec, const std::string& line);

}  // namespace omnifleet::supervisor
