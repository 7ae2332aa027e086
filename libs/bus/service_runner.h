#pragma once

#include <string>
#include <utility>
#include <vector>

#include "bus/service.h"

namespace CLI {
class App;
}

namespace omnifleet::bus {

/// The whole main() of a service process: signal handlers, options, DDS participant, expectations, spin/wait
/// loop, service/status at 1 Hz and on change, drain. All DDS entities are destroyed before it returns.
/// SIGINT and SIGTERM end the service in order, and it saves its results. The exit code is then
/// ExitCode::kStopped plus the signal number, unless the work was complete. `extend` may add options to the
/// command line.
///   int main(int argc, char** argv) { return runService(argc, argv, "classifier", makeClassifier); }
int runService(int argc, char** argv, const std::string& name, const ServiceFactory& make,
               const std::function<void(CLI::App&)>& extend = {});

/// Publishes the StatusBoard of a service.
class StatusPublisher {
 public:
  /// While another process owns the same robot (Bus::rival), the instance is "<instance>@<host>:<process
  /// id>": both processes appear in the table.
  StatusPublisher(Bus& bus, const Topics& topics, std::string service, std::string instance);
  /// Publishes when one second has passed, the board has changed, or `force` is set.
  void update(StatusBoard& board, std::chrono::steady_clock::time_point now, bool force = false);

 private:
  void setInstance();
  void setTraffic(std::chrono::steady_clock::time_point now);
  void write();

  Bus& bus_;
  std::unique_ptr<Writer<v1::ServiceStatus>> writer_;
  std::string instance_;
  v1::ServiceStatus sample_;
  std::chrono::steady_clock::time_point last_{};
  Traffic traffic_;  ///< at traffic_at_
  std::chrono::steady_clock::time_point traffic_at_{};
};

/// The loop of runService on any bus: expectations, start, spin and wait until the service has finished or
/// the bus is stopping, then drain and flush. Logs errors. Exceptions of the service become kFailure.
ExitCode runLoop(Bus& bus, Service& service, const ServiceOptions& options, StatusPublisher& publisher,
                 spdlog::logger& log);

/// Fills `options` from the command line. Returns an exit code when there is nothing to run: after --help, or
/// for invalid options (one line on stderr names the option).
std::optional<ExitCode> parseCommandLine(int argc, const char* const* argv, const std::string& name,
                                         const std::function<void(CLI::App&)>& extend,
                                         ServiceOptions& options);

/// All stages in one process and one thread. Spins each in turn until all have finished.
class InProcessFleet {
 public:
  /// Services spin in the order in which they are added. Results do not depend on it.
  void add(std::string name, std::unique_ptr<Service> service);
  /// Runs to the end: starts all, spins all, drains each when it finishes. `each_round` may return false to
  /// end the run early; all are then drained. Throws std::runtime_error that names the missing expectation,
  /// or, on deadlock, each service and the stream it waits for. Returns false when a service could not save
  /// its results.
  bool run(const std::function<bool()>& each_round = {});
  /// `listener` receives every status message, as the log of the process would.
  void onMessage(std::function<void(const std::string& service, const Message& message)> listener) {
    on_message_ = std::move(listener);
  }
  Service& service(std::size_t index) { return *members_.at(index).service; }

 private:
  struct Member {
    std::string name;
    std::unique_ptr<Service> service;
    bool drained = false;
  };
  void start();
  bool spinRound();
  void drain(Member& member);
  void reportMessages(Member& member);
  bool done() const;
  void sleepOrFail();
  [[noreturn]] void failStuck();
  std::vector<Member> members_;
  std::function<void(const std::string&, const Message&)> on_message_;
};

}  // namespace omnifleet::bus
