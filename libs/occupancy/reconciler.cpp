#include "occupancy/reconciler.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace omnifleet::occupancy {
namespace {

using Time = Reconciler::Time;
using std::chrono::milliseconds;

constexpr std::size_t kParts = 8;    // of a range in which replicas differ
constexpr std::size_t kAtOnce = 64;  // samples returned by one due(): a second at 64 poses of 130 bytes each
constexpr std::size_t kOfOthers = 64;    // samples examined per range whose re-sender is another replica
constexpr milliseconds kPeriod{1000};    // of map/have
constexpr milliseconds kFast{250};       // shortest period while replicas differ
constexpr milliseconds kAtEnd{20};       // shortest period while a replica ends
constexpr milliseconds kCheck{100};      // between two calls of due() with work to do
constexpr double kSettleAtEnd_s = 0.05;  // a re-sent sample travels for some ms
constexpr int kMostDoublings = 6;        // of retry_s

std::chrono::nanoseconds seconds(double s) {
  return std::chrono::nanoseconds(std::llround(s * 1e9));
}

/// Up to this count a statement is not refined: which samples differ is known, or sending all is cheaper.
std::uint32_t leafOf(SampleKind kind) {
  return kind == SampleKind::kContribution ? 1 : 16;
}

bool isSame(const HeldRange& a, const HeldRange& b) {
  return a.robot == b.robot && a.kind == b.kind && a.first_ns == b.first_ns && a.last_ns == b.last_ns;
}
bool isEqual(const HeldRange& a, const HeldRange& b) {
  return isSame(a, b) && a.count == b.count && a.digest == b.digest;
}
bool contains(const HeldRange& a, const HeldRange& b) {
  return a.robot == b.robot && a.kind == b.kind && a.first_ns <= b.first_ns && b.last_ns <= a.last_ns;
}
bool isOlder(const HeldRange& a, const HeldRange& b) {
  return std::tie(a.first_ns, a.last_ns, a.robot, a.kind) < std::tie(b.first_ns, b.last_ns, b.robot, b.kind);
}

}  // namespace

ReconcilerOptions ReconcilerOptions::read(const options::Section& section) {
  ReconcilerOptions o;
  section.read("max_bytes_per_s", o.max_bytes_per_s, {1000.0, 1e9});
  section.read("final_bytes_per_s", o.final_bytes_per_s, {1000.0, 1e9});
  section.read("settle_s", o.settle_s, {0.0, 60.0});
  section.read("retry_s", o.retry_s, {0.1, 600.0});
  section.read("takeover_s", o.takeover_s, {0.1, 600.0});
  section.read("silent_s", o.silent_s, {1.5, 600.0});
  section.read("final_s", o.final_s, {0.0, 1.0});
  section.read("max_parts", o.max_parts, {16, 128});
  section.finish();
  return o;
}

Reconciler::Reconciler(std::string replica, const std::vector<std::string>& robots,
                       const ReconcilerOptions& options)
    : replica_(std::move(replica)), options_(options) {
  for (const std::string& robot : robots)
    for (const SampleKind kind : {SampleKind::kContribution, SampleKind::kKeyframePose}) sets_[{robot, kind}];
}

void Reconciler::put(const SampleId& id, std::uint64_t digest, Time now) {
  sets_[{id.robot, id.kind}].put(id.time_ns, digest, now);
  changed_ = true;
}

void Reconciler::receive(const Have& have, Time now) {
  if (have.replica == replica_) return;
  Peer& peer = peers_[have.replica];
  peer.heard = now;
  peer.is_ending = have.ending;
  peer.ranges = have.ranges;
  for (const HeldRange& range : have.ranges) sets_[{range.robot, range.kind}];  // of robots not known before
  changed_ = true;
}

