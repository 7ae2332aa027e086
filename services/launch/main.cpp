// Starts and supervises the processes of a fleet: `run FLEET.yaml` or `replay DATASET`.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <map>
#include <optional>

#include "bus/dds_log.h"
#include "bus/domain_claim.h"
#include "bus/service.h"
#include "bus/shared_memory.h"
#include "common/check_options.h"
#include "common/foreign_log.h"
#include "launch/console.h"
#include "launch/plan.h"
#include "launch/progress.h"
#include "launch/resources.h"
#include "options/range_check.h"

namespace {

using omnifleet::launch::print;
using omnifleet::launch::RunRequest;
using omnifleet::options::notEmpty;
using omnifleet::options::within;

// s, live: the stages behind the sources need some seconds for the last frames, outlines and files; twice the
// limit for a silent stage in the other modes.
constexpr double kEndWithin_s = 60.0;

void addCommon(CLI::App& app, RunRequest& request) {
  app.add_option("--config", request.overlays, "YAML on top of the fleet file; repeatable")
      ->check(CLI::ExistingFile);
  app.add_option("--host", request.host, "start only the part of the fleet for this host");
  app.add_option("--duration", request.duration_s, "stop after this many seconds")->check(within({0.1, 1e9}));
  app.add_option("--stop-within", request.stop_within_s,
                 "seconds within which all processes must end after a stop request")
      ->check(within({0.1, 600.0}, "OMNIFLEET_STOP_WITHIN"))
      ->envname("OMNIFLEET_STOP_WITHIN")
      ->capture_default_str();
  app.add_option("--domain", request.domain, "DDS domain")
      ->check(omnifleet::options::domainNumber())
      ->envname("OMNIFLEET_DOMAIN");
  omnifleet::bus::addNetworkOptions(app, request.network);
  app.add_flag("--debug-images", request.debug_images, "write an image of every local map to OUT/debug");
  app.add_flag("--record", request.record, "record the run as a dataset in OUT/recording");
}

std::string programFolder() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().string();
}

/// The run was stopped before its end. Live runs have no end of their own.
bool isCutShort(const omnifleet::supervisor::RunReport& run, const std::string& mode) {
  return run.reason == omnifleet::supervisor::EndReason::kSignal && mode != "live";
}

void printEnd(const omnifleet::supervisor::Failure& failure) {
  print(fmt::format("{}: {}\n", failure.name, failure.how));
  for (const std::string& line : failure.last_lines) print(fmt::format("  | {}\n", line));
}

/// @return the exit code
int report(const omnifleet::supervisor::RunReport& run, const std::string& mode, const std::string& out) {
  for (const auto& failure : run.failures) printEnd(failure);
  for (const auto& process : run.degraded) printEnd(process);
  if (run.restarts > 0)
    print(fmt::format("{} {}\n", run.restarts, run.restarts == 1 ? "restart" : "restarts"));
  const bool is_cut = run.exit_code() == 0 && isCutShort(run, mode);
  const char* how = is_cut ? "stopped before its end" : run.exit_code() == 0 ? "done" : "failed";
  print(fmt::format("{}: {}\n", how, out));
  return is_cut ? static_cast<int>(omnifleet::bus::ExitCode::kStopped) + run.signal : run.exit_code();
}

/// Prints restarts; of a process that keeps failing only those whose delay has changed.
class Restarts {
 public:
  explicit Restarts(omnifleet::launch::Progress& progress) : progress_(progress) {}

  void note(const omnifleet::supervisor::Restart& restart) {
    const bool keeps_failing = restart.early_failures > 1;
    const std::string times = keeps_failing ? fmt::format(", {} times", restart.early_failures) : "";
    const std::string what = fmt::format("{} failed ({}{}), restart in {:.1f} s", restart.name, restart.how,
                                         times, restart.delay_s);
    if (keeps_failing) progress_.noteFailing(what);
    double& delay_s = delays_s_[restart.name];
    if (!keeps_failing || restart.delay_s != delay_s) print(what + "\n");
    delay_s = restart.delay_s;
  }

