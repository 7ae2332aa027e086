#include "occupancy/held_samples.h"

#include <algorithm>

namespace omnifleet::occupancy {
namespace {

/// The finaliser of MurmurHash3: every bit of the input changes every bit of the result with probability 1/2.
std::uint64_t mixed(std::uint64_t h) {
  h = (h ^ (h >> 33U)) * 0xff51afd7ed558ccdULL;
  h = (h ^ (h >> 33U)) * 0xc4ceb9fe1a85ec53ULL;
  return h ^ (h >> 33U);
}

bool isEarlier(const HeldSamples::Sample& sample, TimeNs time_ns) {
  return sample.time_ns < time_ns;
}

}  // namespace

void HeldSamples::put(TimeNs time_ns, std::uint64_t digest, Time now) {
  auto place = std::lower_bound(samples_.begin(), samples_.end(), time_ns, isEarlier);
  if (place == samples_.end() || place->time_ns != time_ns) place = samples_.insert(place, Sample{});
  *place = {};
  place->time_ns = time_ns;
  place->digest = mixed(digest);
  place->since = now;
  const auto valid = static_cast<std::size_t>(place - samples_.begin()) + 1;
  if (before_.size() > valid) before_.resize(valid);
}

std::pair<std::size_t, std::size_t> HeldSamples::between(TimeNs first_ns, TimeNs last_ns) const {
  const auto first = std::lower_bound(samples_.begin(), samples_.end(), first_ns, isEarlier);
  const auto last =
      std::upper_bound(first, samples_.end(), last_ns,
                       [](TimeNs time_ns, const Sample& sample) { return time_ns < sample.time_ns; });
  return {static_cast<std::size_t>(first - samples_.begin()),
          static_cast<std::size_t>(last - samples_.begin())};
}

HeldSamples::Sums HeldSamples::sums(TimeNs first_ns, TimeNs last_ns) const {
  const auto [first, last] = between(first_ns, last_ns);
  if (first >= last) return {};
  while (before_.size() <= last) before_.push_back(before_.back() + samples_[before_.size() - 1].digest);
  return {static_cast<std::uint32_t>(last - first), before_[last] - before_[first]};
}

HeldSamples::Sample* HeldSamples::find(TimeNs time_ns, std::uint64_t digest) {
  const auto place = std::lower_bound(samples_.begin(), samples_.end(), time_ns, isEarlier);
  if (place == samples_.end() || place->time_ns != time_ns || place->digest != mixed(digest)) return nullptr;
  return &*place;
}

}  // namespace omnifleet::occupancy
