#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "occupancy/contribution_store.h"
#include "occupancy/reconciler.h"

namespace omnifleet::services {

/// Keeps the replicas of the map equal in live mode, where samples may be lost: publishes what this replica
/// holds (map/have) and re-sends what others lack (map/resend). The decisions are those of
/// occupancy::Reconciler.
class Replication {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// @param robots of the fleet
  Replication(const bus::ServiceContext& context, adapters::RunClock clock, const std::string& robot,
              const std::vector<std::string>& robots, const occupancy::ReconcilerOptions& options);

  /// The set in `store` has changed by this sample.
  void added(const occupancy::ContributionStore& store, const occupancy::Contribution& contribution,
             Time now);
  void added(const occupancy::ContributionStore& store, const occupancy::KeyframePose& pose, Time now);

  /// Takes what the other replicas have published. Calls `add` for each re-sent sample. Returns whether there
  /// was any input.
  bool pull(bus::StatusBoard& status,
            const std::function<void(const occupancy::Contribution&)>& add_contribution,
            const std::function<void(const occupancy::KeyframePose&)>& add_pose);
  /// Publishes and re-sends what is due.
  void send(const occupancy::ContributionStore& store, Time now, bus::StatusBoard& status);
  Time wakeAt() const { return reconciler_.wakeAt(); }

  /// The replica stops (Reconciler::end).
  void end() { reconciler_.end(); }
  bool isComplete(Time now) const { return reconciler_.isComplete(now); }
  std::chrono::nanoseconds longestEnd() const;

 private:
  void pullResent(bus::StatusBoard& status,
                  const std::function<void(const occupancy::Contribution&)>& add_contribution,
                  const std::function<void(const occupancy::KeyframePose&)>& add_pose);
  void publishHave(Time now, bus::StatusBoard& status);
  void resend(const occupancy::ContributionStore& store, Time now, bus::StatusBoard& status);
  void flush(bus::StatusBoard& status);

  std::string robot_;
  adapters::RunClock clock_;
  occupancy::ReconcilerOptions options_;
  occupancy::Reconciler reconciler_;
  std::unique_ptr<bus::Reader<v1::Have>> have_in_;
  std::unique_ptr<bus::Writer<v1::Have>> have_out_;
  std::unique_ptr<bus::Reader<v1::Resend>> resend_in_;
  std::unique_ptr<bus::Writer<v1::Resend>> resend_out_;
  v1::Have have_;
  v1::Resend received_, resend_;
  std::uint32_t haves_ = 0, resends_ = 0;
};

}  // namespace omnifleet::services
