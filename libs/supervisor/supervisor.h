#pragma once

// Starts the processes of a run, keeps them alive, and ends them in order. Linux only (signalfd, pidfd,
// timerfd, epoll); no thread, no polling, no sleep. Knows nothing of DDS or of the fleet: the caller lists
// the processes.

#include <sys/types.h>
#include <csignal>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "options/options.h"

namespace omnifleet::supervisor {

enum class RestartPolicy {
  kOnFailure,  ///< again unless it exits 0 on its own
  kNever,      ///< its failure ends the run
};

struct ProcessSpec {
  std::string name;                        ///< unique; names the log and the messages
  std::vector<std::string> argv;           ///< argv[0] is looked up in PATH unless it has a slash
  std::string life_option;                 ///< appended with the number of its life from the second on; empty: none
  std::map<std::string, std::string> env;  ///< added to (or replacing in) the supervisor's own environment
  std::string log_path;                    ///< stdout and stderr, appended; empty: inherited
  int level = 0;  ///< place in the line: started in descending, stopped in ascending order
  RestartPolicy restart = RestartPolicy::kOnFailure;
  /// Exit code by which a process says on its first start that it never will run (bad options): not started
  /// again, the run ends. 0: there is none.
  int refusal_code = 0;
  bool sink = false;  ///< the run ends when every sink has exited 0 on its own
};

struct Options {
  double stop_budget_s = 1.8;    ///< s, from the first SIGTERM to the last SIGKILL, all levels together
  double sink_grace_s = 8.0;     ///< s beyond stop_budget_s that a sink has to save before it is killed
  double one_press_s = 0.5;      ///< s; a second signal within this is the first one's echo
  double restart_delay_s = 0.1;  ///< s, before the first restart
  double restart_cap_s = 5.0;    ///< s, longest delay
  double young_s = 1.0;          ///< s; what dies younger doubles its delay, what lived longer starts over
  int restart_limit = 20;        ///< young deaths in a row after which the run is given up; 0: never
  double duration_s = 0.0;       ///< s; the run is stopped (in success) after so long; 0: no limit
  int log_lines = 10;            ///< last lines of a failed process's log in the report

  static Options read(const options::Section& section);
};

/// What a run reports while it lasts; any may be empty.
struct Callbacks {
  std::function<void(const std::string& name, pid_t pid)> on_start;
  std::function<void(const std::string& name, const std::string& how)> on_exit;
  std::function<void(const std::string& name, double delay_s)> on_restart;
  std::function<void(const std::string& why)> on_stop;
};

struct Failure {
  std::string name;
  std::string how;  ///< "exit code 3", "killed by signal 9 (Killed)", "did not start: …"
  std::vector<std::string> last_lines;  ///< of its log
};

enum class EndReason { kSinksDone, kDuration, kSignal, kFailure };

struct RunReport {
  EndReason reason = EndReason::kSinksDone;
  int signal = 0;                 ///< SIGINT or SIGTERM with kSignal
  std::vector<Failure> failures;  ///< what ended the run, or did not end in time or not with 0 when told to
  int restarts = 0;               ///< deaths that were made good
  int exit_code() const { return failures.empty() ? 0 : 1; }
};

/// SIGINT and SIGTERM blocked in this thread and in those it starts later, for Supervisor::run to take. A
/// program with several threads makes this first of all: a thread that does not block a signal would die of
/// it, and the program with it. Restores the former mask.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

 private:
  sigset_t before_;
};

/// One run at a time per process. It takes SIGINT and SIGTERM for its duration (a second one, later than Options::one_press_s, kills at once)
/// and is the reaper of its descendants' orphans. Children live in process groups of their own and die with
/// the thread that runs this. On return no child, member of a child's group, or adopted orphan is left.
class Supervisor {
 public:
  explicit Supervisor(const Options& options) : options_(options) {}

  /// Runs until the sinks are done, the duration is over, SIGINT/SIGTERM arrives, or something fails for
  /// good. Throws options::Error for a bad list (empty argv, a name twice) and std::runtime_error where the
  /// kernel refuses (no pidfd, log not writable); nothing is left running then either.
  RunReport run(const std::vector<ProcessSpec>& processes, const Callbacks& callbacks = {});

 private:
  Options options_;
};

}  // namespace omnifleet::supervisor
