#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace omnifleet::bus {

/// The claim of a process to be a stage of a robot, e.g. the global_merger of r1. Its participant announces
/// it in the user data: "omnifleet.claim=<service>/<robot>;machine=<id>;pid=<n>;since_ns=<n>;host=<name>".
struct RobotClaim {
  std::string service, robot;
  std::string host;     ///< name of the computer, for people
  std::string machine;  ///< identifies the running kernel and the namespace in which `pid` is unique
  std::int64_t pid = 0;
  std::int64_t since_ns = 0;  ///< system time at which the process made the claim

  /// The claim of this process, made now.
  static RobotClaim ofThisProcess(const std::string& service, const std::string& robot);
  /// Empty for user data without a claim.
  static std::optional<RobotClaim> parse(const std::string& user_data);
  std::string userData() const;

  bool isSameStage(const RobotClaim& other) const { return service == other.service && robot == other.robot; }
  /// False for a process of this machine that has ended. Its participant may stay in the discovery data until
  /// the lease expires.
  bool isAlive(const RobotClaim& self) const;
  /// "process 4711 on host b": for messages.
  std::string describe() const;
};

/// Which of two claims to the same stage owns the robot: the older one, because its process holds the state
/// of the running robot, and readers already use it. A newcomer with a wrong name must not silence it. Both
/// processes compare the announced times, so clocks that differ cannot make both or neither the owner. `id`:
/// identifier of the participant (its GUID prefix); the smaller one decides between equal times.
bool outranks(const RobotClaim& a, const std::string& id_a, const RobotClaim& b, const std::string& id_b);

}  // namespace omnifleet::bus
