#include "supervisor/supervisor.h"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <stdexcept>

#include "supervisor/child.h"
#include "supervisor/event_loop.h"
#include "supervisor/log_tail.h"
#include "supervisor/orphans.h"
#include "supervisor/schedule.h"

namespace omnifleet::supervisor {
namespace {

/// One process of the list with all its incarnations.
struct Member {
  Member(const ProcessSpec& spec_, const Options& options) : spec(spec_), backoff(options) {}

  const ProcessSpec& spec;
  Backoff backoff;
  Child child;
  bool running = false;
  bool done = false;        ///< exited by itself, with 0 or, as a sink, after the sources
  bool terminated = false;  ///< SIGTERM sent
  bool killed = false;      ///< SIGKILL sent
  int starts = 0;
  double started_s = 0.0;
  double restart_s = EventLoop::kNever;
  double decide_s = EventLoop::kNever;  ///< a signal ended it: at this time it counts as a failure
  ExitStatus status;                    ///< the last one
};

void check(const std::vector<ProcessSpec>& processes) {
  std::set<std::string> names;
  if (processes.empty()) throw options::Error("supervisor: the list of processes is empty");
  for (const ProcessSpec& spec : processes) {
    if (spec.argv.empty()) throw options::Error("supervisor: process '" + spec.name + "' has no program");
    if (!names.insert(spec.name).second)
      throw options::Error("supervisor: two processes named '" + spec.name + "'");
  }
}

/// One call of Supervisor::run.
class Run {
 public:
  Run(const Options& options, const std::vector<ProcessSpec>& processes, const Callbacks& callbacks)
      : options_(options), callbacks_(callbacks) {
    members_.reserve(processes.size());
    for (const ProcessSpec& spec : processes) {
      members_.emplace_back(spec, options);
      levels_.insert(spec.level);
    }
  }
  ~Run() { killAll(); }

  RunReport operator()() {
    if (options_.duration_s > 0.0) end_s_ = EventLoop::clock() + options_.duration_s;
    startAll();
    while (!stopping_ || anyRunning()) {
      const Events events = loop_.wait(nextDeadline());
      if (events.stop_signal != 0) onStopSignal(events.stop_signal);
      for (const std::uint64_t key : events.ended) onExit(members_[key]);
      const double now_s = EventLoop::clock();
      if (stopping_) {
        continueStop(now_s);
      } else {
        decideDue(now_s);
        restartDue(now_s);
        if (now_s >= end_s_) stop(EndReason::kDuration, "the duration is over");
        if (!stopping_ && finished()) stop(EndReason::kSinksDone, "all sinks are done");
        if (!stopping_ && now_s >= endDeadline()) stopOverdue();
      }
    }
    return report_;
  }

 private:
  void startAll() {
    for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) {
      for (Member& member : members_) {
        if (member.spec.level == *level && !stopping_) start(member);
      }
    }
  }

  void start(Member& member) {
    member.restart_s = EventLoop::kNever;
    ProcessSpec spec = member.spec;
    if (member.starts > 0 && !spec.incarnation_option.empty())
      spec.argv.insert(spec.argv.end(), {spec.incarnation_option, std::to_string(member.starts + 1)});
    try {
      member.child = spawn(spec);
    } catch (const std::runtime_error& error) {
      fail(member, std::string("did not start: ") + error.what());
      return;
    }
    member.running = true;
    ++member.starts;
    member.started_s = EventLoop::clock();
    loop_.watch(member.child, static_cast<std::uint64_t>(&member - members_.data()));
    if (callbacks_.on_start) callbacks_.on_start(member.spec.name, member.child.pid);
  }

  void addFailure(const Member& member, const std::string& how) {
    report_.failures.push_back({member.spec.name, how, lastLines(member.spec.log_path, options_.log_lines)});
  }

  void fail(Member& member, const std::string& how) {
    addFailure(member, how);
    if (!stopping_) stop(EndReason::kFailure, member.spec.name + ": " + how);
  }

  void onExit(Member& member) {
    const ExitStatus status = reap(member.child);
    kill(-member.child.pid, SIGKILL);  // remaining members of its process group
    member.child.pidfd.reset();
    member.running = false;
    orphans_.reap();
    if (callbacks_.on_exit) callbacks_.on_exit(member.spec.name, status.describe());
    member.status = status;
    if (member.killed) return;  // the failure was reported when it was killed
    if (status.exited && status.value == 0) {
      member.done = !member.terminated;
      last_done_s_ = EventLoop::clock();
    } else if (stopping_) {
      if (status.stopSignal() == 0) fail(member, status.describe());
    } else if (status.stopSignal() != 0) {
      onStopped(member);
    } else if (status.exited && member.spec.sink && sourcesEnded()) {
      endWithFailure(member);
    } else {
      scheduleRestart(member);
    }
  }

