#pragma once

// Replicas of a set on a simulated network that loses, duplicates, delays and reorders messages. No DDS, no
// clock.

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "occupancy/reconciler.h"

namespace omnifleet::occupancy {

using Key = std::tuple<std::string, SampleKind, TimeNs>;
using Set = std::map<Key, std::uint64_t>;  ///< version of each sample; the greatest wins

struct NetworkOptions {
  double lost_live = 0.0;  ///< 1, share of live samples that a replica never receives
  double lost = 0.0;       ///< 1, the same of map/have and map/resend
  double duplicated = 0.0;
  std::chrono::milliseconds longest_delay{30};  ///< shorter ones reorder
  ReconcilerOptions reconciler;
};

class ReplicaNetwork {
 public:
  using Time = Reconciler::Time;
  static constexpr std::chrono::milliseconds kStep{10};
  static std::size_t bytesOf(SampleKind kind) { return kind == SampleKind::kContribution ? 5000 : 130; }

  struct Replica {
    Set set;
    std::unique_ptr<Reconciler> reconciler;
    bool is_up = true;
    std::size_t resent_bytes = 0, have_ranges = 0, haves = 0, largest_have = 0;
    std::vector<std::pair<Time, std::size_t>> resends;  ///< time and bytes
    std::vector<Key> resent;
  };

  ReplicaNetwork(std::vector<std::string> robots, unsigned seed, NetworkOptions options)
      : robots_(std::move(robots)), options_(std::move(options)), random_(seed) {
    for (const std::string& robot : robots_) restart(robot);
  }

  Time now() const { return now_; }
  Replica& at(const std::string& name) { return replicas_.at(name); }
  const std::vector<std::string>& robots() const { return robots_; }

  /// The replica has lost everything, or joins.
  void restart(const std::string& name) {
    replicas_[name] = {};
    replicas_[name].reconciler = std::make_unique<Reconciler>(name, robots_, options_.reconciler);
  }
  void stop(const std::string& name) { replicas_.at(name).is_up = false; }
  /// Replicas of different groups do not reach each other. Empty: all do.
  void partition(std::map<std::string, int> groups) { groups_ = std::move(groups); }
  /// The replica drops these samples whenever it receives them.
  void reject(const std::string& name, const Key& key) { rejected_.emplace(name, key); }

  /// The robot's own replica makes a sample and publishes it.
  void make(const std::string& robot, SampleKind kind, TimeNs time_ns, std::uint64_t version = 1) {
    const Key key{robot, kind, time_ns};
    add(robot, key, version);
    for (const std::string& other : robots_)
      if (other != robot && !happens(options_.lost_live))
        deliver(robot, other, [this, other, key, version] { add(other, key, version); });
  }
  /// One keyframe of each of these robots every 0.4 s.
  void drive(const std::vector<std::string>& robots, std::chrono::nanoseconds duration) {
    const Time end = now_ + duration;
    while (now_ < end) {
      for (const std::string& robot : robots) {
        const TimeNs time_ns = now_.time_since_epoch().count() + static_cast<TimeNs>(random_() % 1000);
        make(robot, SampleKind::kContribution, time_ns);
        make(robot, SampleKind::kKeyframePose, time_ns);
      }
      run(std::chrono::milliseconds(400));
    }
  }
  void run(std::chrono::nanoseconds duration) {
    for (const Time end = now_ + duration; now_ < end; now_ += kStep) step();
  }
  /// Runs until all replicas that are up hold the same. Returns the time that this took, or `most`.
  std::chrono::nanoseconds runUntilEqual(std::chrono::nanoseconds most) {
    const Time begin = now_;
    while (!areEqual() && now_ - begin < most) run(10 * kStep);
    return now_ - begin;
  }
  bool areEqual() const {
    const Set* first = nullptr;
    for (const auto& [name, replica] : replicas_) {
      if (!replica.is_up) continue;
      if (first != nullptr && *first != replica.set) return false;
      first = &replica.set;
    }
    return true;
  }
  std::size_t resentBytes() const {
    std::size_t sum = 0;
    for (const auto& [name, replica] : replicas_) sum += replica.resent_bytes;
    return sum;
  }
  void step() {
    arrive();
    for (auto& [name, replica] : replicas_) {
      if (!replica.is_up) continue;
      if (replica.reconciler->isHaveDue(now_)) publishHave(name, replica);
      resend(name, replica);
    }
  }

