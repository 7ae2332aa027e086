#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bus/election.h"
#include "bus/service.h"

namespace omnifleet::services {

/// The candidacy of this process for an office of the fleet (topic election). A thread of its own publishes
/// it, so that a service that computes for a second is not taken for dead. A service that has not called
/// update() for kHang is: it hangs.
class Office {
 public:
  using Time = bus::Election::Time;

  static constexpr std::chrono::milliseconds kPeriod{125}, kLease{500};
  static constexpr std::chrono::seconds kHang{5};

  /// @param office "map", "estimator" @param candidates all of them, in the order in which they take the
  /// office; contains `self`
  Office(const bus::ServiceContext& context, const std::string& office,
         const std::vector<std::string>& candidates, const std::string& self, Time now);
  ~Office();

  /// Hears the others and decides. Returns true when term() has changed.
  bool update(Time now);
  std::uint32_t term() const { return election_.term(); }  ///< 0: stands by
  void noteTerm(std::uint32_t term) { election_.noteTerm(term); }
  /// When update() is due if nothing is heard.
  std::optional<Time> wakeAt() const;
  /// The work is done, or (not finished) this process ends before it is done and another one may go on.
  void leave(bool finished);

 private:
  class Heartbeat;
  struct Other {
    std::optional<Time> heard;
    std::uint32_t term = 0, yielded = 0;
  };

  std::string office_;
  std::vector<std::string> candidates_;
  std::size_t rank_;
  bus::Election election_;
  std::vector<Other> others_;  ///< by rank; the own entry is empty
  std::unique_ptr<bus::Reader<v1::Candidacy>> reader_;
  v1::Candidacy sample_;
  std::unique_ptr<Heartbeat> heartbeat_;
};

}  // namespace omnifleet::services
