#pragma once

#include <map>
#include <string>
#include <vector>

#include "motion/formation_types.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Leader election as seen by one robot, from the states that the others publish (formation/state). A leader
/// that is silent for too long is replaced permanently by the next robot in order: a leader that returns
/// follows. Terms resolve conflicts, as in other election protocols: the higher term wins; for equal terms
/// the robot that is earlier in the order. Robots that receive the same states decide the same, without
/// voting.
class LeaderFailover {
 public:
  struct Options {
    double silent_s = 2.0;  ///< s, a robot that publishes no state for this long counts as silent

    static Options read(const options::Section& section);
  };

  /// `order`: all robots of the fleet, the configured leader first.
  LeaderFailover(const Options& options, const std::string& robot, std::vector<std::string> order);

  /// Receives a published state. Ignores the own state and states older than the latest known.
  void receive(const FormationState& state);
  /// Determines the leader at `now_ns`.
  void settle(TimeNs now_ns);

  const std::string& leader() const { return leader_; }
  std::uint32_t term() const { return term_; }
  /// Robots that are not silent: the leader first, the others in order.
  const std::vector<std::string>& ranks() const { return ranks_; }
  /// Latest states of the robots that are not silent.
  const std::map<std::string, FormationState>& received() const { return received_; }

 private:
  bool isAlive(const std::string& robot, TimeNs now_ns) const;

  Options options_;
  std::string robot_;
  std::vector<std::string> order_;
  std::map<std::string, FormationState> received_;
  std::string leader_;
  std::uint32_t term_ = 0;
  TimeNs since_ns_ = 0;  ///< own first frame: no robot counts as silent until silent_s have passed
  std::vector<std::string> ranks_;
};

}  // namespace omnifleet::motion
