#include "status/table.h"

#include <fmt/format.h>

#include <algorithm>

namespace omnifleet::status {
namespace {

bus::ServiceState stateOf(const v1::ServiceStatus& sample) {
  return static_cast<bus::ServiceState>(sample.state());
}

/// A launcher's status is degraded while it misses somebody, and for nothing else.
bool missesSomebody(const v1::ServiceStatus& sample) {
  return sample.service() == "launch" && stateOf(sample) == bus::ServiceState::kDegraded;
}

std::string lastColumn(const std::string& silent, const std::string& error) {
  return silent.empty() || error.empty() ? silent + error : silent + "; before: " + error;
}

std::string leaderOf(const v1::FormationState& state) {
  return fmt::format("{} (term {})", state.leader().to_string(), state.term());
}

/// "leader: r2 (term 1)": the latest succession holds. Who was lost in it is named until it obeys, too.
std::string leaderLine(const std::map<std::string, v1::FormationState>& states) {
  if (states.empty()) return {};
  const auto latest = std::max_element(states.begin(), states.end(), [](const auto& a, const auto& b) {
    return a.second.term() < b.second.term();
  });
  const std::string leader = leaderOf(latest->second);
  std::string line = "leader: " + leader;
  for (const auto& [robot, state] : states) {
    if (leaderOf(state) != leader) line += fmt::format("; {} last obeyed {}", robot, leaderOf(state));
  }
  return line + "\n";
}

}  // namespace

void Table::put(const v1::ServiceStatus& sample, Clock::time_point now) {
  const std::string service = sample.service().to_string(), instance = sample.instance().to_string();
  const std::string who = instance.empty() ? service : service + " " + instance;
  rows_[who] = sample;
  silence_.heard(who, stateOf(sample) == bus::ServiceState::kFinished, now);
}

void Table::put(const v1::FormationState& sample) {
  states_[sample.robot().to_string()] = sample;
}

void Table::look(Clock::time_point now) {
  silent_.clear();
  for (const bus::Silence::Silent& one : silence_.silent(now)) silent_[one.who] = toString(one);
}

bool Table::anybodySilent() const {
  return !silent_.empty() ||
         std::any_of(rows_.begin(), rows_.end(), [](const auto& row) { return missesSomebody(row.second); });
}

std::string Table::text() const {
  std::size_t width = 7;
  for (const auto& [who, sample] : rows_) width = std::max(width, who.size());
  std::string out =
      fmt::format("{:<{}}  {:<9} {:>7} {:>8} {:>8} {:>9} {:>7} {:>7}  {}\n", "service", width, "state",
                  "rate Hz", "p50 ms", "p99 ms", "processed", "invalid", "dropped", "last error");
  for (const auto& [who, s] : rows_) {
    const auto silent = silent_.find(who);
    const bool speaks = silent == silent_.end();
    out += fmt::format("{:<{}}  {:<9} {:>7.1f} {:>8.2f} {:>8.2f} {:>9} {:>7} {:>7}  {}\n", who, width,
                       speaks ? bus::toString(stateOf(s)) : "silent", s.rate_hz(), s.latency_p50_ms(),
                       s.latency_p99_ms(), s.processed(), s.invalid(), s.dropped(),
                       lastColumn(speaks ? "" : silent->second, s.last_error().to_string()));
  }
  return out + leaderLine(states_);
}

}  // namespace omnifleet::status
