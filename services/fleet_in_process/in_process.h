#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bus/fake_bus.h"
#include "bus/service_runner.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Options of a run in one process.
struct InProcessRun {
  std::string fleet_file;  ///< this or `dataset`
  std::string dataset;     ///< a recording
  std::vector<std::string> overlays;
  std::string out;  ///< run directory; empty: nothing is saved
  std::string log_level = "warn";
  /// Receives every message besides the log; may be empty.
  std::function<void(const std::string& service, const Message& message)> on_message;
  /// The network of the stages; readers on it receive every sample. Empty: a network of its own.
  std::shared_ptr<bus::FakeNetwork> network;
};

/// Runs every stage of a fleet on the fake bus, in this thread, to the end of the recording or arena. The
/// services are those of the processes. `each_round(frames_done)` is called after each round of spins;
/// `frames_done` is the number of frames that the merger of the first robot has processed. Throws
/// options::Error for invalid options and std::runtime_error on deadlock, with the missing stream. Returns
/// false when the map could not be saved.
bool runInProcess(const InProcessRun& run,
                  const std::function<void(std::uint64_t frames_done)>& each_round = {});

/// The factory of a service by its name ("camera", "local_mapper", …).
bus::ServiceFactory factoryOf(const std::string& service);

}  // namespace omnifleet::services