 private:
  bool happens(double share) { return std::uniform_real_distribution<double>()(random_) < share; }

  void add(const std::string& name, const Key& key, std::uint64_t version) {
    if (rejected_.count({name, key}) > 0) return;
    Replica& replica = replicas_.at(name);
    std::uint64_t& held = replica.set[key];
    if (held >= version) return;
    held = version;
    const auto& [robot, kind, time_ns] = key;
    const std::uint64_t digest = std::hash<std::string>()(robot) + 31 * static_cast<std::uint64_t>(time_ns) +
                                 7 * static_cast<std::uint64_t>(kind) + version;
    replica.reconciler->put({robot, kind, time_ns}, digest, now_);
  }

  static std::uint64_t digestOf(const Key& key, std::uint64_t version) {
    const auto& [robot, kind, time_ns] = key;
    return std::hash<std::string>()(robot) + 31 * static_cast<std::uint64_t>(time_ns) +
           7 * static_cast<std::uint64_t>(kind) + version;
  }
  void deliver(const std::string& from, const std::string& to, std::function<void()> action) {
    if (!groups_.empty() && groups_.at(from) != groups_.at(to)) return;
    const auto delay = std::chrono::milliseconds(random_() % (options_.longest_delay.count() + 1));
    on_the_way_.emplace(now_ + delay, [this, to, action = std::move(action)] {
      if (replicas_.at(to).is_up) action();
    });
  }
  void toOthers(const std::string& from, const std::function<void(const std::string&)>& action) {
    for (const std::string& to : robots_) {
      if (to == from || happens(options_.lost)) continue;
      deliver(from, to, [to, action] { action(to); });
      if (happens(options_.duplicated)) deliver(from, to, [to, action] { action(to); });
    }
  }
  void arrive() {
    while (!on_the_way_.empty() && on_the_way_.begin()->first <= now_) {
      const auto action = std::move(on_the_way_.begin()->second);
      on_the_way_.erase(on_the_way_.begin());
      action();
    }
  }
  void publishHave(const std::string& name, Replica& replica) {
    const Have have = replica.reconciler->have(now_);
    replica.have_ranges += have.ranges.size();
    replica.largest_have = std::max(replica.largest_have, have.ranges.size());
    ++replica.haves;
    toOthers(name, [this, have](const std::string& to) { replicas_.at(to).reconciler->receive(have, now_); });
  }
  void resend(const std::string& name, Replica& replica) {
    for (const SampleId& id : replica.reconciler->due(now_)) {
      if (!replica.reconciler->canSend(now_)) break;
      const Key key{id.robot, id.kind, id.time_ns};
      const std::uint64_t version = replica.set.at(key);
      replica.reconciler->spend(bytesOf(id.kind));
      replica.resent_bytes += bytesOf(id.kind);
      replica.resends.emplace_back(now_, bytesOf(id.kind));
      replica.resent.push_back(key);
      replica.reconciler->noteResent(name, id, digestOf(key, version), now_);
      toOthers(name, [this, name, id, key, version](const std::string& to) {
        add(to, key, version);
        replicas_.at(to).reconciler->noteResent(name, id, digestOf(key, version), now_);
      });
    }
  }

  std::vector<std::string> robots_;
  NetworkOptions options_;
  std::mt19937 random_;
  Time now_{std::chrono::hours(1)};
  std::map<std::string, Replica> replicas_;
  std::map<std::string, int> groups_;
  std::set<std::pair<std::string, Key>> rejected_;
  std::multimap<Time, std::function<void()>> on_the_way_;
};

}  // namespace omnifleet::occupancy
