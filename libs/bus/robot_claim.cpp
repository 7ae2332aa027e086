#include "bus/robot_claim.h"

#include <signal.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <map>
#include <sstream>
#include <tuple>

namespace omnifleet::bus {
namespace {

const std::string kClaimTag = "omnifleet.claim=";

std::string linkTarget(const char* path) {
  std::array<char, 256> target{};
  const auto length = ::readlink(path, target.data(), target.size() - 1);
  return length > 0 ? std::string(target.data(), static_cast<std::size_t>(length)) : std::string();
}

/// Boot id of the kernel and namespace of process numbers: containers share the first, not the second.
std::string thisMachine() {
  std::string boot_id;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> boot_id;
  return boot_id + "/" + linkTarget("/proc/self/ns/pid");
}

std::string thisHost() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
}

/// "a=1;b=2" as a map. The value of the last key may hold any characters.
std::map<std::string, std::string> fieldsOf(const std::string& text) {
  std::map<std::string, std::string> fields;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ';');) {
    const auto equals = part.find('=');
    if (equals != std::string::npos) fields[part.substr(0, equals)] = part.substr(equals + 1);
  }
  return fields;
}

/// False for text that is no number.
bool readNumber(const std::string& text, std::int64_t& number) {
  std::istringstream in(text);
  return static_cast<bool>(in >> number) && in.eof();
}

}  // namespace

RobotClaim RobotClaim::ofThisProcess(const std::string& service, const std::string& robot) {
  RobotClaim claim;
  claim.service = service;
  claim.robot = robot;
  claim.host = thisHost();
  claim.machine = thisMachine();
  claim.pid = ::getpid();
  claim.since_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count();
  return claim;
}

std::string RobotClaim::userData() const {
  return kClaimTag + service + "/" + robot + ";machine=" + machine + ";pid=" + std::to_string(pid) +
         ";since_ns=" + std::to_string(since_ns) + ";host=" + host;
}

std::optional<RobotClaim> RobotClaim::parse(const std::string& user_data) {
  if (user_data.rfind(kClaimTag, 0) != 0) return std::nullopt;
  auto fields = fieldsOf(user_data);
  RobotClaim claim;
  const std::string& stage = fields["omnifleet.claim"];
  const auto slash = stage.find('/');
  if (slash == std::string::npos) return std::nullopt;
  claim.service = stage.substr(0, slash);
  claim.robot = stage.substr(slash + 1);
  claim.machine = fields["machine"];
  claim.host = fields["host"];
  if (!readNumber(fields["pid"], claim.pid) || !readNumber(fields["since_ns"], claim.since_ns))
    return std::nullopt;
  return claim;
}

bool RobotClaim::isAlive(const RobotClaim& self) const {
  if (machine != self.machine) return true;
  return ::kill(static_cast<pid_t>(pid), 0) == 0 || errno != ESRCH;
}

std::string RobotClaim::describe() const {
  return "process " + std::to_string(pid) + " on host " + host;
}

bool outranks(const RobotClaim& a, const std::string& id_a, const RobotClaim& b, const std::string& id_b) {
  return std::tie(a.since_ns, id_a) < std::tie(b.since_ns, id_b);
}

}  // namespace omnifleet::bus
