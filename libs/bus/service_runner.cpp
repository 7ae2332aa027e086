#include "bus/service_runner.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <csignal>

#include "bus/dds_bus.h"
#include "options/options.h"

namespace omnifleet::bus {
namespace {

using Clock = std::chrono::steady_clock;

std::atomic<int> signalled{0};  // the number of the signal; handlers reach nothing but statics
std::atomic<Bus*> signalled_bus{nullptr};

std::atomic<int> last_word{-1};   // exit code, once everything is written
std::atomic<bool> parked{false};  // a thread of the middleware was stopped short of ending the process

/// Fast DDS 2.9 asserts in its discovery thread when a participant leaves in the very moment in which its
/// lease runs out (PDP::check_remote_participant_liveliness), which on a busy machine happens while a fleet
/// stops. A service that has written everything ends with its own exit code; one that was told to stop parks
/// that thread and goes on to save. At any other time the process dies, and the supervisor decides.
void onAbort(int) {
  if (last_word >= 0) _exit(last_word);
  const bool main_thread = ::syscall(SYS_gettid) == ::getpid();
  if (signalled == 0 || main_thread) {
    std::signal(SIGABRT, SIG_DFL);
    return;
  }
  parked = true;
  for (;;) ::pause();
}

/// A thread that Fast DDS 2.9 reads frames with spins, and so its reader's end, when a live writer overtakes
/// it in one moment and never writes again (docs/methods.md, "DDS as measured"). Made before whatever may
/// hang; once everything is written, that must be gone in time, or the process ends without.
class Leaving {
 public:
  static constexpr unsigned kPatience_s = 4;
  ~Leaving() { ::alarm(0); }
  static void begin() {
    std::signal(SIGALRM, [](int) { _exit(last_word); });
    ::alarm(kPatience_s);
  }
};

void onSignal(int number) {
  signalled = number;
  if (Bus* bus = signalled_bus) bus->requestStop();
}

/// SIGINT and SIGTERM stop the bus; made before the bus, so that none is missed.
class StopSignals {
 public:
  StopSignals() {
    signalled = 0;
    last_word = -1;
    struct sigaction action {};
    action.sa_handler = onSignal;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    std::signal(SIGABRT, onAbort);
    std::signal(SIGPIPE, SIG_IGN);  // a closed log must not kill a stage
  }
};

/// While it lives, signals reach the bus.
class SignalledBus {
 public:
  explicit SignalledBus(Bus& bus) {
    signalled_bus = &bus;
    if (signalled != 0) bus.requestStop();
  }
  ~SignalledBus() { signalled_bus = nullptr; }
};

std::string instanceOf(const ServiceOptions& options) {
  return options.camera.empty() ? options.robot : options.camera;
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

DdsBusOptions busOptions(const std::string& name, const ServiceOptions& options,
                         std::shared_ptr<spdlog::logger> log) {
  DdsBusOptions bus;
  bus.name = instanceOf(options).empty() ? name : name + "/" + instanceOf(options);
  bus.domain = options.domain;
  bus.mode = options.mode;
  bus.write_timeout = options.silence_limit;
  // Where nothing may be lost a busy machine must not look like a dead stage.
  if (isDeterministic(options.mode)) bus.lease = options.silence_limit;
  if (!options.interfaces.empty()) bus.interfaces = options.interfaces;
  bus.max_message_bytes = static_cast<std::uint32_t>(options.max_message_bytes);
  bus.report = [log](const std::string& line) { log->warn("{}", line); };
  return bus;
}

int runOnDds(const std::string& name, const ServiceOptions& options, const ServiceFactory& make,
             const std::shared_ptr<spdlog::logger>& log) {
  const Leaving leaving;
  const std::unique_ptr<Bus> bus = makeDdsBus(busOptions(name, options, log));
  const SignalledBus signals(*bus);
  const Topics topics(options.mode);
  StatusPublisher publisher(*bus, topics, name, instanceOf(options));
  const std::unique_ptr<Service> service = make(ServiceContext{*bus, options, topics, log});
  const ExitCode code = runLoop(*bus, *service, options, publisher, *log);
  last_word = static_cast<int>(code) + (code == ExitCode::kStopped ? signalled.load() : 0);
  if (parked) _exit(last_word);
  Leaving::begin();
  return last_word;
}

}  // namespace

int runService(int argc, char** argv, const std::string& name, const ServiceFactory& make,
               const std::function<void(CLI::App&)>& extend) {
  const StopSignals handlers;
  ServiceOptions options;
  if (const auto code = parseCommandLine(argc, argv, name, extend, options)) return static_cast<int>(*code);
  const auto log = makeLogger(name, options);
  try {
    return runOnDds(name, options, make, log);
  } catch (const options::Error& problem) {
    log->error("{}", problem.what());
    return static_cast<int>(ExitCode::kBadOptions);
  } catch (const std::exception& problem) {
    log->error("{}", problem.what());
    return static_cast<int>(ExitCode::kFailure);
  }
}

}  // namespace omnifleet::bus
