#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::occupancy {

/// The two sets that a map consists of.
enum class SampleKind : std::uint8_t { kContribution = 0, kKeyframePose = 1 };

/// The open ends of ranges of time.
constexpr TimeNs kEarliest = INT64_MIN, kLatest = INT64_MAX;

/// What a replica holds of one robot and kind with first_ns ≤ time ≤ last_ns.
struct HeldRange {
  std::string robot;
  SampleKind kind = SampleKind::kContribution;
  TimeNs first_ns = kEarliest, last_ns = kLatest;
  std::uint32_t count = 0;
  std::uint64_t digest = 0;  ///< sum of the mixed digests of the samples, independent of their order
};

/// A sample of the map; robot, kind and time identify it.
struct SampleId {
  std::string robot;
  SampleKind kind = SampleKind::kContribution;
  TimeNs time_ns = 0;
};

/// Times and digests of all samples of one robot and kind that this replica holds, in order of time.
class HeldSamples {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct Sample {
    TimeNs time_ns = 0;
    std::uint64_t digest = 0;              ///< mixed
    Time since{};                          ///< held in this version since
    Time missing_since{}, missing_last{};  ///< another replica was found to lack it: first and latest time
    Time resent{};                         ///< last time that any replica re-sent it
    int attempts = 0;                      ///< number of times that it was re-sent since `missing_since`
  };
  struct Sums {
    std::uint32_t count = 0;
    std::uint64_t digest = 0;
  };

  /// Adds a sample, or replaces its version. `digest`: of its canonical bytes. It is mixed before it is
  /// summed: the last bytes of FNV-1a change the hash almost linearly, so that plain sums of different sets
  /// could be equal.
  void put(TimeNs time_ns, std::uint64_t digest, Time now);

  /// Places [first, last) of the samples in a range of time, both ends included.
  std::pair<std::size_t, std::size_t> between(TimeNs first_ns, TimeNs last_ns) const;
  Sums sums(TimeNs first_ns, TimeNs last_ns) const;
  const std::vector<Sample>& samples() const { return samples_; }
  Sample& at(std::size_t place) { return samples_[place]; }
  /// Null if another version or none is held.
  Sample* find(TimeNs time_ns, std::uint64_t digest);

 private:
  std::vector<Sample> samples_;
  mutable std::vector<std::uint64_t> before_{0};  ///< sum of the digests before each place, as far as valid
};

}  // namespace omnifleet::occupancy
