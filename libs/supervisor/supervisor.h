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
  /// A stop signal to this process alone, which is not restarted, stops the run; false: it fails the run.
  bool stops_run = false;
  /// The run ends when every sink has exited by itself. One that exits with another code than 0 after the
  /// sources (the lowest level) have ended is not restarted; it is a failure of the run.
  bool sink = false;
};

struct Options {
  double stop_budget_s = 1.8;    ///< s, from the first SIGTERM to the last SIGKILL, over all levels
  double sink_grace_s = 8.0;     ///< s beyond stop_budget_s that a sink has to save before it is killed
  double one_press_s = 0.5;      ///< s; signals to several processes within this time are one stop request
  double restart_delay_s = 0.1;  ///< s, before the first restart
  double sink_restart_s = 1.0;  ///< s, least delay before a sink that exited with an error code is restarted:
                                ///< the sources may be about to end, too
  double restart_cap_s = 5.0;  ///< s, longest delay before a restart
  double young_s = 1.0;  ///< s; a failure with a shorter uptime doubles the delay, a longer uptime resets it
  double duration_s = 0.0;  ///< s; the run is stopped (successfully) after this time; 0: no limit
  /// s without the end of a process, once all processes of the lowest level (the sources) have ended by
  /// themselves: the run is stopped and the processes that still run are reported. 0: no limit.
  double end_within_s = 0.0;
  int log_lines = 10;  ///< last log lines of a failed process in the report

  static Options read(const options::Section& section);
};

/// A process that failed and waits for its restart.
struct Restart {
  std::string name;
  std::string how;         ///< how it ended: "exit code 1"
  double delay_s = 0.0;    ///< until the restart
  int early_failures = 0;  ///< consecutive failures soon after start; > 1: it keeps failing
};

/// Notifications during a run; any may be empty.
struct Callbacks {
  std::function<void(const std::string& name, pid_t pid)> on_start;
  std::function<void(const std::string& name, const std::string& how)> on_exit;
  std::function<void(const Restart& restart)> on_restart;
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
  int signal = 0;  ///< SIGHUP, SIGINT or SIGTERM with kSignal
  std::vector<Failure>
      failures;  ///< processes that ended the run, or that did not stop in time or not with exit code 0
  std::vector<Failure> degraded;  ///< processes that waited for a restart when the run ended; no failures
  int restarts = 0;               ///< number of restarts after failures
  int exit_code() const { return failures.empty() ? 0 : 1; }
};

/// Blocks SIGHUP, SIGINT and SIGTERM in this thread and in threads that it starts later; Supervisor::run
/// receives them. A SIGHUP that the caller ignores (nohup) stays ignored. A multi-threaded program must
/// construct this first: a thread that does not block the signal would end the program. The destructor
/// restores the former mask.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  sigset_t before_;
};

/// Only one run at a time per process. SIGHUP, SIGINT or SIGTERM stops the run in order, whether it arrives
/// here, at the processes, or at all of them (a service manager); a process that such a signal ended has not
/// failed. A second SIGINT, later than Options::one_press_s, kills all processes at once. A single process
/// that a signal ended is restarted if its policy says so.
/// A process that keeps failing is started again, at most restart_cap_s after each failure, as long as the
/// run lasts. The supervisor is the reaper of its descendants' orphans. Children have their own process
/// groups and are killed when the thread of run() ends. When run() returns, no child, no member of a child's
/// process group and no adopted orphan is left.
class Supervisor {
 public:
  explicit Supervisor(const Options& options) : options_(options) {}

  /// Runs until all sinks are done, the duration is over, a stop signal arrives, or a process fails
  /// that is not restarted. Throws options::Error for an invalid list (empty argv, duplicate name) and
  /// std::runtime_error when the kernel refuses (no pidfd, log not writable). No process is left running then
  /// either.
  RunReport run(const std::vector<ProcessSpec>& processes, const Callbacks& callbacks = {});

 private:
  Options options_;
};

}  // namespace omnifleet::supervisor
