#pragma once

#include <map>
#include <string>
#include <vector>

#include "motion/formation_types.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Who leads, as one robot knows it from what the others say of themselves (formation/state). A leader that
/// has been silent for too long is succeeded by the next robot in order, for good: who comes back follows.
/// Terms settle disputes, as in elections elsewhere: the higher one wins, of equal ones the robot that comes
/// first in order. Everybody who hears the same decides the same, without voting.
class Succession {
 public:
  struct Options {
    double silent_s = 2.0;  ///< s, without a state for so long a robot is lost

    static Options read(const options::Section& section);
  };

  /// `order`: all robots of the fleet, the configured leader first.
  Succession(const Options& options, const std::string& robot, std::vector<std::string> order);

  /// A state as it was published (not the own one); older ones than already known are left alone.
  void hear(const FormationState& state);
  /// Settles who leads at `now_ns`.
  void settle(TimeNs now_ns);

  const std::string& leader() const { return leader_; }
  std::uint32_t term() const { return term_; }
  /// Robots that count, leader first, the others in order.
  const std::vector<std::string>& ranks() const { return ranks_; }
  /// Latest states of the robots that are not lost.
  const std::map<std::string, FormationState>& heard() const { return heard_; }

 private:
  bool isAlive(const std::string& robot, TimeNs now_ns) const;

  Options options_;
  std::string robot_;
  std::vector<std::string> order_;
  std::map<std::string, FormationState> heard_;
  std::string leader_;
  std::uint32_t term_ = 0;
  TimeNs since_ns_ = 0;  ///< own first frame: nobody is lost before silent_s have passed
  std::vector<std::string> ranks_;
};

}  // namespace omnifleet::motion
