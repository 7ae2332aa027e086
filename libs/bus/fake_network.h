#pragma once

// Internals of the fake bus: its endpoints and how they match.

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "bus/fake_bus.h"
#include "bus/wake_event.h"

namespace omnifleet::bus {

/// One endpoint on the network. After attach() the mutex of the network guards all members except `signal`.
struct FakeEndpoint {
  enum class Kind { kWriter, kReader };
  Kind kind = Kind::kWriter;
  std::string topic;
  std::string type_name;
  std::string idl_hash;
  std::vector<std::string> partitions;  ///< never empty; "" is the default partition
  std::shared_ptr<BusSignal> signal;    ///< of the bus that owns it
  std::uint64_t id = 0;                 ///< set by attach(), in order of creation

  virtual ~FakeEndpoint() = default;
  /// A peer was attached. The caller holds the mutex.
  virtual void onPeer(FakeEndpoint&) {}
};

class FakeNetwork {
 public:
  std::mutex mutex;

  void attach(FakeEndpoint& endpoint);
  void detach(FakeEndpoint& endpoint);
  int matched(const FakeEndpoint& endpoint);

  /// Calls visit(peer) for every matching endpoint. The caller holds the mutex.
  template <class Visit>
  void forEachPeer(const FakeEndpoint& endpoint, const Visit& visit) {
    for (FakeEndpoint* other : by_topic_[endpoint.topic]) {
      if (match(endpoint, *other)) visit(*other);
    }
  }

 private:
  static bool match(const FakeEndpoint& a, const FakeEndpoint& b);
  std::map<std::string, std::vector<FakeEndpoint*>> by_topic_;
  std::uint64_t next_id_ = 1;
};

/// Frames of one camera on the fake network; see fake_frames.cpp.
std::unique_ptr<FrameWriter> makeFakeFrameWriter(std::shared_ptr<FakeNetwork> network,
                                                 const FakeBusOptions& options,
                                                 std::shared_ptr<BusSignal> signal,
                                                 const std::string& camera_id, std::size_t bytes_needed);
std::unique_ptr<FrameReader> makeFakeFrameReader(std::shared_ptr<FakeNetwork> network,
                                                 const FakeBusOptions& options,
                                                 std::shared_ptr<BusSignal> signal,
                                                 const std::string& camera_id, std::size_t bytes_needed);

}  // namespace omnifleet::bus
