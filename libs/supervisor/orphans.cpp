#include "supervisor/orphans.h"

#include <sys/prctl.h>
#include <sys/wait.h>

#include <csignal>
#include <filesystem>
#include <fstream>

namespace omnifleet::supervisor {
namespace {

/// Direct children of this process, including zombies.
std::set<pid_t> children() {
  std::set<pid_t> result;
  std::error_code ignored;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    std::ifstream file(task.path() / "children");
    for (pid_t pid = 0; file >> pid;) result.insert(pid);
  }
  return result;
}

}  // namespace

Orphans::Orphans() : before_(children()) {
  prctl(PR_GET_CHILD_SUBREAPER, &was_reaper_);
  prctl(PR_SET_CHILD_SUBREAPER, 1);
}

Orphans::~Orphans() {
  prctl(PR_SET_CHILD_SUBREAPER, was_reaper_);
}

void Orphans::reap() {
  for (const pid_t pid : children()) {
    if (before_.count(pid) == 0 && getpgid(pid) != pid) waitpid(pid, nullptr, WNOHANG);
  }
}

void Orphans::killAll() {
  for (bool any = true; any;) {
    any = false;
    for (const pid_t pid : children()) {
      if (before_.count(pid) != 0) continue;
      kill(pid, SIGKILL);
      any |= waitpid(pid, nullptr, 0) == pid;
    }
  }
}

}  // namespace omnifleet::supervisor
