#include "supervisor/child.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace omnifleet::supervisor {
namespace {

constexpr int kStopped = 128;  // exit code offset of programs that end in order after a signal

bool ignoresHangup() {
  struct sigaction action {};
  sigaction(SIGHUP, nullptr, &action);
  return action.sa_handler == SIG_IGN;
}

[[noreturn]] void fail(const std::string& name, const std::string& what, int error) {
  throw std::runtime_error(fmt::format("{}: {}: {}", name, what, std::strerror(error)));
}

/// Path of the program. Resolved before the fork, because the child must not search PATH between fork and
/// exec.
std::string resolve(const std::string& program) {
  if (program.find('/') != std::string::npos) return program;
  const char* path = std::getenv("PATH");
  std::string folders = path ? path : "/usr/bin:/bin";
  for (std::size_t begin = 0; begin <= folders.size();) {
    const std::size_t end = std::min(folders.find(':', begin), folders.size());
    const std::string candidate = folders.substr(begin, end - begin) + "/" + program;
    if (access(candidate.c_str(), X_OK) == 0) return candidate;
    begin = end + 1;
  }
  return program;
}

std::vector<std::string> environment(const ProcessSpec& spec) {
  std::vector<std::string> result;
  for (char** entry = environ; *entry; ++entry) {
    const std::string text = *entry;
    if (spec.env.count(text.substr(0, text.find('='))) == 0) result.push_back(text);
  }
  for (const auto& [key, value] : spec.env) result.push_back(key + "=" + value);
  return result;
}

std::vector<char*> pointers(std::vector<std::string>& strings) {
  std::vector<char*> result;
  for (std::string& text : strings) result.push_back(text.data());
  result.push_back(nullptr);
  return result;
}

Descriptor openLog(const ProcessSpec& spec) {
  if (spec.log_path.empty()) return Descriptor();
  std::error_code ignored;
  std::filesystem::create_directories(std::filesystem::path(spec.log_path).parent_path(), ignored);
  Descriptor log(open(spec.log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
  if (!log) fail(spec.name, "cannot write " + spec.log_path, errno);
  return log;
}

/// Everything the child needs, created before the fork. Between fork and exec of a multi-threaded program
/// only async-signal-safe calls are allowed.
struct Launch {
  std::string path;
  std::vector<std::string> arguments, variables;
  std::vector<char*> argv, envp;
  int null = -1, log = -1, report = -1;
  bool ignores_hangup = false;
  pid_t parent = -1;
};

[[noreturn]] void becomeChild(const Launch& launch) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != launch.parent) _exit(127);  // the supervisor ended before prctl()
  for (const int number : {SIGINT, SIGTERM, SIGPIPE, SIGCHLD}) signal(number, SIG_DFL);
  signal(SIGHUP, launch.ignores_hangup ? SIG_IGN : SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  dup2(launch.null, STDIN_FILENO);
  if (launch.log >= 0) {
    dup2(launch.log, STDOUT_FILENO);
    dup2(launch.log, STDERR_FILENO);
  }
  syscall(SYS_close_range, 3U, ~0U, 4U /* CLOSE_RANGE_CLOEXEC */);
  execve(launch.path.c_str(), launch.argv.data(), launch.envp.data());
  const int error = errno;
  if (write(launch.report, &error, sizeof(error)) < 0) _exit(126);
  _exit(127);
}

}  // namespace

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  if (this != &other) {
    reset();
    fd_ = other.release();
  }
  return *this;
}

int Descriptor::release() {
  const int fd = fd_;
  fd_ = -1;
  return fd;
}

void Descriptor::reset() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

sigset_t stopSignals() {
  sigset_t stops;
  sigemptyset(&stops);
  if (!ignoresHangup()) sigaddset(&stops, SIGHUP);
  sigaddset(&stops, SIGINT);
  sigaddset(&stops, SIGTERM);
  return stops;
}

int ExitStatus::stopSignal() const {
  const int number = exited ? value - kStopped : value;
  return number == SIGHUP || number == SIGINT || number == SIGTERM ? number : 0;
}

std::string ExitStatus::describe() const {
  if (exited && value > kStopped && value < kStopped + NSIG)
    return fmt::format("stopped by signal {} ({})", value - kStopped, strsignal(value - kStopped));
  return exited ? fmt::format("exit code {}", value)
                : fmt::format("killed by signal {} ({})", value, strsignal(value));
}

Child spawn(const ProcessSpec& spec) {
  const Descriptor log = openLog(spec), null(open("/dev/null", O_RDONLY | O_CLOEXEC));
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) fail(spec.name, "pipe", errno);
  const Descriptor report(ends[0]);
  Descriptor report_in_child(ends[1]);
  Launch launch{resolve(spec.argv.front()),
                spec.argv,
                environment(spec),
                {},
                {},
                null.get(),
                log.get(),
                ends[1],
                ignoresHangup(),
                getpid()};
  launch.argv = pointers(launch.arguments);
  launch.envp = pointers(launch.variables);
  Child child;
  child.pid = fork();
  if (child.pid < 0) fail(spec.name, "fork", errno);
  if (child.pid == 0) becomeChild(launch);
  setpgid(child.pid, child.pid);  // in parent and child, because either may run first
  report_in_child.reset();
  int error = 0;
  ssize_t got = 0;
  do {
    got = read(report.get(), &error, sizeof(error));
  } while (got < 0 && errno == EINTR);
  if (got > 0) {
    waitpid(child.pid, nullptr, 0);
    fail(spec.name, "cannot start " + launch.path, error);
  }
  child.pidfd = Descriptor(static_cast<int>(syscall(SYS_pidfd_open, child.pid, 0)));
  if (!child.pidfd) {
    const int reason = errno;
    kill(child.pid, SIGKILL);
    waitpid(child.pid, nullptr, 0);
    fail(spec.name, "pidfd_open", reason);
  }
  fcntl(child.pidfd.get(), F_SETFD, FD_CLOEXEC);
  return child;
}

ExitStatus reap(const Child& child) {
  siginfo_t info{};
  while (waitid(P_PID, static_cast<id_t>(child.pid), &info, WEXITED) != 0 && errno == EINTR) {
  }
  return {info.si_code == CLD_EXITED, info.si_status};
}

void appendToLog(const ProcessSpec& spec, const std::string& line) {
  if (spec.log_path.empty()) return;
  const Descriptor log(open(spec.log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
  const std::string text = line + "\n";
  if (log && write(log.get(), text.data(), text.size()) < 0) return;  // a full disk must not end the run
}

}  // namespace omnifleet::supervisor
