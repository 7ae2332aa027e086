#include <algorithm>

#include "bus/service_runner.h"

namespace omnifleet::bus {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kStatusPeriod{1};

/// The state of one runLoop().
struct Loop {
  Bus& bus;
  Service& service;
  const ServiceOptions& options;
  StatusPublisher& publisher;
  spdlog::logger& log;

  Lull& lull() { return service.lull(); }

  /// Tells people: the log every problem, the status topic where things stand.
  void tell(bool force = false) {
    for (const std::string& problem : service.status().takeProblems()) log.warn("{}", problem);
    publisher.update(service.status(), Clock::now(), force);
  }

  /// Sleeps until something may have changed, at most until the next status is due.
  void idle() {
    tell();
    const auto now = Clock::now();
    std::chrono::nanoseconds sleep = kStatusPeriod;
    if (const auto at = service.wakeAt()) sleep = std::min<std::chrono::nanoseconds>(sleep, *at - now);
    if (!lull().here(now)) sleep = std::min<std::chrono::nanoseconds>(sleep, lull().next(now) - now);
    if (sleep > std::chrono::nanoseconds(0)) bus.wait(sleep);
  }

  /// The first expectation that is not met; nullptr when all are.
  static const Expectation* unmet(const std::vector<Expectation>& expectations) {
    for (const Expectation& expectation : expectations) {
      if (!expectation.met()) return &expectation;
    }
    return nullptr;
  }

  ExitCode expect() {
    if (!isDeterministic(options.mode)) return ExitCode::kOk;
    const auto expectations = service.expectations();
    const auto deadline = Clock::now() + options.silence_limit;
    while (const Expectation* missing = unmet(expectations)) {
      if (bus.stopping()) return ExitCode::kOk;
      if (Clock::now() >= deadline) return fail("not there after " + limit() + ": " + missing->what);
      idle();
    }
    return ExitCode::kOk;
  }

  ExitCode work() {
    while (!bus.stopping() && !service.finished()) {
      const bool moved = service.spin();
      if (moved) tell();
      if (bus.stopping() || service.finished()) break;
      if (inBackground(moved) || moved) continue;
      if (const auto silent = silentStream()) return fail("nothing for " + limit() + " from: " + *silent);
      idle();
    }
    return ExitCode::kOk;
  }

  /// True when something was done.
  bool inBackground(bool moved) {
    if (isDeterministic(options.mode)) return false;
    const auto now = Clock::now();
    if (moved) lull().heard(now);
    if (!lull().here(now)) return false;
    lull().used();
    return service.background();
  }

  std::optional<std::string> silentStream() {
    if (!isDeterministic(options.mode)) return std::nullopt;
    const auto waiting = service.waitingFor(Clock::now());
    if (!waiting || waiting->silent < options.silence_limit) return std::nullopt;
    return waiting->name;
  }

  ExitCode fail(const std::string& why) {
    tell();
    log.error("{}", why);
    service.status().error(why, true);
    [[maybe_unused]] const auto logged = service.status().takeProblems();
    return ExitCode::kSilentStage;
  }
  std::string limit() const { return std::to_string(options.silence_limit.count()) + " s"; }

  ExitCode run() {
    service.status().state(ServiceState::kWaiting);
    tell();
    ExitCode code = expect();
    if (code == ExitCode::kOk && !bus.stopping()) {
      service.start();
      service.status().state(ServiceState::kRunning);
      code = work();
    }
    // Whoever started it must know that it is missing, unless he has told it himself.
    const bool is_cut = bus.stopping() && !service.finished();
    service.status().state(ServiceState::kStopping);
    service.drain();
    service.status().state(ServiceState::kFinished);
    tell(true);
    if (!bus.flush(options.silence_limit) && !bus.stopping())
      log.warn("some readers never took the last samples");
    if (code != ExitCode::kOk) return code;
    return !service.succeeded() ? ExitCode::kFailure : is_cut ? ExitCode::kStopped : ExitCode::kOk;
  }
};

}  // namespace

ExitCode runLoop(Bus& bus, Service& service, const ServiceOptions& options, StatusPublisher& publisher,
                 spdlog::logger& log) {
  try {
    return Loop{bus, service, options, publisher, log}.run();
  } catch (const std::exception& problem) {
    log.error("{}", problem.what());
    service.status().error(problem.what(), true);
    publisher.update(service.status(), Clock::now(), true);
    return ExitCode::kFailure;
  }
}

}  // namespace omnifleet::bus
