#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bus/bus.h"

namespace omnifleet::bus {

/// How a participant meets the others. The defaults are for one host.
struct DdsBusOptions {
  std::string name = "omnifleet";                       ///< participant name, seen in DDS tools
  int domain = 0;                                       ///< DDS domain id, 0..232
  RunMode mode = RunMode::kLive;                        ///< decides the frames' history
  std::vector<std::string> interfaces = {"127.0.0.1"};  ///< addresses that may be used; others hear nothing
  std::uint32_t max_message_bytes = 65000;              ///< of one datagram; ≤ 1400 off-host (packet loss)
  std::uint32_t socket_buffer_bytes = 4u << 20;
  std::chrono::milliseconds lease{3000};  ///< a participant silent for so long is gone
  std::chrono::milliseconds announcement{500};
  std::chrono::milliseconds heartbeat{20};         ///< 4 ms where a history keeps all
  std::chrono::milliseconds write_timeout{30000};  ///< a write() blocked by slow readers gives up after this
  std::string machine;        ///< partition of frames, host/<machine>; empty: the host's name
  std::string idl_hash;       ///< replaces the types' own hash when set (tests of the layout guard)
  bool announce_hash = true;  ///< false: looks like a foreign vendor (tests)
  Report report;              ///< layout mismatches, once per writer; may be empty
};

/// A participant in the DDS world (Fast DDS 2.9). Throws std::runtime_error when it cannot be created.
/// Endpoints must be destroyed before the bus.
std::unique_ptr<Bus> makeDdsBus(const DdsBusOptions& options);

}  // namespace omnifleet::bus