 private:
  omnifleet::launch::Progress& progress_;
  std::map<std::string, double> delays_s_;
};

int launch(const RunRequest& request) {
  using namespace omnifleet;
  std::signal(SIGPIPE, SIG_IGN);  // output without a reader is dropped
  const supervisor::StopSignals
      signals;  // before any thread: a thread that receives Ctrl-C would end the program
  const fleet::Fleet fleet = fleet::Fleet::load(request.fleet_file, request.dataset, request.overlays);
  const bus::HostNetwork network = launch::networkFor(request, fleet);
  const bus::DomainClaim claim(request.domain, request.host);
  bus::removeStaleSharedMemory();
  launch::checkBeforeStart(request, fleet);
  const launch::Resources resources(request, fleet);
  services::removeOldTrajectories(fleet, request.out, request.host);
  supervisor::Options options;
  options.duration_s = request.duration_s;
  options.stop_budget_s = request.stop_within_s;
  const auto processes = launch::plan(request, fleet, network, programFolder());
  const std::string mode = launch::modeOf(request, fleet);
  if (mode == "live") options.end_within_s = kEndWithin_s;
  print(fmt::format("starting {} processes ({}); logs in {}/log\n", processes.size(), mode, request.out));
  std::optional<launch::Progress> progress;
  progress.emplace(launch::Listening{request.domain, network, request.host,
                                     launch::otherHosts(request, fleet), launch::services(request, fleet),
                                     launch::expectedFrames(fleet)});
  const launch::MapFile map_file(request.out);
  Restarts restarts(*progress);
  supervisor::Callbacks callbacks;
  callbacks.on_restart = [&](const supervisor::Restart& restart) { restarts.note(restart); };
  const auto run = supervisor::Supervisor(options).run(processes, callbacks);
  progress.reset();
  bus::removeStaleSharedMemory();
  const int code = report(run, mode, request.out);
  if (mode != "live") return code;
  const launch::SavedMap map = launch::checkSavedMap(request, fleet, map_file);
  if (!map.text.empty()) print(map.text + "\n");
  return map.is_missing && code == 0 ? static_cast<int>(bus::ExitCode::kFailure) : code;
}

}  // namespace

int main(int argc, char** argv) {
  using omnifleet::bus::ExitCode;
  CLI::App app{"Starts a fleet: one process per service and robot"};
  app.require_subcommand(1);
  // One request per command: of two commands with one variable, OMNIFLEET_DOMAIN for the unused command would
  // replace --domain of the used one.
  RunRequest request, replay_request;
  auto* run = app.add_subcommand("run", "run the fleet of a fleet file");
  run->add_option("fleet", request.fleet_file, "fleet file")->required()->check(notEmpty());
  run->add_option("--out", request.out, "run directory")->default_val("out/run")->check(notEmpty());
  run->add_flag("--realtime", request.realtime, "run the arena, image folders and videos in real time");
  addCommon(*run, request);
  auto* replay = app.add_subcommand("replay", "replay a recording at full speed, without losing frames");
  replay->add_option("dataset", replay_request.dataset, "dataset folder")->required()->check(notEmpty());
  replay->add_option("--out", replay_request.out, "run directory")->required()->check(notEmpty());
  addCommon(*replay, replay_request);
  omnifleet::services::silenceImageLibraries();
  omnifleet::bus::redirectDdsLog(
      [](const std::string& line) { std::fprintf(stderr, "launch: %s\n", line.c_str()); });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(ExitCode::kBadOptions);
  }
  try {
    return launch(run->parsed() ? request : replay_request);
  } catch (const omnifleet::options::Error& error) {
    print(fmt::format("{}\n", error.what()));
    return static_cast<int>(ExitCode::kBadOptions);
  } catch (const std::exception& error) {
    print(fmt::format("launch: {}\n", error.what()));
    return static_cast<int>(ExitCode::kFailure);
  }
}
