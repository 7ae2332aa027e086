#include <algorithm>
#include <stdexcept>
#include <thread>

#include "bus/service_runner.h"

namespace omnifleet::bus {

using Clock = std::chrono::steady_clock;

void InProcessFleet::add(std::string name, std::unique_ptr<Service> service) {
  members_.push_back({std::move(name), std::move(service)});
}

void InProcessFleet::start() {
  for (Member& member : members_) {
    for (const Expectation& expectation : member.service->expectations()) {
      if (!expectation.met()) throw std::runtime_error(member.name + " expects: " + expectation.what);
    }
  }
  for (Member& member : members_) {
    member.service->start();
    member.service->status().state(ServiceState::kRunning);
  }
}

bool InProcessFleet::spinRound() {
  bool moved = false;
  for (Member& member : members_) {
    if (member.drained) continue;
    while (member.service->spin()) moved = true;
    tellProblems(member);
    if (!member.service->finished()) continue;
    drain(member);
    moved = true;
  }
  return moved;
}

void InProcessFleet::drain(Member& member) {
  member.service->drain();
  tellProblems(member);
  member.service->status().state(ServiceState::kFinished);
  member.drained = true;
}

void InProcessFleet::tellProblems(Member& member) {
  if (!on_problem_) return;
  for (const std::string& problem : member.service->status().takeProblems()) on_problem_(member.name, problem);
}

bool InProcessFleet::done() const {
  for (const Member& member : members_) {
    if (!member.drained) return false;
  }
  return true;
}

bool InProcessFleet::run(const std::function<bool()>& each_round) {
  start();
  while (!done()) {
    const bool moved = spinRound();
    if (each_round && !each_round()) break;
    if (!moved && !done()) sleepOrFail();
  }
  for (Member& member : members_) {
    if (!member.drained) drain(member);
  }
  return std::all_of(members_.begin(), members_.end(),
                     [](const Member& member) { return member.service->succeeded(); });
}

/// Nothing moved: either somebody has a timer, or nothing will ever move again.
void InProcessFleet::sleepOrFail() {
  std::optional<Clock::time_point> next;
  for (const Member& member : members_) {
    if (member.drained) continue;
    const auto at = member.service->wakeAt();
    if (at && (!next || *at < *next)) next = at;
  }
  if (!next) failStuck();
  std::this_thread::sleep_until(*next);
}

void InProcessFleet::failStuck() {
  std::string text = "the fleet is stuck:";
  for (Member& member : members_) {
    if (member.drained) continue;
    const auto waiting = member.service->waitingFor(Clock::now());
    text += " " + member.name + " waits for " + (waiting ? waiting->name : "nothing known") + ";";
  }
  text.pop_back();
  throw std::runtime_error(text);
}

}  // namespace omnifleet::bus
