#include "status/table.h"

#include <fmt/format.h>

#include <algorithm>

namespace omnifleet::status {
namespace {

constexpr std::chrono::seconds kSilent{3};

}  // namespace

void Table::put(const v1::ServiceStatus& sample, Clock::time_point now) {
  rows_[{sample.service().to_string(), sample.instance().to_string()}] = {sample, now};
}

std::string Table::stateOf(const Row& row, Clock::time_point now) {
  const auto state = static_cast<bus::ServiceState>(row.sample.state());
  if (state != bus::ServiceState::kFinished && now - row.heard > kSilent) return "silent";
  return bus::toString(state);
}

std::string Table::text(Clock::time_point now) const {
  std::size_t width = 7;
  for (const auto& [name, row] : rows_) width = std::max(width, name.first.size() + 1 + name.second.size());
  std::string out =
      fmt::format("{:<{}}  {:<9} {:>7} {:>8} {:>8} {:>9} {:>7} {:>7}  {}\n", "service", width, "state",
                  "rate Hz", "p50 ms", "p99 ms", "processed", "invalid", "dropped", "last error");
  for (const auto& [name, row] : rows_) {
    const v1::ServiceStatus& s = row.sample;
    const std::string who = name.second.empty() ? name.first : name.first + " " + name.second;
    out += fmt::format("{:<{}}  {:<9} {:>7.1f} {:>8.2f} {:>8.2f} {:>9} {:>7} {:>7}  {}\n", who, width,
                       stateOf(row, now), s.rate_hz(), s.latency_p50_ms(), s.latency_p99_ms(), s.processed(),
                       s.invalid(), s.dropped(), s.last_error().to_string());
  }
  return out;
}

}  // namespace omnifleet::status
