#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bus/fake_bus.h"
#include "bus/service_runner.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// What a run in one process needs to know.
struct InProcessRun {
  std::string fleet_file;  ///< or
  std::string dataset;     ///< a recording
  std::vector<std::string> overlays;
  std::string out;  ///< run directory; empty: nothing is saved
  std::string log_level = "warn";
  /// Told every problem beside the log; may be empty.
  std::function<void(const std::string& service, const std::string& problem)> on_problem;
};

/// Runs every stage of a fleet on the fake bus, in this thread, to the end of the recording or arena. The
/// services are the very ones of the processes. `each_round(frames_done)` is called now and then: frames that
/// the first robot's merger has handled. Throws options::Error for bad options, std::runtime_error naming the
/// stream that got stuck. False: the map could not be saved.
bool runInProcess(const InProcessRun& run,
                  const std::function<void(std::uint64_t frames_done)>& each_round = {});

/// The factory of a service by its name ("camera", "local_mapper", …).
bus::ServiceFactory factoryOf(const std::string& service);

}  // namespace omnifleet::services
