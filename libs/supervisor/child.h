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

/// A started process. It has its own process group, stdin /dev/null, a clear signal mask, and no inherited
/// descriptors except stdout and stderr. The kernel kills it when the thread that started it ends.
struct Child {
  pid_t pid = -1;
  Descriptor pidfd;
};

/// How a process ended.
struct ExitStatus {
  bool exited = false;  ///< false: killed by a signal
  int value = 0;        ///< exit code or signal number
  std::string describe() const;
  /// SIGHUP, SIGINT or SIGTERM, if it ended the process: in order (128 + number) or before it handled
  /// signals. 0: none of them.
  int stopSignal() const;
};

/// SIGHUP (unless this process ignores it, as under nohup), SIGINT and SIGTERM.
sigset_t stopSignals();

/// Throws std::runtime_error ("NAME: …: reason") when the log cannot be opened or the program cannot be
/// executed.
Child spawn(const ProcessSpec& spec);

/// Reaps a child whose pidfd is readable.
ExitStatus reap(const Child& child);

/// Appends one line to the log of a process.
void appendToLog(const ProcessSpec& spec, const std::string& line);

}  // namespace omnifleet::supervisor
