#pragma once

// Runs each test on every kind of bus: services rely on the same behaviour of the fake bus and of DDS.

#include <gtest/gtest.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bus/dds_bus.h"
#include "bus/domain_claim.h"
#include "bus/fake_bus.h"
#include "bus/topics.h"
#include "options/options.h"

namespace omnifleet::bus {

inline constexpr std::chrono::seconds kPatience{10};  ///< limit for failing tests; events end the waits

/// A domain that no other test process and no launched fleet uses at this time.
inline int ownDomain() {
  constexpr int kFirst = 20, kCount = 40;  // the tests of whole fleets use higher domains
  static const int domain = [] {
    for (int i = 0; i < kCount; ++i) {
      const int tried = kFirst + (static_cast<int>(::getpid()) + i) % kCount;
      try {
        static const DomainClaim claim(tried, "");
        return tried;
      } catch (const options::Error&) {  // in use
      }
    }
    throw std::runtime_error("all DDS domains for tests are in use");
  }();
  return domain;
}

struct Participant {
  RunMode mode = RunMode::kLockstep;
  std::string machine = "here";
  std::string idl_hash = {};
  std::vector<std::string>* reports = nullptr;
  std::optional<RobotClaim> claim = {};  ///< DDS only
};

/// Creates participants of one network: fake, or DDS on loopback in its own domain.
class Network {
 public:
  explicit Network(bool dds) : dds_(dds), fake_(makeFakeNetwork()) {}

  std::unique_ptr<Bus> join(const Participant& participant = {}) const {
    Report report;
    if (participant.reports != nullptr)
      report = [reports = participant.reports](const std::string& line) { reports->push_back(line); };
    return dds_ ? joinDds(participant, report)
                : makeFakeBus(fake_, {participant.mode, participant.machine, participant.idl_hash, report});
  }

 private:
  static std::unique_ptr<Bus> joinDds(const Participant& participant, const Report& report) {
    DdsBusOptions options;
    options.domain = ownDomain();
    options.mode = participant.mode;
    options.machine = participant.machine;
    options.idl_hash = participant.idl_hash;
    options.report = report;
    options.claim = participant.claim;
    return makeDdsBus(options);
  }
  bool dds_;
  std::shared_ptr<FakeNetwork> fake_;
};

class AnyBus : public testing::TestWithParam<const char*> {
 protected:
  bool onDds() const { return std::string(GetParam()) == "Dds"; }
  Network network{onDds()};
};

/// Takes samples until `count` have arrived or kPatience has passed.
template <class T>
std::vector<T> receive(Bus& bus, Reader<T>& reader, std::size_t count) {
  std::vector<T> samples;
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (samples.size() < count && std::chrono::steady_clock::now() < deadline) {
    T sample;
    if (reader.take(sample)) {
      samples.push_back(sample);
    } else {
      bus.wait(std::chrono::seconds(1));
    }
  }
  return samples;
}

inline v1::Pose poseOf(const std::string& robot, std::int64_t time_ns, double x = 0.0) {
  v1::Pose pose;
  pose.robot(robot);
  pose.header().acquired_ns(time_ns);
  pose.map_from_base().x(x);
  return pose;
}

}  // namespace omnifleet::bus
