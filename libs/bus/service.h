#pragma once

#include <spdlog/logger.h>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bus/bus.h"
#include "bus/lull.h"
#include "bus/status_board.h"
#include "bus/time_merger.h"
#include "bus/topics.h"

namespace omnifleet::bus {

/// Exit codes of every service.
enum class ExitCode : int {
  kOk = 0,
  kFailure = 1,      ///< something broke while running
  kBadOptions = 2,   ///< command line or YAML; nothing was started
  kSilentStage = 3,  ///< a stage that others wait for said nothing for too long
  kStopped = 128,    ///< with the number of the signal added: told to stop, everything is saved
};

/// The command line that all services share.
struct ServiceOptions {
  std::string fleet;                 ///< --fleet FILE
  std::string robot;                 ///< --robot NAME
  std::string camera;                ///< --camera NAME
  RunMode mode = RunMode::kLive;     ///< --mode live|replay|lockstep
  std::string dataset;               ///< --dataset DIR
  std::string out;                   ///< --out DIR
  std::vector<std::string> configs;  ///< --config FILE, repeatable: overlays, later ones on top
  int domain = 0;                    ///< --domain N, default $OMNIFLEET_DOMAIN or 0
  int life = 1;                      ///< --life N: > 1 takes the place of a process of this run that died
  bool record = false;               ///< --record: sources write the run as a dataset into OUT/recording
  bool debug_images = false;         ///< --debug-images: local_mapper draws every frame into OUT/debug
  std::string log_level = "info";    ///< --log-level
  std::chrono::seconds silence_limit{30};  ///< --silence-limit S: deterministic modes only
  std::vector<std::string> interfaces;     ///< --interface ADDRESS, repeatable; none: loopback only
  int max_message_bytes = 65000;           ///< --max-message-bytes N: one datagram; ≤ 1400 off-host
};

/// What a service is given at construction.
struct ServiceContext {
  Bus& bus;
  ServiceOptions options;
  Topics topics;  ///< with the QoS of options.mode
  std::shared_ptr<spdlog::logger> log;
};

/// Something to be matched before start(): "local_map of r1 has 1 reader".
struct Expectation {
  std::string what;
  std::function<bool()> met;  ///< cheap; asked again after every event
};

/// The logic of one stage over the bus interface: the same object runs in its own process (runService) and
/// with all others in one (InProcessFleet). One thread. Make endpoints in the constructor.
class Service {
 public:
  virtual ~Service() = default;

  /// Waited for before start() in deterministic modes; live starts at once. Expect the readers of what you
  /// write (frames above all: a camera must not start before every reader of the run has matched) and the
  /// writers of what you read.
  virtual std::vector<Expectation> expectations() const { return {}; }
  /// Called once, when the expectations are met.
  virtual void start() = 0;
  /// Handles what is there without blocking; true when anything was done (called again at once).
  virtual bool spin() = 0;
  /// Live: what nobody waits for, a slice of some ms; called when nothing has come for a while (lull.h). True
  /// when anything was done (spin() and this are called again). Deterministic modes do such work in spin().
  virtual bool background() { return false; }
  /// Nothing will come any more: the end of the run was seen and everything is written.
  virtual bool finished() const = 0;
  /// The last word: save, publish what is pending. Called once, also when stopped early; ≤ 1.5 s.
  virtual void drain() = 0;
  /// False after drain(): what the run was for was not had or could not be saved; the process then ends with
  /// kFailure. Its log says what.
  virtual bool succeeded() const { return true; }
  /// When to be spun next though nothing arrives (live pacing, timers); nothing: events only.
  virtual std::optional<std::chrono::steady_clock::time_point> wakeAt() const { return std::nullopt; }
  /// Who holds this stage up: forward TimeMerger::waitingFor.
  virtual std::optional<Waiting> waitingFor(std::chrono::steady_clock::time_point) { return std::nullopt; }

  StatusBoard& status() { return status_; }
  /// For those who do parts of their background() at a time (awaitLull()).
  Lull& lull() { return lull_; }

 private:
  StatusBoard status_;
  Lull lull_;
};

using ServiceFactory = std::function<std::unique_ptr<Service>(const ServiceContext&)>;

}  // namespace omnifleet::bus
