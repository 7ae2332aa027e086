#include "bus/silence.h"

#include <algorithm>

namespace omnifleet::bus {

void Silence::expect(const std::string& who, Clock::time_point now) {
  voices_.emplace(who, Voice{now});
}

void Silence::heard(const std::string& who, bool finished, Clock::time_point now) {
  voices_[who] = {now, true, finished};
}

std::vector<Silence::Silent> Silence::silent(Clock::time_point now) {
  constexpr std::chrono::seconds kHeldUp{1};
  const Clock::duration pause = looked_ ? now - *looked_ : Clock::duration(0);
  looked_ = now;
  std::vector<Silent> all;
  for (auto& [who, voice] : voices_) {
    if (pause > kHeldUp) voice.last = std::min(now, voice.last + pause);
    const auto limit = voice.heard ? limits_.after_a_word : limits_.before_the_first;
    if (voice.finished || now - voice.last <= limit) continue;
    all.push_back({who, std::chrono::duration_cast<std::chrono::seconds>(now - voice.last), voice.heard});
  }
  return all;
}

std::string toString(const Silence::Silent& silent) {
  return (silent.heard ? "silent for " : "not heard in ") + std::to_string(silent.lasts.count()) + " s";
}

}  // namespace omnifleet::bus
