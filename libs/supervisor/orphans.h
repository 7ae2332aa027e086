#pragma once

#include <sys/types.h>
#include <set>

namespace omnifleet::supervisor {

/// While it lives, this process is the reaper of its descendants' orphans (PR_SET_CHILD_SUBREAPER): what a
/// child started and left behind comes here and is not lost. Children that were there before are not touched.
class Orphans {
 public:
  Orphans();
  ~Orphans();
  Orphans(const Orphans&) = delete;
  Orphans& operator=(const Orphans&) = delete;

  /// Buries adopted orphans that have died, without waiting.
  void reap();
  /// Kills and buries every child that came since; also what those leave behind.
  void killAll();

 private:
  std::set<pid_t> before_;
  int was_reaper_ = 0;
};

}  // namespace omnifleet::supervisor
