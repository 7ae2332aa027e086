#include "bus/partition.h"

#include <stdexcept>

namespace omnifleet::bus {
namespace {

const std::string& checked(const std::string& name) {
  if (name.find_first_of("*?[]") == std::string::npos) return name;
  throw std::runtime_error(
      "'" + name +
      "' is not a valid name of a robot or machine: remove * ? [ ], which DDS takes as wildcards");
}

}  // namespace

std::vector<std::string> writerPartitions(const std::string& robot) {
  if (robot.empty()) return {""};
  return {"", checked(robot)};
}

std::vector<std::string> readerPartitions(const std::string& robot) {
  return {checked(robot)};
}

std::vector<std::string> framePartitions(const std::string& machine) {
  return {"host/" + checked(machine)};
}

}  // namespace omnifleet::bus
