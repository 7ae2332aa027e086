#pragma once

// Starts the processes of a run, restarts them after failures, and ends them in order. Linux only (signalfd,
// pidfd, timerfd, epoll); no thread, no polling, no sleep. Independent of DDS and of the fleet: the caller
// lists the processes.

#include <sys/types.h>
#include <csignal>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "options/options.h"

namespace omnifleet::supervisor {

enum class RestartPolicy {
  kOnFailure,  ///< restart unless it exits with 0
  kNever,      ///< its failure ends the run
};

struct ProcessSpec {
  std::string name;                ///< unique; names the log and the messages
  std::vector<std::string> argv;   ///< argv[0] is searched in PATH unless it contains a slash
  std::string incarnation_option;  ///< option that receives the incarnation number from the second start on;
                                   ///< empty: none
  std::map<std::string, std::string>
      env;               ///< added to the environment of the supervisor, or replacing its entries
  std::string log_path;  ///< file to which stdout and stderr are appended; empty: inherited
  int level = 0;         ///< started in descending order, stopped in ascending order
  RestartPolicy restart = RestartPolicy::kOnFailure;
  /// Exit code on the first start that means "cannot run" (bad options): no restart, the run ends. 0: none.
  int refusal_code = 0;
  bool sink = false;  ///< the run ends when every sink has exited with 0 by itself
};

struct Options {
  double stop_budget_s = 1.8;    ///< s, from the first SIGTERM to the last SIGKILL, over all levels
  double sink_grace_s = 8.0;     ///< s beyond stop_budget_s that a sink has to save before it is killed
  double one_press_s = 0.5;      ///< s; a second signal within this time belongs to the same key press
  double restart_delay_s = 0.1;  ///< s, before the first restart
  double restart_cap_s = 5.0;    ///< s, longest delay before a restart
  double young_s = 1.0;  ///< s; a failure with a shorter uptime doubles the delay, a longer uptime resets it
  int restart_limit = 20;   ///< consecutive early failures that end the run; 0: no limit
  double duration_s = 0.0;  ///< s; the run is stopped (successfully) after this time; 0: no limit
  int log_lines = 10;       ///< last log lines of a failed process in the report

  static Options read(const options::Section& section);
};

/// Notifications during a run; any may be empty.
struct Callbacks {
  std::function<void(const std::string& name, pid_t pid)> on_start;
  std::function<void(const std::string& name, const std::string& how)> on_exit;
  std::function<void(const std::string& name, double delay_s)> on_restart;
  std::function<void(const std::string& why)> on_stop;
};

struct Failure {
  std::string name;
  std::string how;  ///< "exit code 3", "killed by signal 9 (Killed)", "did not start: …"
  std::vector<std::string> last_lines;  ///< last lines of its log
};

enum class EndReason { kSinksDone, kDuration, kSignal, kFailure };

struct RunReport {
  EndReason reason = EndReason::kSinksDone;
  int signal = 0;  ///< SIGINT or SIGTERM with kSignal
  std::vector<Failure>
      failures;      ///< processes that ended the run, or that did not stop in time or not with exit code 0
  int restarts = 0;  ///< number of restarts after failures
  int exit_code() const { return failures.empty() ? 0 : 1; }
};

/// Blocks SIGINT and SIGTERM in this thread and in threads that it starts later; Supervisor::run receives
/// them. A multi-threaded program must construct this first: a thread that does not block the signal would
/// end the program. The destructor restores the former mask.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  sigset_t before_;
};

/// Only one run at a time per process. During the run it handles SIGINT and SIGTERM; a second signal, later
/// than Options::one_press_s, kills all processes at once. It is the reaper of its descendants' orphans.
/// Children have their own process groups and are killed when the thread of run() ends. When run() returns,
/// no child, no member of a child's process group and no adopted orphan is left.
class Supervisor {
 public:
  explicit Supervisor(const Options& options) : options_(options) {}

  /// Runs until all sinks are done, the duration is over, SIGINT or SIGTERM arrives, or a process fails
  /// permanently. Throws options::Error for an invalid list (empty argv, duplicate name) and
  /// std::runtime_error when the kernel refuses (no pidfd, log not writable). No process is left running then
  /// either.
  RunReport run(const std::vector<ProcessSpec>& processes, const Callbacks& callbacks = {});

 private:
  Options options_;
};

}  // namespace omnifleet::supervisor
