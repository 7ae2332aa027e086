#pragma once

#include <string>
#include <vector>

namespace omnifleet::bus {

// Partition rules of idl/README.md, the same on every bus. "" is the default partition.

/// {"", robot}, or {""} for a topic of no robot. Throws std::runtime_error for names with * ? [ ], which DDS
/// takes as wildcards.
std::vector<std::string> writerPartitions(const std::string& robot);
/// {robot}, or {""}, which matches all robots.
std::vector<std::string> readerPartitions(const std::string& robot);
/// {"host/<machine>"}: frames never leave the host.
std::vector<std::string> framePartitions(const std::string& machine);

}  // namespace omnifleet::bus
