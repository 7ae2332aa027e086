#include "status/table.h"

#include <fmt/format.h>

#include <algorithm>

namespace omnifleet::status {
namespace {

bus::ServiceState stateOf(const v1::ServiceStatus& sample) {
  return static_cast<bus::ServiceState>(sample.state());
}

/// The status of a launcher is degraded while a service is silent, and in no other case.
bool reportsSilence(const v1::ServiceStatus& sample) {
  return sample.service() == "launch" && stateOf(sample) == bus::ServiceState::kDegraded;
}

std::string lastColumn(const std::string& silent, const std::string& error) {
  return silent.empty() || error.empty() ? silent + error : silent + "; before: " + error;
}

std::string leaderOf(const v1::FormationState& state) {
  return fmt::format("{} (term {})", state.leader().to_string(), state.term());
}

/// "leader: r2 (term 1)": the leader of the latest term. Robots that follow another leader are listed.
std::string leaderLine(const std::map<std::string, v1::FormationState>& states) {
  if (states.empty()) return {};
  const auto latest = std::max_element(states.begin(), states.end(), [](const auto& a, const auto& b) {
    return a.second.term() < b.second.term();
  });
  const std::string leader = leaderOf(latest->second);
  std::string line = "leader: " + leader;
  for (const auto& [robot, state] : states) {
    if (leaderOf(state) != leader) line += fmt::format("; {} last followed {}", robot, leaderOf(state));
  }
  return line + "\n";
}

/// "[code] text"; empty without an error.
std::string errorOf(const v1::ServiceStatus& status) {
  const std::string code = status.error_code().to_string(), text = status.last_error().to_string();
  return code.empty() ? text : "[" + code + "] " + text;
}

/// Whether one such service runs for each robot.
bool isOfRobot(const v1::ServiceStatus& status) {
  const std::string service = status.service().to_string();
  return service == "local_mapper" || service == "classifier" || service == "formation" ||
         service == "global_merger";
}
/// The instance without the process that bus::StatusPublisher adds when another one owns the robot.
std::string robotOf(const v1::ServiceStatus& status) {
  const std::string instance = status.instance().to_string();
  return instance.substr(0, instance.find('@'));
}

/// "to other hosts, kB/s: r1 31.2, r2 28.4, others 3.1". Empty while no service writes to such topics.
std::string trafficLine(const std::map<std::string, v1::ServiceStatus>& rows) {
  constexpr double kBytesPerKb = 1000.0;
  std::map<std::string, double> of_robots;
  double sum = 0.0, others = 0.0;
  for (const auto& [name, status] : rows) {
    if (stateOf(status) == bus::ServiceState::kFinished) continue;
    sum += status.bytes_out_per_s();
    (isOfRobot(status) ? of_robots[robotOf(status)] : others) += status.bytes_out_per_s();
  }
  if (sum <= 0) return {};
  std::string line = "to other hosts, kB/s:";
  for (const auto& [robot, bytes_per_s] : of_robots)
    line += fmt::format(" {} {:.1f},", robot, bytes_per_s / kBytesPerKb);
  return line + fmt::format(" others {:.1f}\n", others / kBytesPerKb);
}

}  // namespace

void Table::put(const v1::ServiceStatus& sample, Clock::time_point now) {
  const std::string service = sample.service().to_string(), instance = sample.instance().to_string();
  const std::string name = instance.empty() ? service : service + " " + instance;
  rows_[name] = sample;
  silence_.heard(name, stateOf(sample) == bus::ServiceState::kFinished, now);
}

void Table::put(const v1::FormationState& sample) {
  states_[sample.robot().to_string()] = sample;
}

void Table::update(Clock::time_point now) {
  silent_.clear();
  for (const bus::Silence::Silent& one : silence_.silent(now)) silent_[one.name] = toString(one);
}

bool Table::anySilent() const {
  return !silent_.empty() ||
         std::any_of(rows_.begin(), rows_.end(), [](const auto& row) { return reportsSilence(row.second); });
}

std::string Table::text() const {
  std::size_t width = 7;
  for (const auto& [name, sample] : rows_) width = std::max(width, name.size());
  std::string out = fmt::format("{:<{}}  {:<9} {:>7} {:>8} {:>8} {:>9} {:>7} {:>7} {:>9} {:>8}  {}\n",
                                "service", width, "state", "rate Hz", "p50 ms", "p99 ms", "processed",
                                "invalid", "dropped", "kB/s out", "kB/s in", "last error");
  for (const auto& [name, s] : rows_) {
    const auto silent = silent_.find(name);
    const bool is_heard = silent == silent_.end();
    out += fmt::format("{:<{}}  {:<9} {:>7.1f} {:>8.2f} {:>8.2f} {:>9} {:>7} {:>7} {:>9.1f} {:>8.1f}  {}\n",
                       name, width, is_heard ? bus::toString(stateOf(s)) : "silent", s.rate_hz(),
                       s.latency_p50_ms(), s.latency_p99_ms(), s.processed(), s.invalid(), s.dropped(),
                       1e-3 * s.bytes_out_per_s(), 1e-3 * s.bytes_in_per_s(),
                       lastColumn(is_heard ? "" : silent->second, errorOf(s)));
  }
  return out + trafficLine(rows_) + leaderLine(states_);
}

}  // namespace omnifleet::status
