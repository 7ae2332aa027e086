#include "launch/watch.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/rough_duration.h"

namespace omnifleet::launch {
namespace {

// Longer than the limits of the status table: a status that a busy machine delays is not reported.
constexpr bus::Silence::Limits kLimits{std::chrono::seconds(5), std::chrono::seconds(15)};
constexpr std::chrono::seconds kKept{15};  // beyond the longest delay of a restart

/// What to do about another machine of the fleet that was never heard.
std::string advice(const bus::Silence::Silent& silent) {
  if (silent.heard || silent.name.rfind("launch ", 0) != 0) return {};
  return "; if the fleet runs there, check that both machines use the same domain and interfaces of one "
         "network, and give `peers` if that network carries no multicast";
}

}  // namespace

std::string silentText(const std::vector<bus::Silence::Silent>& silent) {
  constexpr std::size_t kRoom = 450;  // characters; last_error holds 512
  std::string text;
  for (std::size_t i = 0; i < silent.size(); ++i) {
    const std::string one =
        fmt::format("{} {} {}", silent[i].name, silent[i].heard ? "silent" : "not heard",
                    services::roughDuration(static_cast<double>(silent[i].lasts.count())));
    if (text.size() + 2 + one.size() > kRoom) return text + fmt::format(", {} more", silent.size() - i);
    text += (text.empty() ? "" : ", ") + one;
  }
  return text;
}

Watch::Watch(bus::Bus& bus, const bus::Topics& topics, const std::vector<std::string>& services,
             const std::string& host, Clock::time_point now)
    : bus_(bus),
      services_(services.begin(), services.end()),
      silence_(kLimits),
      publisher_(bus, topics, "launch", host) {
  for (const std::string& service : services_) silence_.expect(service, now);
  board_.state(bus::ServiceState::kRunning);
  publisher_.update(board_, now, true);
}

Watch::~Watch() {
  board_.clearError();
  board_.state(bus::ServiceState::kFinished);
  publisher_.update(board_, Clock::now(), true);
  bus_.flush(std::chrono::milliseconds(200));
}

void Watch::heard(const std::string& name, bool finished, Clock::time_point now) {
  if (services_.count(name) > 0) silence_.heard(name, finished, now);
}

void Watch::failing(const std::string& what, Clock::time_point now) {
  failing_[what.substr(0, what.find(' '))] = {what, now};
}

std::vector<std::string> Watch::check(Clock::time_point now) {
  const std::vector<bus::Silence::Silent> silent = silence_.silent(now);
  std::vector<std::string> changes;
  std::set<std::string> names;
  for (const bus::Silence::Silent& one : silent) {
    names.insert(one.name);
    if (silent_.count(one.name) == 0) changes.push_back(one.name + ": " + toString(one) + advice(one));
  }
  for (const std::string& before : silent_) {
    if (names.count(before) == 0) changes.push_back(before + ": publishes its status again");
  }
  silent_ = std::move(names);
  for (auto it = failing_.begin(); it != failing_.end();)
    it = now - it->second.at > kKept ? failing_.erase(it) : std::next(it);
  if (!failing_.empty()) {
    std::string text;
    for (const auto& [process, one] : failing_) text += (text.empty() ? "" : "; ") + one.what;
    board_.report({ErrorCode::kServiceFailed, text}, true);
  } else if (silent.empty()) {
    board_.clearError();
  } else {
    board_.report({ErrorCode::kServiceSilent, silentText(silent)}, true);
  }
  publisher_.update(board_, now);
  return changes;
}

}  // namespace omnifleet::launch
