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
    reportMessages(member);
    if (!member.service->finished()) continue;
    drain(member);
    moved = true;
  }
  return moved;
}

void InProcessFleet::drain(Member& member) {
  member.service->drain();
  reportMessages(member);
  member.service->status().state(ServiceState::kFinished);
  member.drained = true;
}

void InProcessFleet::reportMessages(Member& member) {
  if (!on_message_) return;
  for (const Message& message : member.service->status().takeMessages()) on_message_(member.name, message);
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

/// No service made progress: sleeps until the next timer, or fails when there is none.
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
  std::string text = "deadlock, no service can continue:";
  for (Member& member : members_) {
    if (member.drained) continue;
    const auto waiting = member.service->waitingFor(Clock::now());
    text += " " + member.name + " waits for " + (waiting ? waiting->name : "an unknown input") + ";";
  }
  text.pop_back();
  throw std::runtime_error(text);
}

}  // namespace omnifleet::bus
