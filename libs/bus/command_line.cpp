#include <CLI/CLI.hpp>
#include <iostream>

#include "bus/service_runner.h"
#include "options/range_check.h"

namespace omnifleet::bus {
namespace {

void addCommonOptions(CLI::App& app, ServiceOptions& options, int& silence_limit_s) {
  static const std::map<std::string, RunMode> modes = {
      {"live", RunMode::kLive}, {"replay", RunMode::kReplay}, {"lockstep", RunMode::kLockstep}};
  app.add_option("--fleet", options.fleet, "fleet file (YAML)");
  app.add_option("--robot", options.robot, "the robot that this process serves");
  app.add_option("--camera", options.camera, "the camera that this process serves");
  app.add_option("--host", options.host, "the machine of a fleet that runs on several ones");
  app.add_option("--mode", options.mode, "live, replay or lockstep")
      ->transform(CLI::CheckedTransformer(modes).description("{live,replay,lockstep}"));
  app.add_option("--dataset", options.dataset, "dataset folder to read");
  app.add_option("--out", options.out, "run directory to write")->check(options::notEmpty());
  app.add_option("--config", options.configs, "YAML on top of the fleet file; repeatable")
      ->allow_extra_args(false);
  app.add_option("--domain", options.domain, "DDS domain")
      ->envname("OMNIFLEET_DOMAIN")
      ->check(options::domainNumber());
  app.add_option("--incarnation", options.incarnation,
                 "2 or more: number of this process after restarts in this run")
      ->check(CLI::Range(1, 1000000));
  app.add_flag("--record", options.record, "record the run as a dataset in OUT/recording");
  app.add_flag("--debug-images", options.debug_images,
               "local_mapper writes an image of every frame to OUT/debug");
  app.add_option("--log-level", options.log_level, "trace, debug, info, warning, error or off")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error", "off"}));
  app.add_option("--silence-limit", silence_limit_s,
                 "end after this many seconds without input (replay, lockstep)")
      ->check(CLI::Range(1, 86400));
  addNetworkOptions(app, options.network);
  app.add_option("--max-message-bytes", options.network.max_message_bytes,
                 "largest datagram in bytes; default: 1400 between hosts, else 65000")
      ->check(CLI::Range(500, 65000));
}

}  // namespace

std::optional<ExitCode> parseCommandLine(int argc, const char* const* argv, const std::string& name,
                                         const std::function<void(CLI::App&)>& extend,
                                         ServiceOptions& options) {
  CLI::App app("omnifleet " + name, name);
  int silence_limit_s = static_cast<int>(options.silence_limit.count());
  addCommonOptions(app, options, silence_limit_s);
  if (extend) extend(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::cout << app.help();
    return ExitCode::kOk;
  } catch (const CLI::ParseError& problem) {
    std::cerr << name << ": " << problem.what() << "\n";
    return ExitCode::kBadOptions;
  }
  options.silence_limit = std::chrono::seconds(silence_limit_s);
  return std::nullopt;
}

}  // namespace omnifleet::bus
