#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "occupancy/held_samples.h"
#include "options/options.h"

namespace omnifleet::occupancy {

struct ReconcilerOptions {
  double max_bytes_per_s =
      15000.0;  ///< B/s, samples re-sent by one replica; a mapping robot then stays below 50 kB/s
  double final_bytes_per_s = 1e6;  ///< B/s, the same while the replica ends
  double settle_s = 2.0;    ///< s, what a replica holds for a shorter time may still be on its way to others
  double retry_s = 2.0;     ///< s until a sample is re-sent again; doubles with each attempt, up to 64 times
  double takeover_s = 3.0;  ///< s without a re-sent sample after which the next replica re-sends
  double silent_s = 3.5;    ///< s, a replica without map/have for this long is gone
  double final_s = 0.6;     ///< s, longest exchange before a stopped replica saves
  int max_parts = 64;       ///< ranges in map/have beside those per robot and kind; 45 bytes each

  static ReconcilerOptions read(const options::Section& section);
};

/// What one replica publishes about itself (topic map/have).
struct Have {
  std::string replica;
  bool ending = false;
  std::vector<HeldRange> ranges;
};

/// Decides what a replica publishes about its samples and which samples it re-sends, so that all replicas end
/// with the same set whatever was lost, duplicated, reordered or separated by a partition. Range-based set
/// reconciliation (Meyer 2023), adapted to a topic that all replicas read:
///
/// - Each replica states, per robot and kind, count and digest of a range of time. Any replica can compare
/// any
///   statement with the same range of its own set.
/// - Where they differ, it states its own set in finer ranges: eight parts with equal counts, and the gaps
/// before its
///   first and after its last sample. Both sides refine, so the ranges shrink to the samples that differ
///   within log₈(samples) rounds.
/// - A statement of no sample, or of one, shows exactly which of the own samples the other replica lacks.
/// These are
///   re-sent, oldest first. Poses are small: up to 16 are re-sent without finer statements.
/// - Of several replicas that hold such a sample, the robot's own one re-sends it, otherwise the first by
/// name. The
///   next one takes over when the sample is still missing.
///
/// Contains no DDS and reads no clock.
class Reconciler {
 public:
  using Time = HeldSamples::Time;

  /// @param replica own name @param robots of the fleet: also stated while nothing is held of them
  Reconciler(std::string replica, const std::vector<std::string>& robots, const ReconcilerOptions& options);

  /// The own set has a new sample, or another version of one.
  void put(const SampleId& id, std::uint64_t digest, Time now);
  /// A statement of another replica.
  void receive(const Have& have, Time now);
  /// Any replica, this one included, has re-sent a sample in the version of this digest.
  void noteResent(const std::string& replica, const SampleId& id, std::uint64_t digest, Time now);

  /// Whether have() is due for publication: once per second, up to four times while replicas differ.
  bool isHaveDue(Time now);
  Have have(Time now);
  /// Samples to re-send now, oldest first. Send them in this order while canSend(), and note each with
  /// spend() and noteResent().
  std::vector<SampleId> due(Time now);
  bool canSend(Time now);
  void spend(std::size_t bytes) { budget_bytes_ -= static_cast<double>(bytes); }
  /// Time of the next call without new input.
  Time wakeAt() const;

  /// The replica stops: from now on it states and re-sends everything without delay.
  void end() { is_ending_ = changed_ = true; }
  /// After end(): all replicas are ending and state the same set, or no other replica is left.
  bool isComplete(Time now) const;

 private:
  using Key = std::pair<std::string, SampleKind>;
  struct Peer {
    Time heard{};
    bool is_ending = false;
    std::vector<HeldRange> ranges;
    Time resent{};  ///< last time that it re-sent any sample
  };
  bool isLive(const Peer& peer, Time now) const;
  bool anyEnding(Time now) const;
  bool agrees(const HeldRange& range) const;
  HeldRange mine(const Key& key, TimeNs first_ns, TimeNs last_ns) const;
  HeldRange whole(const Key& key, Time now) const;
  std::vector<HeldRange> parts(Time now) const;
  void addParts(const HeldRange& range, std::vector<HeldRange>& out) const;
  bool mayHoldMore(const HeldRange& range) const;
  void addLacking(const std::string& name, const Peer& peer, const HeldRange& range, Time now,
                  std::vector<SampleId>& out);
  bool isReady(HeldSamples::Sample& sample, Time now) const;
  bool isMyTurn(const std::string& name, const Key& key, const HeldSamples::Sample& sample, Time now) const;
  bool holds(const Peer& peer, const Key& key, TimeNs time_ns) const;

  std::string replica_;
  ReconcilerOptions options_;
  std::map<Key, HeldSamples> sets_;
  std::map<std::string, Peer> peers_;
  std::vector<HeldRange> stated_parts_;  ///< of the last have()
  bool is_ending_ = false;
  bool changed_ = false;  ///< own set or a statement since the last have()
  bool differs_ = false;  ///< a live replica stated another set at the last due()
  Time stated_{};         ///< last have()
  Time compared_{};       ///< last time that the parts were compared with those of the last have()
  Time checked_{};        ///< last due()
  Time refilled_{};
  double budget_bytes_ = 0.0;
};

}  // namespace omnifleet::occupancy
