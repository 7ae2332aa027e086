#pragma once

#include <sys/types.h>
#include <set>

namespace omnifleet::supervisor {

/// During its lifetime this process is the reaper of its descendants' orphans (PR_SET_CHILD_SUBREAPER): the
/// processes that a child started and left behind become children of this process. Earlier children are
/// ignored.
class Orphans {
 public:
  Orphans();
  ~Orphans();
  Orphans(const Orphans&) = delete;
  Orphans& operator=(const Orphans&) = delete;

  /// Reaps adopted orphans that have ended, without waiting.
  void reap();
  /// Kills and reaps every child since construction, and the orphans that those leave behind.
  void killAll();

 private:
  std::set<pid_t> before_;
  int was_reaper_ = 0;
};

}  // namespace omnifleet::supervisor
