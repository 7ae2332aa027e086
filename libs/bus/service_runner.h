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
/// give exit code 0. `extend` may add options of its own to the command line.
///   int main(int argc, char** argv) { return runService(argc, argv, "classifier", makeClassifier); }
int runService(int argc, char** argv, const std::string& name, const ServiceFactory& make,
               const std::function<void(CLI::App&)>& extend = {});

/// Publishes a service's StatusBoard.
class StatusPublisher {
 public:
  StatusPublisher(Bus& bus, const Topics& topics, std::string service, std::string robot);
  /// Publishes when a second has passed, the board has changed, or `force`.
  void update(StatusBoard& board, std::chrono::steady_clock::time_point now, bool force = false);

 private:
  std::string service_, robot_;
  std::unique_ptr<Writer<v1::ServiceStatus>> writer_;
  std::chrono::steady_clock::time_point last_{};
  std::uint32_t sequence_ = 0;
};

/// All stages in one process on one thread: spins each in turn until all have finished.
class InProcessFleet {
 public:
  /// Order of spinning is order of adding; results do not depend on it.
  void add(std::string name, std::unique_ptr<Service> service);
  /// Runs to the end: start, spin, drain in order. Throws std::runtime_error naming the stream that is waited
  /// for when nothing moves any more, and what expectation is not met.
  void run(const std::function<void()>& each_round = {});
  Service& service(std::size_t index) { return *services_.at(index).second; }

 private:
  bool spinRound();
  [[noreturn]] void failStuck();
  std::vector<std::pair<std::string, std::unique_ptr<Service>>> services_;
};

}  // namespace omnifleet::bus
