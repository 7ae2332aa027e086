#pragma once

#include <memory>
#include <string>

#include "bus/bus.h"

namespace omnifleet::bus {

/// The network between FakeBus objects: topics, partitions, histories. Thread-safe. write() delivers.
class FakeNetwork;

struct FakeBusOptions {
  RunMode mode = RunMode::kLockstep;  ///< decides the history of frames, as in DdsBus
  std::string machine = "local";      ///< frames reach only readers of the same machine
  std::string idl_hash;               ///< replaces the hash of all types when set (tests of the layout guard)
  Report report;                      ///< may be empty
};

std::shared_ptr<FakeNetwork> makeFakeNetwork();

/// A bus within one process. Matching, keep-last per instance, transient-local history and layout guard
/// behave as in DdsBus. Keep-all queues of samples are unbounded, because no reader could empty them during a
/// blocked write. In deterministic modes the frame history keeps all 8; begin() returns nullptr when it is
/// full. Live mode keeps the last 4. Every FakeBus on one network is one participant. Results do not depend
/// on the number of threads.
std::unique_ptr<Bus> makeFakeBus(std::shared_ptr<FakeNetwork> network, const FakeBusOptions& options = {});

}  // namespace omnifleet::bus
