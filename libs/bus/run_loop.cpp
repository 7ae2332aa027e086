#include <algorithm>
#include <utility>

#include "bus/service_runner.h"

namespace omnifleet::bus {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kStatusPeriod{1};

Message streamSilent(const std::string& stream, std::chrono::seconds limit) {
  return {ErrorCode::kStreamSilent, stream + ": no sample for " + std::to_string(limit.count()) +
                                        " s; this service ends. Check the service that publishes it"};
}

Message readerMissing(const std::string& what, std::chrono::seconds limit) {
  return {ErrorCode::kStreamSilent, what + ": still missing after " + std::to_string(limit.count()) +
                                        " s; this service ends. Check the log of the missing service"};
}

Message duplicateRobot(const std::string& robot, const std::string& rival) {
  return {
      ErrorCode::kDuplicateRobot,
      robot + ": " + rival +
          " runs the same service of this robot and started earlier; this process publishes nothing and adds "
          "nothing to the map. Stop one of the two, or give each robot a name of its own"};
}

/// The state of one runLoop().
struct Loop {
  Bus& bus;
  Service& service;
  const ServiceOptions& options;
  StatusPublisher& publisher;
  spdlog::logger& log;

  IdleWindow& idleWindow() { return service.idleWindow(); }

  std::string rival = {};
  Clock::time_point rival_reported = {};

  /// Another process may own the robot. The report is repeated, because others replace it in the status.
  void reportRival() {
    const std::string before = std::exchange(rival, bus.rival());
    if (rival.empty()) {
      if (!before.empty()) service.status().clearError();
    } else if (rival != before || Clock::now() - rival_reported >= kStatusPeriod) {
      rival_reported = Clock::now();
      service.status().report(duplicateRobot(options.robot, rival), true);
    }
  }

  /// Writes new messages to the log and publishes the status.
  void publishStatus(bool force = false) {
    reportRival();
    for (const Message& message : service.status().takeMessages()) log.warn("{}", toLogLine(message));
    publisher.update(service.status(), Clock::now(), force);
  }

  /// Sleeps until something may have changed, at most until the next status is due.
  void idle() {
    publishStatus();
    const auto now = Clock::now();
    std::chrono::nanoseconds sleep = kStatusPeriod;
    if (const auto at = service.wakeAt()) sleep = std::min<std::chrono::nanoseconds>(sleep, *at - now);
    if (!idleWindow().isOpen(now))
      sleep = std::min<std::chrono::nanoseconds>(sleep, idleWindow().opensAt(now) - now);
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
      if (Clock::now() >= deadline) return fail(readerMissing(missing->what, options.silence_limit));
      idle();
    }
    return ExitCode::kOk;
  }

  ExitCode work() {
    while (!bus.stopping() && !service.finished()) {
      const bool moved = service.spin();
      if (moved) publishStatus();
      if (bus.stopping() || service.finished()) break;
      if (inBackground(moved) || moved) continue;
      if (const auto silent = silentStream()) return fail(streamSilent(*silent, options.silence_limit));
      idle();
    }
    return ExitCode::kOk;
  }

  /// True when something was done.
  bool inBackground(bool moved) {
    if (isDeterministic(options.mode)) return false;
    const auto now = Clock::now();
    if (moved) idleWindow().onInput(now);
    if (!idleWindow().isOpen(now)) return false;
    idleWindow().onUse();
    return service.background();
  }

  std::optional<std::string> silentStream() {
    if (!isDeterministic(options.mode)) return std::nullopt;
    const auto waiting = service.waitingFor(Clock::now());
    if (!waiting || waiting->silent < options.silence_limit) return std::nullopt;
    return waiting->name;
  }

  ExitCode fail(const Message& why) {
    publishStatus();
    log.error("{}", toLogLine(why));
    service.status().report(why, true);
    [[maybe_unused]] const auto logged = service.status().takeMessages();
    return ExitCode::kSilentStage;
  }

  /// Bytes of the whole run; the rates of service/status are those of the last second.
  void logTraffic() {
    const Traffic total = bus.traffic();
    if (total.out_bytes > 0 || total.in_bytes > 0)
      log.info("topics that other hosts read: sent {} bytes, received {} bytes", total.out_bytes,
               total.in_bytes);
  }

  ExitCode run() {
    service.status().state(ServiceState::kWaiting);
    publishStatus();
    ExitCode code = expect();
    if (code == ExitCode::kOk && !bus.stopping()) {
      service.start();
      service.status().state(ServiceState::kRunning);
      code = work();
    }
    // A run that was cut short has an exit code of its own.
    const bool is_cut = bus.stopping() && !service.finished();
    service.status().state(ServiceState::kStopping);
    service.drain();
    service.status().state(ServiceState::kFinished);
    publishStatus(true);
    if (!bus.flush(options.silence_limit) && !bus.stopping())
      log.warn("some readers did not acknowledge the last samples; they may lack the end of the run");
    logTraffic();
    if (code != ExitCode::kOk) return code;
    return !service.succeeded() ? ExitCode::kFailure : is_cut ? ExitCode::kStopped : ExitCode::kOk;
  }
};

}  // namespace

ExitCode runLoop(Bus& bus, Service& service, const ServiceOptions& options, StatusPublisher& publisher,
                 spdlog::logger& log) {
  try {
    return Loop{bus, service, options, publisher, log, {}, {}}.run();
  } catch (const std::exception& problem) {
    const Message failed{ErrorCode::kServiceFailed, problem.what()};
    log.error("{}", toLogLine(failed));
    service.status().report(failed, true);
    publisher.update(service.status(), Clock::now(), true);
    return ExitCode::kFailure;
  }
}

}  // namespace omnifleet::bus
