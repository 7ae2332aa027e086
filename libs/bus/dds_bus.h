#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bus/bus.h"
#include "bus/robot_claim.h"

namespace omnifleet::bus {

/// Settings of a DDS participant. The defaults are for one host.
struct DdsBusOptions {
  std::string name = "omnifleet";  ///< participant name, as DDS tools show it
  int domain = 0;                  ///< DDS domain id, 0..232
  RunMode mode = RunMode::kLive;   ///< decides the history of frames
  /// Addresses to use. All other interfaces are excluded, except loopback: processes of one host reach each
  /// other by it whatever happens to the network.
  std::vector<std::string> interfaces = {"127.0.0.1"};
  /// Addresses of other hosts that are asked one by one, beside multicast.
  std::vector<std::string> peers;
  int participants_per_peer = 24;  ///< asked at each peer: at most this many processes there are found
  std::uint32_t max_message_bytes = 65000;  ///< per datagram; ≤ 1400 between hosts (packet loss)
  std::uint32_t socket_buffer_bytes = 4u << 20;
  std::chrono::milliseconds lease{3000};  ///< a participant that is silent for longer is removed
  std::chrono::milliseconds announcement{500};
  std::chrono::milliseconds heartbeat{20};         ///< 4 ms for keep-all histories
  std::chrono::milliseconds write_timeout{30000};  ///< a write() that slow readers block fails after this
  std::string machine;              ///< partition of frames, host/<machine>; empty: the host name
  std::string idl_hash;             ///< replaces the hash of all types when set (tests of the layout guard)
  bool announce_hash = true;        ///< false: behaves like another DDS vendor (tests)
  std::optional<RobotClaim> claim;  ///< announced; stages that belong to no robot have none
  Report report;                    ///< receives layout mismatches, once per writer; may be empty
};

/// A DDS participant (Fast DDS 2.9). Throws std::runtime_error when it cannot be created. Endpoints must be
/// destroyed before the bus.
std::unique_ptr<Bus> makeDdsBus(const DdsBusOptions& options);

}  // namespace omnifleet::bus
