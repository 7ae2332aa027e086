#include "tests/multiprocess/two_machines.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "bus/interfaces.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::test {
namespace {

/// The program of iproute2; empty if it is not installed.
std::string ipProgram() {
  for (const char* path : {"/usr/sbin/ip", "/sbin/ip", "/usr/bin/ip"})
    if (access(path, X_OK) == 0) return path;
  return {};
}

bool runIp(const std::string& arguments) {
  return std::system((ipProgram() + " " + arguments + " 2>/dev/null").c_str()) == 0;
}

void mustRunIp(const std::string& arguments) {
  if (!runIp(arguments)) throw std::runtime_error("ip " + arguments + " failed");
}

/// This thread, and threads that it starts, are in a network namespace during the lifetime of the object.
class InNamespace {
 public:
  explicit InNamespace(const std::string& name)
      : before_(open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC)) {
    const int wanted = open(("/var/run/netns/" + name).c_str(), O_RDONLY | O_CLOEXEC);
    const bool entered = wanted >= 0 && setns(wanted, CLONE_NEWNET) == 0;
    if (wanted >= 0) close(wanted);
    if (!entered) throw std::runtime_error("cannot enter the network namespace " + name);
  }
  ~InNamespace() {
    if (setns(before_, CLONE_NEWNET) != 0) std::abort();
    close(before_);
  }

 private:
  int before_;
};

}  // namespace

std::string TwoMachines::obstacle() {
  if (ipProgram().empty()) return "the program ip (package iproute2) is not installed";
  const std::string name = "of" + std::to_string(getpid()) + "try";
  if (!runIp("netns add " + name)) return "no permission to make network namespaces";
  const bool can_link = runIp("link add oftry netns " + name + " type veth peer name oftry2 netns " + name);
  runIp("netns del " + name);
  return can_link ? "" : "no permission to make virtual interfaces";
}

TwoMachines::TwoMachines() : prefix_("of" + std::to_string(getpid())) {
  for (const char* machine : {"pcA", "pcB"}) mustRunIp("netns add " + nameOf(machine));
  mustRunIp("link add net0 netns " + nameOf("pcA") + " type veth peer name net0 netns " + nameOf("pcB"));
  for (const auto& [machine, address] : {std::pair{"pcA", "10.77.0.1/24"}, {"pcB", "10.77.0.2/24"}}) {
    const std::string in = "-n " + nameOf(machine);
    mustRunIp(in + " addr add " + address + " dev net0");
    mustRunIp(in + " link set lo up");
    mustRunIp(in + " link set net0 up");
  }
  awaitCarrier();
}

/// A carrier comes some milliseconds after the interfaces are up. Fast DDS ignores an interface without it.
void TwoMachines::awaitCarrier() const {
  for (const char* machine : {"pcA", "pcB"}) {
    const InNamespace inside(nameOf(machine));
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    const auto connected = [] {
      for (const bus::NetworkAddress& known : bus::networkAddresses())
        if (known.interface == "net0" && known.connected) return true;
      return false;
    };
    while (!connected())
      if (std::chrono::steady_clock::now() > end) throw std::runtime_error("net0 has no carrier");
  }
}

TwoMachines::~TwoMachines() {
  for (const char* machine : {"pcA", "pcB"}) runIp("netns del " + nameOf(machine));
}

std::string TwoMachines::nameOf(const std::string& machine) const {
  return prefix_ + machine;
}

std::vector<std::string> TwoMachines::on(const std::string& machine, std::vector<std::string> argv) const {
  const std::vector<std::string> enter{ipProgram(), "netns", "exec", nameOf(machine)};
  argv.insert(argv.begin(), enter.begin(), enter.end());
  return argv;
}

std::shared_ptr<void> TwoMachines::enter(const std::string& machine) const {
  return std::make_shared<InNamespace>(nameOf(machine));
}

void TwoMachines::cut() const {
  mustRunIp("-n " + nameOf("pcA") + " link set net0 down");
}

void TwoMachines::restore() const {
  mustRunIp("-n " + nameOf("pcA") + " link set net0 up");
}

void TwoMachines::blockMulticast() const {
  for (const char* machine : {"pcA", "pcB"})
    mustRunIp("-n " + nameOf(machine) + " route add blackhole 239.255.0.0/16");
}

std::uint64_t TwoMachines::receivedByA() const {
  const InNamespace inside(nameOf("pcA"));
  std::istringstream lines(fileText("/proc/thread-self/net/dev"));
  for (std::string line; std::getline(lines, line);) {
    const auto at = line.find("net0:");
    if (at != std::string::npos) return std::stoull(line.substr(at + 5));
  }
  throw std::runtime_error("no interface net0");
}

}  // namespace omnifleet::test
