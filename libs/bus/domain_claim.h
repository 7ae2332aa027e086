#pragma once

#include <string>

namespace omnifleet::bus {

/// Says to other launchers of this machine that a DDS domain is taken: two fleets on one domain hear each
/// other, and neither map is right. A name in Linux' abstract socket namespace, which a network namespace has
/// of its own as DDS has, and which goes with the process.
class DomainClaim {
 public:
  /// `host`: the part of the fleet that is started; parts for other hosts share a domain. Throws
  /// options::Error when it is taken.
  DomainClaim(int domain, const std::string& host);
  ~DomainClaim();
  DomainClaim(const DomainClaim&) = delete;
  DomainClaim& operator=(const DomainClaim&) = delete;

 private:
  int socket_ = -1;
};

}  // namespace omnifleet::bus
