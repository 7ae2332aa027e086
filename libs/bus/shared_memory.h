#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace omnifleet::bus {

/// Bytes of /dev/shm that one frame writer with this history takes: (history + extra) slots of the frame
/// class.
std::size_t frameChannelBytes(std::size_t bytes_needed);

/// Throws std::runtime_error naming both figures when `directory` has less than `bytes` free; a page written
/// beyond the end would be a SIGBUS later.
void requireSharedMemory(std::size_t bytes, const std::string& directory = "/dev/shm");

/// Removes `fast_datasharing_*`, `fastrtps_*` (and their locks' sem.*) files that no living process has
/// mapped or opened: what killed processes left. Returns the removed names, sorted. Files of others that may
/// not be removed are left; so are files of processes whose maps may not be read.
std::vector<std::string> removeStaleSharedMemory(const std::string& directory = "/dev/shm");

}  // namespace omnifleet::bus
