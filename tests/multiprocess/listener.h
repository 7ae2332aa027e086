#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "bus/dds_bus.h"
#include "bus/topics.h"

namespace omnifleet::test {

/// An external participant on the domain of the fleet: reads what the fleet publishes and waits for
/// conditions.
class Listener {
 public:
  /// @param address of the machine's network; empty: loopback
  explicit Listener(int domain, const std::string& address = {})
      : bus_(bus::makeDdsBus(options(domain, address))), topics_(bus::RunMode::kLive) {}

  bus::Bus& bus() { return *bus_; }
  const bus::Topics& topics() const { return topics_; }

  /// Evaluates `condition` after every event until it is true. Returns false on timeout.
  bool until(const std::function<bool()>& condition, std::chrono::seconds timeout) {
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (!condition()) {
      const auto left = end - std::chrono::steady_clock::now();
      if (left <= std::chrono::nanoseconds(0)) return false;
      bus_->wait(std::min<std::chrono::nanoseconds>(left, std::chrono::milliseconds(200)));
    }
    return true;
  }

  /// Takes samples until one satisfies `wanted`. Returns false on timeout.
  template <class T>
  bool untilSample(bus::Reader<T>& reader, T& sample, const std::function<bool(const T&)>& wanted,
                   std::chrono::seconds timeout) {
    return until(
        [&] {
          while (reader.take(sample)) {
            if (wanted(sample)) return true;
          }
          return false;
        },
        timeout);
  }

 private:
  static bus::DdsBusOptions options(int domain, const std::string& address) {
    bus::DdsBusOptions o;
    o.name = "listener";
    o.domain = domain;
    // On a busy machine the fleet must not consider this participant gone. Between hosts all leases must be
    // equal (docs/methods/dds.md).
    if (address.empty())
      o.lease = std::chrono::seconds(30);
    else
      o.interfaces = {address};
    return o;
  }
  std::unique_ptr<bus::Bus> bus_;
  bus::Topics topics_;
};

}  // namespace omnifleet::test
