#include "launch/watch.h"

#include <fmt/format.h>

#include <algorithm>

namespace omnifleet::launch {
namespace {

// Longer than people see a service as silent who watch it: a word that a busy machine delays is no news.
constexpr bus::Silence::Limits kLimits{std::chrono::seconds(5), std::chrono::seconds(15)};

}  // namespace

std::string silentText(const std::vector<bus::Silence::Silent>& silent) {
  constexpr std::size_t kRoom = 220;  // of the status' 256 characters
  std::string text;
  for (std::size_t i = 0; i < silent.size(); ++i) {
    const std::string one = silent[i].who + " " + toString(silent[i]);
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

void Watch::heard(const std::string& who, bool finished, Clock::time_point now) {
  if (services_.count(who) > 0) silence_.heard(who, finished, now);
}

std::vector<std::string> Watch::look(Clock::time_point now) {
  const std::vector<bus::Silence::Silent> silent = silence_.silent(now);
  std::vector<std::string> news;
  std::set<std::string> names;
  for (const bus::Silence::Silent& one : silent) {
    names.insert(one.who);
    if (silent_.count(one.who) == 0) news.push_back(one.who + ": " + toString(one));
  }
  for (const std::string& before : silent_) {
    if (names.count(before) == 0) news.push_back(before + ": speaks again");
  }
  silent_ = std::move(names);
  if (silent.empty()) {
    board_.clearError();
  } else {
    board_.error(silentText(silent), true);
  }
  publisher_.update(board_, now);
  return news;
}

}  // namespace omnifleet::launch