  /// A sink failed after the sources had ended: a new one would wait for input that has ended.
  void endWithFailure(Member& member) {
    member.restart_s = EventLoop::kNever;
    member.done = true;
    last_done_s_ = EventLoop::clock();
    addFailure(member, member.status.describe());
  }

  /// A signal ended one process. If it was sent to several, the run stops; the signal to this process may
  /// still be on its way.
  void onStopped(Member& member) {
    const double now_s = EventLoop::clock();
    const bool several = now_s - last_stopped_s_ < options_.one_press_s;
    last_stopped_s_ = now_s;
    if (several) {
      report_.signal = member.status.stopSignal();
      stop(EndReason::kSignal, strsignal(report_.signal));
    } else if (member.spec.restart == RestartPolicy::kNever) {
      member.decide_s = now_s + options_.one_press_s;
    } else {
      scheduleRestart(member);
    }
  }

  void decideDue(double now_s) {
    for (Member& member : members_) {
      if (stopping_ || member.decide_s > now_s) continue;
      member.decide_s = EventLoop::kNever;
      if (member.spec.stops_run) {
        report_.signal = member.status.stopSignal();
        stop(EndReason::kSignal, strsignal(report_.signal));
      } else {
        fail(member, member.status.describe());
      }
    }
  }

  void scheduleRestart(Member& member) {
    const ExitStatus& status = member.status;
    double delay = member.backoff.restartDelay(EventLoop::clock() - member.started_s);
    if (status.exited && member.spec.sink) delay = std::max(delay, options_.sink_restart_s);
    const bool refuses = member.starts == 1 && status.exited && status.value == member.spec.refusal_code;
    if (refuses || member.spec.restart == RestartPolicy::kNever) return fail(member, status.describe());
    member.restart_s = EventLoop::clock() + delay;
    appendToLog(member.spec,
                fmt::format("-- {}: {}; restart in {:.2f} s", member.spec.name, status.describe(), delay));
    if (callbacks_.on_restart)
      callbacks_.on_restart({member.spec.name, status.describe(), delay, member.backoff.earlyFailures()});
  }

  void restartDue(double now_s) {
    for (Member& member : members_) {
      if (stopping_ || member.restart_s > now_s) continue;
      const bool has_given_up = member.status.exited && member.spec.sink && sourcesEnded();
      if (has_given_up) {
        endWithFailure(member);
      } else {
        ++report_.restarts;
        start(member);
      }
    }
  }

  /// All sinks have exited with 0, or all processes if there are no sinks.
  bool finished() const {
    const bool sinks =
        std::any_of(members_.begin(), members_.end(), [](const Member& m) { return m.spec.sink; });
    return std::all_of(members_.begin(), members_.end(),
                       [&](const Member& m) { return m.done || (sinks && !m.spec.sink); });
  }

  /// All processes of the lowest level have ended by themselves.
  bool sourcesEnded() const {
    return std::all_of(members_.begin(), members_.end(),
                       [&](const Member& m) { return m.done || m.spec.level != *levels_.begin(); });
  }

  /// s on EventLoop::clock(): when the run must have ended after its sources have.
  double endDeadline() const {
    if (options_.end_within_s <= 0.0) return EventLoop::kNever;
    return sourcesEnded() ? last_done_s_ + options_.end_within_s : EventLoop::kNever;
  }

  void stopOverdue() {
    const std::string how =
        fmt::format("still running {:g} s after the last other process had ended", options_.end_within_s);
    for (const int level : levels_) {
      for (const Member& member : members_) {
        if (member.done || member.spec.level != level) continue;
        addFailure(member, how);
      }
    }
    stop(EndReason::kFailure, "the sources have ended, but not the run");
  }

  void onStopSignal(int number) {
    if (stopping_) {
      // One key press may arrive twice: at the process and at its process group. Service managers and
      // terminals send other signals after the first one; only a second key press means "at once".
      if (number != SIGINT || EventLoop::clock() - stop_s_ < options_.one_press_s) return;
      killAllRunning("killed at once on a second signal");
      return;
    }
    report_.signal = number;
    stop(EndReason::kSignal, strsignal(number));
  }

  void stop(EndReason reason, const std::string& why) {
    stopping_ = true;
    report_.reason = reason;
    stop_s_ = EventLoop::clock();
    for (const Member& member : members_) {
      if (member.restart_s < EventLoop::kNever && member.backoff.earlyFailures() > 1)
        report_.degraded.push_back({member.spec.name,
                                    fmt::format("failed {} times, the last time with {}",
                                                member.backoff.earlyFailures(), member.status.describe()),
                                    lastLines(member.spec.log_path, options_.log_lines)});
    }
    if (callbacks_.on_stop) callbacks_.on_stop(why);
    continueStop(stop_s_);
  }

