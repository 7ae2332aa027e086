#pragma once

#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <optional>
#include <string>

namespace omnifleet::bus {

/// Runs `work` in a child process with namespaces of its own (unshare(2) flags), with its own /proc if the
/// namespace of process numbers is one of them, and with its own /dev/shm of `shared_memory` ("size=64m") if
/// that is not empty. @return the text that `work` returns; empty optional when this user may not do that
inline std::optional<std::string> inNamespace(int flags, const std::string& shared_memory,
                                              const std::function<std::string()>& work) {
  constexpr int kNotPermitted = 77;
  int ends[2];
  if (::pipe(ends) != 0) return std::nullopt;
  const pid_t child = ::fork();
  if (child == 0) {
    if (::unshare(flags | CLONE_NEWNS) != 0 ||
        ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
      ::_exit(kNotPermitted);
    if (!shared_memory.empty() && ::mount("tmpfs", "/dev/shm", "tmpfs", 0, shared_memory.c_str()) != 0)
      ::_exit(kNotPermitted);
    const pid_t inner = ::fork();  // the first process of a new namespace of process numbers
    if (inner == 0) {
      if ((flags & CLONE_NEWPID) && ::mount("proc", "/proc", "proc", 0, nullptr) != 0) ::_exit(kNotPermitted);
      std::string text;
      try {
        text = work();
      } catch (const std::exception& error) {
        text = std::string("exception: ") + error.what();
      }
      ::_exit(::write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()) ? 0 : 1);
    }
    int status = 0;
    ::waitpid(inner, &status, 0);
    ::_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
  }
  ::close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t got = 0; (got = ::read(ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNotPermitted) return std::nullopt;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? text : "the child process failed: " + text;
}

}  // namespace omnifleet::bus