void Reconciler::noteResent(const std::string& replica, const SampleId& id, std::uint64_t digest, Time now) {
  if (replica != replica_) peers_[replica].resent = now;
  const auto set = sets_.find({id.robot, id.kind});
  if (set == sets_.end()) return;
  if (HeldSamples::Sample* sample = set->second.find(id.time_ns, digest)) {
    sample->resent = now;
    ++sample->attempts;
  }
}

/// A replica that has ended is gone sooner: no other replica waits for it.
bool Reconciler::isLive(const Peer& peer, Time now) const {
  return peer.heard != Time{} &&
         now - peer.heard < (peer.is_ending ? seconds(1.0) : seconds(options_.silent_s));
}

bool Reconciler::anyEnding(Time now) const {
  return is_ending_ || std::any_of(peers_.begin(), peers_.end(), [&](const auto& entry) {
           return entry.second.is_ending && isLive(entry.second, now);
         });
}

HeldRange Reconciler::mine(const Key& key, TimeNs first_ns, TimeNs last_ns) const {
  HeldRange range{key.first, key.second, first_ns, last_ns};
  const auto set = sets_.find(key);
  if (set == sets_.end()) return range;
  const HeldSamples::Sums sums = set->second.sums(first_ns, last_ns);
  range.count = sums.count;
  range.digest = sums.digest;
  return range;
}

bool Reconciler::agrees(const HeldRange& range) const {
  return isEqual(range, mine({range.robot, range.kind}, range.first_ns, range.last_ns));
}

/// Everything up to the newest sample that has settled: later ones may still be on their way to the other
/// replicas.
HeldRange Reconciler::whole(const Key& key, Time now) const {
  const auto& samples = sets_.at(key).samples();
  if (is_ending_ || samples.empty()) return mine(key, kEarliest, kLatest);
  const auto settled = std::find_if(samples.rbegin(), samples.rend(), [&](const HeldSamples::Sample& sample) {
    return now - sample.since >= seconds(options_.settle_s);
  });
  if (settled == samples.rend())
    return mine(key, kEarliest, std::max(samples.front().time_ns, kEarliest + 1) - 1);
  return mine(key, kEarliest, settled->time_ns);
}

/// Whether the replica that states this range may hold a sample that this replica lacks.
bool Reconciler::mayHoldMore(const HeldRange& range) const {
  if (range.count == 0 || agrees(range)) return false;
  if (range.count > 1) return true;
  const HeldSamples& set = sets_.at({range.robot, range.kind});
  const auto [first, last] = set.between(range.first_ns, range.last_ns);
  const auto& samples = set.samples();
  for (std::size_t i = first; i < last; ++i)
    if (samples[i].digest == range.digest) return false;
  return true;
}

/// States the own samples of this range.
void Reconciler::addParts(const HeldRange& range, std::vector<HeldRange>& out) const {
  const Key key{range.robot, range.kind};
  const HeldSamples& set = sets_.at(key);
  const auto [first, last] = set.between(range.first_ns, range.last_ns);
  const std::size_t count = last - first;
  if (count <= leafOf(range.kind)) {
    out.push_back(mine(key, range.first_ns, range.last_ns));
    return;
  }
  const auto& samples = set.samples();
  const TimeNs begins = samples[first].time_ns, ends = samples[last - 1].time_ns;
  if (range.first_ns < begins) out.push_back({key.first, key.second, range.first_ns, begins - 1});
  const std::size_t parts = std::min(kParts, count);
  for (std::size_t k = 0; k < parts; ++k) {
    const TimeNs from = samples[first + k * count / parts].time_ns;
    const TimeNs to = k + 1 < parts ? samples[first + (k + 1) * count / parts].time_ns - 1 : ends;
    out.push_back(mine(key, from, to));
  }
  if (ends < range.last_ns) out.push_back({key.first, key.second, ends + 1, range.last_ns});
}