  /// Sends SIGTERM to the next level when all levels before it have ended or their time is over.
  void continueStop(double now_s) {
    std::size_t index = 0;
    for (const int level : levels_) {
      terminate(level);
      const bool over = now_s >= stop_s_ + levelDeadline(index, levels_.size(), options_.stop_budget_s);
      const bool ended = std::none_of(members_.begin(), members_.end(),
                                      [&](const Member& m) { return m.running && m.spec.level == level; });
      if (!ended && !over) return;
      ++index;
    }
    if (now_s >= stop_s_ + options_.stop_budget_s)
      killAllRunning(fmt::format("did not end within {} s, killed", options_.stop_budget_s), false);
    if (now_s >= stop_s_ + options_.stop_budget_s + options_.sink_grace_s)
      killAllRunning(
          fmt::format("did not end within {} s, killed", options_.stop_budget_s + options_.sink_grace_s));
  }

  void terminate(int level) {
    for (Member& member : members_) {
      if (!member.running || member.terminated || member.spec.level != level) continue;
      member.terminated = true;
      kill(member.child.pid, SIGTERM);
    }
  }

  void killAllRunning(const std::string& why, bool sinks = true) {
    for (Member& member : members_) {
      if (!member.running || member.killed || (member.spec.sink && !sinks)) continue;
      member.killed = true;
      kill(-member.child.pid, SIGKILL);
      fail(member, why);
    }
  }

  double nextDeadline() const {
    const double now_s = EventLoop::clock();
    double next = stopping_ ? EventLoop::kNever : end_s_;
    for (std::size_t i = 0; stopping_ && i < levels_.size(); ++i) {
      const double deadline = stop_s_ + levelDeadline(i, levels_.size(), options_.stop_budget_s);
      if (deadline > now_s) next = std::min(next, deadline);
    }
    const double last = stop_s_ + options_.stop_budget_s + options_.sink_grace_s;
    if (stopping_ && last > now_s) next = std::min(next, last);
    if (stopping_) return next;
    for (const Member& member : members_) next = std::min({next, member.restart_s, member.decide_s});
    return std::min(next, endDeadline());
  }

  bool anyRunning() const {
    return std::any_of(members_.begin(), members_.end(), [](const Member& m) { return m.running; });
  }

  /// Ensures that no process is left, however the run ends.
  void killAll() {
    for (Member& member : members_) {
      if (!member.running) continue;
      kill(-member.child.pid, SIGKILL);
      reap(member.child);
      member.running = false;
    }
    orphans_.killAll();
  }

  Options options_;
  const Callbacks& callbacks_;
  Orphans orphans_;
  EventLoop loop_;
  std::vector<Member> members_;
  std::set<int> levels_;
  RunReport report_;
  bool stopping_ = false;
  double stop_s_ = 0.0, end_s_ = EventLoop::kNever;
  double last_done_s_ = 0.0;                    ///< the latest end of a process with exit code 0
  double last_stopped_s_ = -EventLoop::kNever;  ///< a stop signal ended a process
};

}  // namespace

Options Options::read(const options::Section& section) {
  Options o;
  section.read("stop_budget_s", o.stop_budget_s, {0.1, 60.0});
  section.read("sink_grace_s", o.sink_grace_s, {0.0, 600.0});
  section.read("one_press_s", o.one_press_s, {0.0, 10.0});
  section.read("restart_delay_s", o.restart_delay_s, {0.01, 60.0});
  section.read("restart_cap_s", o.restart_cap_s, {0.01, 600.0});
  section.read("young_s", o.young_s, {0.0, 600.0});
  section.read("duration_s", o.duration_s, {0.0, 1e7});
  section.read("end_within_s", o.end_within_s, {0.0, 1e7});
  section.read("log_lines", o.log_lines, {0, 1000});
  section.finish();
  return o;
}

StopSignals::StopSignals() {
  const sigset_t stops = stopSignals();
  pthread_sigmask(SIG_BLOCK, &stops, &before_);
}

StopSignals::~StopSignals() {
  // A request that arrived twice is done as well; unblocked, it would end the program.
  const sigset_t stops = stopSignals();
  const timespec no_time{};
  while (sigtimedwait(&stops, nullptr, &no_time) > 0) {
  }
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

RunReport Supervisor::run(const std::vector<ProcessSpec>& processes, const Callbacks& callbacks) {
  check(processes);
  const StopSignals signals;
  return Run(options_, processes, callbacks)();
}

}  // namespace omnifleet::supervisor
