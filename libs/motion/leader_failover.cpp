#include "motion/leader_failover.h"

#include <algorithm>

namespace omnifleet::motion {

LeaderFailover::Options LeaderFailover::Options::read(const options::Section& section) {
  Options options;
  section.read("silent_s", options.silent_s, {0.1, 600.0});
  section.finish();
  return options;
}

LeaderFailover::LeaderFailover(const Options& options, const std::string& robot,
                               std::vector<std::string> order)
    : options_(options), robot_(robot), order_(std::move(order)), leader_(order_.front()), ranks_(order_) {}

void LeaderFailover::receive(const FormationState& state) {
  if (state.robot == robot_) return;
  if (std::find(order_.begin(), order_.end(), state.robot) == order_.end()) return;
  FormationState& known = received_[state.robot];
  if (known.acquired_ns <= state.acquired_ns) known = state;
}

bool LeaderFailover::isAlive(const std::string& robot, TimeNs now_ns) const {
  if (robot == robot_) return true;
  const auto silent = static_cast<TimeNs>(options_.silent_s * 1e9);
  const auto received = received_.find(robot);
  const TimeNs latest_ns =
      received == received_.end() ? since_ns_ : std::max(since_ns_, received->second.acquired_ns);
  return now_ns - latest_ns <= silent;
}

void LeaderFailover::settle(TimeNs now_ns) {
  if (since_ns_ == 0) since_ns_ = now_ns;
  // A robot claims to lead with a higher term, or with this term and an earlier place in the order.
  for (const std::string& robot : order_) {
    const auto received = received_.find(robot);
    if (received == received_.end() || received->second.leader != robot || !isAlive(robot, now_ns)) continue;
    if (received->second.term > term_ ||
        (received->second.term == term_ && leader_ != robot &&
         std::find(order_.begin(), order_.end(), robot) < std::find(order_.begin(), order_.end(), leader_))) {
      leader_ = robot;
      term_ = received->second.term;
    }
  }
  if (!isAlive(leader_, now_ns)) {
    leader_ = *std::find_if(order_.begin(), order_.end(),
                            [&](const std::string& robot) { return isAlive(robot, now_ns); });
    ++term_;
  }
  ranks_.assign(1, leader_);
  for (const std::string& robot : order_) {
    if (robot != leader_ && isAlive(robot, now_ns)) ranks_.push_back(robot);
  }
}

}  // namespace omnifleet::motion
