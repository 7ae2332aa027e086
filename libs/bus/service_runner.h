#pragma once

#include <string>
#include <utility>
#include <vector>

#include "bus/service.h"

namespace CLI {
class App;
}

namespace omnifleet::bus {

/// The whole main() of a service process: signals before participants, options, expectations, spin/wait loop,
/// service/status at 1 Hz and on change, drain, every DDS entity gone before it returns. SIGINT and SIGTERM
/// end it in order, with what it has saved; if its work was not done, with ExitCode::kStopped and their
/// number. `extend` may add options of its own to the command line.
///   int main(int argc, char** argv) { return runService(argc, argv, "classifier", makeClassifier); }
int runService(int argc, char** argv, const std::string& name, const ServiceFactory& make,
               const std::function<void(CLI::App&)>& extend = {});

/// Publishes a service's StatusBoard.
class StatusPublisher {
 public:
  StatusPublisher(Bus& bus, const Topics& topics, std::string service, std::string instance);
  /// Publishes when a second has passed, the board has changed, or `force`.
  void update(StatusBoard& board, std::chrono::steady_clock::time_point now, bool force = false);

 private:
  std::unique_ptr<Writer<v1::ServiceStatus>> writer_;
  v1::ServiceStatus sample_;
  std::chrono::steady_clock::time_point last_{};
};

/// The loop of runService on any bus: expectations, start, spin and wait until the service has finished or
/// the bus is stopping, drain, flush. Logs what goes wrong; exceptions of the service become kFailure.
ExitCode runLoop(Bus& bus, Service& service, const ServiceOptions& options, StatusPublisher& publisher,
                 spdlog::logger& log);

/// Fills `options` from the command line. An exit code when there is nothing to run: help, or bad options
/// (one line on stderr naming the option).
std::optional<ExitCode> parseCommandLine(int argc, const char* const* argv, const std::string& name,
                                         const std::function<void(CLI::App&)>& extend,
                                         ServiceOptions& options);

/// All stages in one process on one thread: spins each in turn until all have finished.
class InProcessFleet {
 public:
  /// Order of spinning is order of adding; results do not depend on it.
  void add(std::string name, std::unique_ptr<Service> service);
  /// Runs to the end: start, spin, drain each as it finishes. `each_round` may end the run early by returning
  /// false (all are drained then). Throws std::runtime_error naming who waits for which stream when nothing
  /// moves any more, and the expectation that is not met at the start. False: a service could not save
  /// what it should have.
  bool run(const std::function<bool()>& each_round = {});
  /// Told every problem that a service tells its status, as its own process would log it.
  void onProblem(std::function<void(const std::string& service, const std::string& problem)> listener) {
    on_problem_ = std::move(listener);
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
  void tellProblems(Member& member);
  bool done() const;
  void sleepOrFail();
  [[noreturn]] void failStuck();
  std::vector<Member> members_;
  std::function<void(const std::string&, const std::string&)> on_problem_;
};

}  // namespace omnifleet::bus
