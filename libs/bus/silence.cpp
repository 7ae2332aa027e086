#include "bus/silence.h"

#include <algorithm>

namespace omnifleet::bus {

void Silence::expect(const std::string& name, Clock::time_point now) {
  records_.emplace(name, Record{now});
}

void Silence::heard(const std::string& name, bool finished, Clock::time_point now) {
  records_[name] = {now, true, finished};
}

std::vector<Silence::Silent> Silence::silent(Clock::time_point now) {
  constexpr std::chrono::seconds kStalled{1};
  const Clock::duration pause = last_check_ ? now - *last_check_ : Clock::duration(0);
  last_check_ = now;
  std::vector<Silent> all;
  for (auto& [name, record] : records_) {
    if (pause > kStalled) record.last = std::min(now, record.last + pause);
    const auto limit = record.heard ? limits_.after_status : limits_.before_first;
    if (record.finished || now - record.last <= limit) continue;
    all.push_back({name, std::chrono::duration_cast<std::chrono::seconds>(now - record.last), record.heard});
  }
  return all;
}

std::string toString(const Silence::Silent& silent) {
  return (silent.heard ? "silent for " : "not heard in ") + std::to_string(silent.lasts.count()) + " s";
}

}  // namespace omnifleet::bus