/// The finer statements: of the smallest ranges of other replicas that differ, the oldest first.
std::vector<HeldRange> Reconciler::parts(Time now) const {
  std::vector<HeldRange> differing;
  for (const auto& [name, peer] : peers_) {
    if (!isLive(peer, now)) continue;
    std::vector<HeldRange> of_peer;
    std::copy_if(peer.ranges.begin(), peer.ranges.end(), std::back_inserter(of_peer),
                 [&](const HeldRange& range) { return !agrees(range); });
    for (const HeldRange& range : of_peer) {
      const bool has_finer = std::any_of(of_peer.begin(), of_peer.end(), [&](const HeldRange& other) {
        return contains(range, other) && !isSame(range, other);
      });
      if (!has_finer && mayHoldMore(range)) differing.push_back(range);
    }
  }
  std::sort(differing.begin(), differing.end(), isOlder);
  differing.erase(std::unique(differing.begin(), differing.end(), isSame), differing.end());
  std::vector<HeldRange> all;
  const auto most = static_cast<std::size_t>(options_.max_parts);
  for (const HeldRange& range : differing) {
    if (all.size() >= most) break;
    addParts(range, all);
  }
  std::sort(all.begin(), all.end(), isOlder);
  all.erase(std::unique(all.begin(), all.end(), isSame), all.end());
  if (all.size() > most) all.resize(most);
  return all;
}

bool Reconciler::isHaveDue(Time now) {
  if (stated_ == Time{} || now - stated_ >= kPeriod) return true;
  if (!changed_) return false;
  if (anyEnding(now)) return now - stated_ >= kAtEnd;
  if (now - compared_ < kFast) return false;
  compared_ = now;
  const std::vector<HeldRange> finer = parts(now);
  return !std::equal(finer.begin(), finer.end(), stated_parts_.begin(), stated_parts_.end(), isEqual);
}

Have Reconciler::have(Time now) {
  Have have{replica_, is_ending_, {}};
  for (const auto& [key, set] : sets_) have.ranges.push_back(whole(key, now));
  stated_parts_ = parts(now);
  have.ranges.insert(have.ranges.end(), stated_parts_.begin(), stated_parts_.end());
  stated_ = compared_ = now;
  changed_ = false;
  return have;
}

std::vector<SampleId> Reconciler::due(Time now) {
  const bool at_end = anyEnding(now);
  if (now - checked_ < (at_end ? kAtEnd : kCheck)) return {};
  checked_ = now;
  differs_ = false;
  std::vector<SampleId> all;
  for (const auto& [name, peer] : peers_) {
    if (!isLive(peer, now)) continue;
    for (const HeldRange& range : peer.ranges) {
      if (agrees(range)) continue;
      differs_ = true;
      addLacking(name, peer, range, now, all);
    }
  }
  const auto orderOf = [](const SampleId& id) { return std::tie(id.time_ns, id.robot, id.kind); };
  std::sort(all.begin(), all.end(),
            [&](const SampleId& a, const SampleId& b) { return orderOf(a) < orderOf(b); });
  all.erase(std::unique(all.begin(), all.end(),
                        [&](const SampleId& a, const SampleId& b) { return orderOf(a) == orderOf(b); }),
            all.end());
  if (all.size() > kAtOnce) all.resize(kAtOnce);
  return all;
}

/// Adds the own samples that the replica surely lacks by this statement, as far as they are to be re-sent
/// now.
void Reconciler::addLacking(const std::string& name, const Peer& peer, const HeldRange& range, Time now,
                            std::vector<SampleId>& out) {
  const Key key{range.robot, range.kind};
  HeldSamples& set = sets_.at(key);
  const auto [first, last] = set.between(range.first_ns, range.last_ns);
  const std::uint32_t leaf = leafOf(range.kind);
  if (range.count > 1 && (range.count > leaf || last - first > leaf)) return;
  const double settle_s = is_ending_ || peer.is_ending ? kSettleAtEnd_s : options_.settle_s;
  std::size_t found = 0, of_others = 0;
  for (std::size_t i = first; i < last && found < kAtOnce && of_others < kOfOthers; ++i) {
    HeldSamples::Sample& sample = set.at(i);
    if (range.count == 1 && sample.digest == range.digest) continue;
    if (sample.since + seconds(settle_s) > peer.heard) continue;  // it may have been on its way
    if (!isReady(sample, now)) continue;
    if (!isMyTurn(name, key, sample, now)) {
      ++of_others;
      continue;
    }
    out.push_back({key.first, key.second, sample.time_ns});
    ++found;
  }
}

