#include "bus/service_runner.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

#include "bus/dds_bus.h"
#include "bus/dds_log.h"
#include "bus/interfaces.h"
#include "bus/shared_memory.h"
#include "options/options.h"

namespace omnifleet::bus {
namespace {

using Clock = std::chrono::steady_clock;

std::atomic<int> signalled{0};  // number of the received signal; signal handlers access only static data
std::atomic<Bus*> signalled_bus{nullptr};

std::atomic<int> final_code{-1};  // exit code once all output is written; -1 before
std::atomic<bool> parked{false};  // a thread of the middleware aborted and is suspended

/// Fast DDS 2.9 asserts in its discovery thread when a participant leaves at the moment its lease expires
/// (PDP::check_remote_participant_liveliness). On a busy machine this happens while a fleet stops. A service
/// that has written all output exits with its own exit code. A service that is stopping suspends this thread
/// and continues to save. At any other time the process aborts, and the supervisor decides.
void onAbort(int) {
  if (final_code >= 0) _exit(final_code);
  const bool main_thread = ::syscall(SYS_gettid) == ::getpid();
  if (signalled == 0 || main_thread) {
    std::signal(SIGABRT, SIG_DFL);
    return;
  }
  parked = true;
  for (;;) ::pause();
}

/// Ends the process when the destruction of DDS entities hangs. The Fast DDS 2.9 thread that reads frames,
/// and so the destructor of its reader, loops forever when a live writer overtakes it once and never writes
/// again (docs/methods/dds.md). Construct before any object that may hang. begin() starts the timeout, once
/// all output is written.
class ExitTimeout {
 public:
  static constexpr unsigned kLimit_s = 4;
  ~ExitTimeout() { ::alarm(0); }
  static void begin() {
    std::signal(SIGALRM, [](int) { _exit(final_code); });
    ::alarm(kLimit_s);
  }
};

void onSignal(int number) {
  signalled = number;
  if (Bus* bus = signalled_bus) bus->requestStop();
}

/// SIGHUP (unless it is ignored, as under nohup), SIGINT and SIGTERM stop the bus. Construct before the bus,
/// so that no signal is missed.
class StopSignals {
 public:
  StopSignals() {
    signalled = 0;
    final_code = -1;
    struct sigaction action {};
    action.sa_handler = onSignal;
    sigemptyset(&action.sa_mask);
    if (!ignores(SIGHUP)) sigaction(SIGHUP, &action, nullptr);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    std::signal(SIGABRT, onAbort);
    std::signal(SIGPIPE, SIG_IGN);  // a closed log must not kill a stage
  }

 private:
  static bool ignores(int number) {
    struct sigaction action {};
    sigaction(number, nullptr, &action);
    return action.sa_handler == SIG_IGN;
  }
};

/// During its lifetime signals reach the bus.
class SignalledBus {
 public:
  explicit SignalledBus(Bus& bus) {
    signalled_bus = &bus;
    if (signalled != 0) bus.requestStop();
  }
  ~SignalledBus() { signalled_bus = nullptr; }
};

/// Services of the whole fleet are distinguished by their machine, if there are several.
std::string instanceOf(const ServiceOptions& options) {
  if (!options.camera.empty()) return options.camera;
  return options.robot.empty() ? options.host : options.robot;
}

std::shared_ptr<spdlog::logger> makeLogger(const std::string& name, const ServiceOptions& options) {
  const std::string instance = instanceOf(options);
  auto log = std::make_shared<spdlog::logger>(instance.empty() ? name : name + " " + instance,
                                              std::make_shared<spdlog::sinks::stderr_sink_mt>());
  log->set_pattern("%Y-%m-%d %H:%M:%S.%e [%n] %l: %v");
  log->set_level(spdlog::level::from_str(options.log_level));
  log->flush_on(spdlog::level::info);
  return log;
}

/// The launcher has checked the network. If it is gone when a process is restarted, the next start may
/// succeed.
void applyNetwork(const ServiceOptions& options, DdsBusOptions& bus) {
  try {
    resolve(options.network).apply(bus);
  } catch (const omnifleet::options::Error& problem) {
    if (options.incarnation > 1) throw std::runtime_error(problem.what());
    throw;
  }
}

DdsBusOptions busOptions(const std::string& name, const ServiceOptions& options,
                         std::shared_ptr<spdlog::logger> log) {
  DdsBusOptions bus;
  bus.name = instanceOf(options).empty() ? name : name + "/" + instanceOf(options);
  bus.domain = options.domain;
  bus.mode = options.mode;
  bus.write_timeout = options.silence_limit;
  // In deterministic modes a busy machine must not look like a failed stage.
  if (isDeterministic(options.mode)) bus.lease = options.silence_limit;
  applyNetwork(options, bus);
  if (!options.robot.empty()) bus.claim = RobotClaim::ofThisProcess(name, options.robot);
  bus.report = [log](const std::string& line) { log->warn("{}", line); };
  return bus;
}

int runOnDds(const std::string& name, const ServiceOptions& options, const ServiceFactory& make,
             const std::shared_ptr<spdlog::logger>& log) {
  const ExitTimeout exit_timeout;
  const DdsBusOptions bus_options = busOptions(name, options, log);
  requireAddresses(bus_options.interfaces);
  std::optional<SharedMemoryOwner> memory;  // ends after the bus, whose files it names
  const std::unique_ptr<Bus> bus = makeDdsBus(bus_options);
  removeStaleSharedMemory();  // a killed process that this one replaces
  memory.emplace(options.domain, options.out);
  const SignalledBus signals(*bus);
  const Topics topics(options.mode);
  StatusPublisher publisher(*bus, topics, name, instanceOf(options));
  const std::unique_ptr<Service> service = make(ServiceContext{*bus, options, topics, log});
  memory->allocate();
  const ExitCode code = runLoop(*bus, *service, options, publisher, *log);
  final_code = static_cast<int>(code) + (code == ExitCode::kStopped ? signalled.load() : 0);
  if (parked) _exit(final_code);
  ExitTimeout::begin();
  return final_code;
}

}  // namespace

int runService(int argc, char** argv, const std::string& name, const ServiceFactory& make,
               const std::function<void(CLI::App&)>& extend) {
  const StopSignals handlers;
  ServiceOptions options;
  if (const auto code = parseCommandLine(argc, argv, name, extend, options)) return static_cast<int>(*code);
  const auto log = makeLogger(name, options);
  redirectDdsLog([log](const std::string& line) { log->warn("{}", line); });
  try {
    return runOnDds(name, options, make, log);
  } catch (const options::Error& problem) {
    log->error("{}", problem.what());
    return static_cast<int>(ExitCode::kBadOptions);
  } catch (const std::exception& problem) {
    log->error("{}", toLogLine({ErrorCode::kServiceFailed, problem.what()}));
    return static_cast<int>(ExitCode::kFailure);
  }
}

}  // namespace omnifleet::bus
