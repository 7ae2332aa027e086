#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace omnifleet::test {

/// Two network namespaces, pcA (10.77.0.1) and pcB (10.77.0.2), that virtual interfaces connect. The
/// destructor removes them.
class TwoMachines {
 public:
  enum class Link {
    kDirect,  ///< as on one switch: multicast passes
    kRouted   ///< a router between them: multicast does not pass
  };

  /// Why this machine cannot make namespaces; empty: it can.
  static std::string obstacle();

  explicit TwoMachines(Link link);
  ~TwoMachines();
  TwoMachines(const TwoMachines&) = delete;
  TwoMachines& operator=(const TwoMachines&) = delete;

  /// The command, run on a machine ("pcA", "pcB").
  std::vector<std::string> on(const std::string& machine, std::vector<std::string> argv) const;
  /// This thread, and threads that it starts, are on the machine until the result is destroyed. A participant
  /// must be made and used there: Fast DDS looks at the interfaces whenever it makes an endpoint.
  std::shared_ptr<void> enter(const std::string& machine) const;
  /// Cuts the link between them, and restores it.
  void cut() const;
  void restore() const;
  /// Whether a multicast packet from pcA to the group of DDS reaches pcB.
  bool multicastPasses() const;
  /// Bytes that pcA has received from pcB since the start.
  std::uint64_t receivedByA() const;

 private:
  void connectDirectly() const;
  void connectByRouter() const;
  void awaitCarrier() const;
  std::string nameOf(const std::string& machine) const;

  std::string prefix_;
};

}  // namespace omnifleet::test
