#include "tests/multiprocess/two_machines.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "bus/interfaces.h"
#include "tests/multiprocess/process.h"

namespace omnifleet::test {
namespace {

constexpr std::array<const char*, 2> kMachines{"pcA", "pcB"};

std::string addressOf(const std::string& machine) {
  return machine == "pcA" ? "10.77.0.1" : "10.77.0.2";
}

/// A UDP socket of the network namespace in which it is opened.
class Socket {
 public:
  Socket() = default;
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }

  void open() { fd_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0); }
  template <class Value>
  void set(int level, int option, const Value& value) const {
    if (setsockopt(fd_, level, option, &value, sizeof value) != 0)
      throw std::runtime_error("cannot set a socket option");
  }
  int fd() const { return fd_; }

 private:
  int fd_ = -1;
};

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

TwoMachines::TwoMachines(Link link) : prefix_("of" + std::to_string(getpid())) {
  for (const char* machine : kMachines) mustRunIp("netns add " + nameOf(machine));
  link == Link::kDirect ? connectDirectly() : connectByRouter();
  awaitCarrier();
}

void TwoMachines::connectDirectly() const {
  mustRunIp("link add net0 netns " + nameOf("pcA") + " type veth peer name net0 netns " + nameOf("pcB"));
  for (const char* machine : kMachines) {
    const std::string in = "-n " + nameOf(machine);
    mustRunIp(in + " addr add " + addressOf(machine) + "/24 dev net0");
    mustRunIp(in + " link set lo up");
    mustRunIp(in + " link set net0 up");
  }
}

/// The router answers ARP requests for both machines, so they keep the addresses of one subnet.
void TwoMachines::connectByRouter() const {
  const std::string router = nameOf("router"), at_router = "-n " + router;
  mustRunIp("netns add " + router);
  for (const char* machine : kMachines) {
    const std::string in = "-n " + nameOf(machine);
    mustRunIp("link add net0 netns " + nameOf(machine) + " type veth peer name " + machine + " netns " +
              router);
    mustRunIp(at_router + " link set " + machine + " up");
    mustRunIp(at_router + " route add " + addressOf(machine) + "/32 dev " + machine);
    mustRunIp(in + " addr add " + addressOf(machine) + "/32 dev net0");
    mustRunIp(in + " link set lo up");
    mustRunIp(in + " link set net0 up");
    mustRunIp(in + " route add default dev net0");
  }
  mustRunIp(
      "netns exec " + router +
      " sh -c 'echo 1 > /proc/sys/net/ipv4/ip_forward; echo 1 > /proc/sys/net/ipv4/conf/all/proxy_arp'");
}

/// A carrier comes some milliseconds after the interfaces are up. Fast DDS ignores an interface without it.
void TwoMachines::awaitCarrier() const {
  for (const char* machine : kMachines) {
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
  for (const char* name : {"pcA", "pcB", "router"}) runIp("netns del " + nameOf(name));
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

bool TwoMachines::multicastPasses() const {
  constexpr std::uint16_t kPort = 7399;  // below the ports of all domains
  in_addr group{}, sender{}, receiver{};
  inet_pton(AF_INET, "239.255.0.1", &group);
  inet_pton(AF_INET, addressOf("pcA").c_str(), &sender);
  inet_pton(AF_INET, addressOf("pcB").c_str(), &receiver);
  sockaddr_in target{};
  target.sin_family = AF_INET;
  target.sin_port = htons(kPort);
  target.sin_addr = group;
  Socket in_b, in_a;
  {
    const InNamespace inside(nameOf("pcB"));
    in_b.open();
    const ip_mreq membership{group, receiver};
    const timeval patience{0, 500000};
    in_b.set(IPPROTO_IP, IP_ADD_MEMBERSHIP, membership);
    in_b.set(SOL_SOCKET, SO_RCVTIMEO, patience);
    if (bind(in_b.fd(), reinterpret_cast<const sockaddr*>(&target), sizeof target) != 0)
      throw std::runtime_error("cannot bind the multicast port");
  }
  const InNamespace inside(nameOf("pcA"));
  in_a.open();
  in_a.set(IPPROTO_IP, IP_MULTICAST_IF, sender);
  if (sendto(in_a.fd(), "x", 1, 0, reinterpret_cast<const sockaddr*>(&target), sizeof target) != 1)
    throw std::runtime_error("cannot send a multicast packet");
  char byte = 0;
  return recv(in_b.fd(), &byte, 1, 0) == 1;
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
