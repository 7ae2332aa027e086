#pragma once

#include <string>

namespace omnifleet::bus {

/// Marks a DDS domain as used for other launchers on this machine. Two fleets on one domain receive each
/// other's data, and both maps are wrong. The mark is a name in the abstract socket namespace of Linux. Each
/// network namespace has its own, as for DDS, and the kernel removes the name when the process ends.
class DomainClaim {
 public:
  /// @param host the started part of the fleet; parts for different hosts share a domain
  /// Throws options::Error when the domain is in use.
  DomainClaim(int domain, const std::string& host);
  ~DomainClaim();
  DomainClaim(const DomainClaim&) = delete;
  DomainClaim& operator=(const DomainClaim&) = delete;

 private:
  int socket_ = -1;
};

}  // namespace omnifleet::bus