/// False while a re-sent sample may be on its way.
bool Reconciler::isReady(HeldSamples::Sample& sample, Time now) const {
  if (now - sample.missing_last > seconds(2.0 * options_.silent_s)) {
    sample.missing_since = now;
    sample.attempts = 0;
  }
  sample.missing_last = now;
  if (sample.attempts == 0) return true;
  const double retry_s = is_ending_ ? 4.0 * kSettleAtEnd_s : options_.retry_s;
  return now - sample.resent >= seconds(std::ldexp(retry_s, std::min(sample.attempts - 1, kMostDoublings)));
}

/// Whether no other replica is to re-send this sample first: the robot's own one, then in order of names.
/// Each one waits for one period longer than the one before it, and while that one is busy with other
/// samples.
bool Reconciler::isMyTurn(const std::string& name, const Key& key, const HeldSamples::Sample& sample,
                          Time now) const {
  const auto rank = [&](const std::string& replica) { return std::pair(replica != key.first, replica); };
  const auto takeover = is_ending_ ? seconds(2.0 * kSettleAtEnd_s) : seconds(options_.takeover_s);
  auto from = sample.attempts > 0 ? sample.resent : sample.missing_since;
  for (const auto& [other, peer] : peers_) {
    if (other == name || !(rank(other) < rank(replica_)) || !isLive(peer, now)) continue;
    if (!holds(peer, key, sample.time_ns)) continue;
    from += takeover;
    const bool is_busy = now - peer.resent < takeover;
    if (now < from || (sample.attempts == 0 && is_busy)) return false;
  }
  return true;
}

/// Whether the smallest range that the replica states around this time agrees with the own set.
bool Reconciler::holds(const Peer& peer, const Key& key, TimeNs time_ns) const {
  const HeldRange* smallest = nullptr;
  for (const HeldRange& range : peer.ranges) {
    if (range.robot != key.first || range.kind != key.second) continue;
    if (time_ns < range.first_ns || range.last_ns < time_ns) continue;
    if (smallest == nullptr || contains(*smallest, range)) smallest = &range;
  }
  return smallest != nullptr && agrees(*smallest);
}

bool Reconciler::canSend(Time now) {
  const double rate = is_ending_ ? options_.final_bytes_per_s : options_.max_bytes_per_s;
  if (refilled_ == Time{}) refilled_ = now - std::chrono::seconds(1);
  budget_bytes_ += rate * std::chrono::duration<double>(now - refilled_).count();
  budget_bytes_ = std::min(budget_bytes_, rate);  // of one second
  refilled_ = now;
  return budget_bytes_ > 0;
}

Reconciler::Time Reconciler::wakeAt() const {
  const Time next = changed_ ? std::min(stated_ + kPeriod, compared_ + kFast) : stated_ + kPeriod;
  return differs_ ? std::min(next, checked_ + kCheck) : next;
}

bool Reconciler::isComplete(Time now) const {
  if (!is_ending_ || changed_) return false;
  return std::all_of(peers_.begin(), peers_.end(), [&](const auto& entry) {
    const Peer& peer = entry.second;
    if (!isLive(peer, now)) return true;
    return peer.is_ending && std::all_of(peer.ranges.begin(), peer.ranges.end(),
                                         [&](const HeldRange& range) { return agrees(range); });
  });
}

}  // namespace omnifleet::occupancy
