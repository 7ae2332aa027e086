#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "bus/dds_bus.h"
#include "bus/topics.h"

namespace omnifleet::test {

/// A stranger on the fleet's domain: reads what the fleet publishes, waits for what a test asks for.
class Listener {
 public:
  explicit Listener(int domain) : bus_(bus::makeDdsBus(options(domain))), topics_(bus::RunMode::kLive) {}

  bus::Bus& bus() { return *bus_; }
  const bus::Topics& topics() const { return topics_; }

  /// Calls `look` after every event until it is true; false on timeout.
  bool until(const std::function<bool()>& look, std::chrono::seconds timeout) {
    const auto end = std::chrono::steady_clock::now() + timeout;
    while (!look()) {
      const auto left = end - std::chrono::steady_clock::now();
      if (left <= std::chrono::nanoseconds(0)) return false;
      bus_->wait(std::min<std::chrono::nanoseconds>(left, std::chrono::milliseconds(200)));
    }
    return true;
  }

  /// Takes samples until one satisfies `wanted`.
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
  static bus::DdsBusOptions options(int domain) {
    bus::DdsBusOptions o;
    o.name = "listener";
    o.domain = domain;
    // A busy machine must not make the fleet think that it has gone.
    o.lease = std::chrono::seconds(30);
    return o;
  }
  std::unique_ptr<bus::Bus> bus_;
  bus::Topics topics_;
};

}  // namespace omnifleet::test
