#include "fleet_in_process/in_process.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <map>
#include <memory>

#include "camera/service.h"
#include "camera/source.h"
#include "classifier/service.h"
#include "common/check_options.h"
#include "formation/service.h"
#include "global_merger/service.h"
#include "local_mapper/service.h"
#include "localizer/service.h"
#include "world/service.h"

namespace omnifleet::services {

bus::ServiceFactory factoryOf(const std::string& service) {
  static const std::map<std::string, bus::ServiceFactory> kFactories{
      {"camera", makeCamera},       {"local_mapper", makeLocalMapper}, {"classifier", makeClassifier},
      {"localizer", makeLocalizer}, {"formation", makeFormation},      {"global_merger", makeGlobalMerger},
      {"world", makeWorld}};
  return kFactories.at(service);
}

namespace {

bus::ServiceOptions optionsFor(const InProcessRun& run, const fleet::Fleet& fleet,
                               const fleet::ProcessSpec& process) {
  bus::ServiceOptions options;
  options.fleet = run.fleet_file;
  options.dataset = run.dataset;
  options.configs = run.overlays;
  options.out = run.out;
  options.mode = fleet.arena ? bus::RunMode::kLockstep : bus::RunMode::kReplay;
  const bool of_camera = process.instance.find('/') != std::string::npos;
  (of_camera ? options.camera : options.robot) = process.instance;
  return options;
}

}  // namespace

bool runInProcess(const InProcessRun& run, const std::function<void(std::uint64_t)>& each_round) {
  const fleet::Fleet fleet = fleet::Fleet::load(run.fleet_file, run.dataset, run.overlays);
  checkOptions(fleet);
  checkOutput(fleet, run.out);
  for (const fleet::CameraSpec& camera : fleet.cameras) checkSource(camera, fleet);
  if (!run.out.empty()) {
    makeOutput(run.out);
    removeOldTrajectories(fleet, run.out);
  }
  auto log =
      std::make_shared<spdlog::logger>("fleet", std::make_shared<spdlog::sinks::stderr_color_sink_st>());
  log->set_level(spdlog::level::from_str(run.log_level));
  const auto network = run.network ? run.network : bus::makeFakeNetwork();
  std::vector<std::unique_ptr<bus::Bus>> buses;  // must outlive the services
  bus::InProcessFleet stages;
  bus::Service* counted = nullptr;
  // Downstream services first, which keeps the queues between the stages short.
  std::vector<fleet::ProcessSpec> processes = fleet::processes(fleet);
  for (auto process = processes.rbegin(); process != processes.rend(); ++process) {
    bus::FakeBusOptions bus_options;
    bus::ServiceOptions options = optionsFor(run, fleet, *process);
    bus_options.mode = options.mode;
    buses.push_back(bus::makeFakeBus(network, bus_options));
    auto service = factoryOf(process->service)({*buses.back(), options, bus::Topics(options.mode), log});
    if (process->service == "global_merger") counted = service.get();
    stages.add(process->service + " " + process->instance, std::move(service));
  }
  stages.onMessage([&](const std::string& service, const Message& message) {
    log->warn("{}: {}", service, toLogLine(message));
    if (run.on_message) run.on_message(service, message);
  });
  return stages.run([&] {
    if (each_round && counted)
      each_round(counted->status().snapshot(std::chrono::steady_clock::now()).processed);
    return true;
  });
}

}  // namespace omnifleet::services
