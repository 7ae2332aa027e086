#pragma once

#include <memory>
#include <string>

#include "bus/bus.h"

namespace omnifleet::bus {

/// The air between FakeBus objects: topics, partitions, histories. Thread-safe; delivery happens in write().
class FakeNetwork;

struct FakeBusOptions {
  RunMode mode = RunMode::kLockstep;  ///< decides the frames' history as in DdsBus
  std::string machine = "local";      ///< frames reach readers of the same machine only
  std::string idl_hash;  ///< stands in for the types' own hash when set (tests of the layout guard)
  Report report;         ///< may be empty
};

std::shared_ptr<FakeNetwork> makeFakeNetwork();

/// A bus within one process: same matching, keep-last per instance, transient-local and layout-guard
/// semantics as DdsBus, but keep-all queues of samples have no bound (nobody could empty them during a
/// blocked write). Frames keep all 8 (deterministic modes): a full channel makes begin() return nullptr; live
/// keeps the last 4. Every FakeBus on one network is one participant. Same results single- or multi-threaded.
std::unique_ptr<Bus> makeFakeBus(std::shared_ptr<FakeNetwork> network, const FakeBusOptions& options = {});

}  // namespace omnifleet::bus
