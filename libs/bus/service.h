#pragma once

#include <spdlog/logger.h>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bus/bus.h"
#include "bus/idle_window.h"
#include "bus/network.h"
#include "bus/status_board.h"
#include "bus/time_merger.h"
#include "bus/topics.h"

namespace omnifleet::bus {

/// Exit codes of every service.
enum class ExitCode : int {
  kOk = 0,
  kFailure = 1,      ///< an error while running
  kBadOptions = 2,   ///< error in the command line or YAML; no work was started
  kSilentStage = 3,  ///< no input for the silence limit from a stage that others wait for
  kStopped = 128,    ///< plus the signal number: stopped by a signal, all results are saved
};

/// The command line that all services share.
struct ServiceOptions {
  std::string fleet;                 ///< --fleet FILE
  std::string robot;                 ///< --robot NAME
  std::string camera;                ///< --camera NAME
  std::string host;                  ///< --host NAME: of the part of the fleet that this machine runs
  RunMode mode = RunMode::kLive;     ///< --mode live|replay|lockstep
  std::string dataset;               ///< --dataset DIR
  std::string out;                   ///< --out DIR
  std::vector<std::string> configs;  ///< --config FILE, repeatable: overlays, later ones on top
  int domain = 0;                    ///< --domain N, default $OMNIFLEET_DOMAIN or 0
  int incarnation = 1;               ///< --incarnation N: > 1 for a restarted process of this run
  bool record = false;        ///< --record: source services write the run as a dataset into OUT/recording
  bool debug_images = false;  ///< --debug-images: local_mapper writes an image of every frame to OUT/debug
  std::string log_level = "info";          ///< --log-level
  std::chrono::seconds silence_limit{30};  ///< --silence-limit S: deterministic modes only
  NetworkRequest network;                  ///< --interface, --peer, --max-message-bytes
};

/// Passed to a service at construction.
struct ServiceContext {
  Bus& bus;
  ServiceOptions options;
  Topics topics;  ///< with the QoS of options.mode
  std::shared_ptr<spdlog::logger> log;
};

/// A condition for start(), e.g. "local_map of r1 has 1 reader".
struct Expectation {
  std::string what;
  std::function<bool()> met;  ///< cheap; evaluated again after every event
};

/// The logic of one stage on the bus interface. The same object runs in its own process (runService) or with
/// all other stages in one process (InProcessFleet). Single-threaded. Create endpoints in the constructor.
class Service {
 public:
  virtual ~Service() = default;

  /// Conditions to wait for before start() in deterministic modes; live mode starts at once. Expect the
  /// readers of every output and the writers of every input. Frames matter most: a camera must not start
  /// before all its readers are matched.
  virtual std::vector<Expectation> expectations() const { return {}; }
  /// Called once, when all expectations are met.
  virtual void start() = 0;
  /// Processes available input without blocking. Returns true when any work was done (it is then called
  /// again).
  virtual bool spin() = 0;
  /// Live mode: one slice of some ms of work with no deadline, called in idle windows (idle_window.h).
  /// Returns true when any work was done (spin() and background() are then called again). Deterministic modes
  /// do this work in spin().
  virtual bool background() { return false; }
  /// True when the run has ended and all output is written.
  virtual bool finished() const = 0;
  /// Final step: saves and publishes pending results. Called once, also after an early stop. Takes ≤ 1.5 s.
  virtual void drain() = 0;
  /// False after drain() when a required result is missing or could not be saved. The process then exits with
  /// kFailure; its log has the reason.
  virtual bool succeeded() const { return true; }
  /// Time of the next spin() without input (live pacing, timers). Empty: events only.
  virtual std::optional<std::chrono::steady_clock::time_point> wakeAt() const { return std::nullopt; }
  /// The stream that this stage waits for: forward TimeMerger::waitingFor.
  virtual std::optional<Waiting> waitingFor(std::chrono::steady_clock::time_point) { return std::nullopt; }

  /// The board that the runner publishes. A service that runs another one returns that one's.
  virtual StatusBoard& status() { return status_; }
  /// For services that split background() with awaitIdleWindow().
  virtual IdleWindow& idleWindow() { return idle_window_; }

 private:
  StatusBoard status_;
  IdleWindow idle_window_;
};

using ServiceFactory = std::function<std::unique_ptr<Service>(const ServiceContext&)>;

}  // namespace omnifleet::bus
