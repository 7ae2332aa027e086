#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "bus/qos.h"

namespace omnifleet::bus {

/// Slots beside the history. With 1 (the default) frames were overwritten behind a slow reader.
inline constexpr int kExtraFrameSlots = 2;

/// Bytes of /dev/shm that one camera takes: (history + extra) slots of its frame class.
std::size_t frameChannelBytes(std::size_t bytes_needed, RunMode mode);

/// Throws std::runtime_error naming both figures when `directory` has less than `bytes` free; a page written
/// beyond the end would be a SIGBUS later.
void requireSharedMemory(std::size_t bytes, const std::string& directory = "/dev/shm");

/// Removes `fast_datasharing_*`, `fastrtps_*` (and their locks' sem.*) files that no living process has
/// mapped or opened: what killed processes left. Looks twice, since a file is made a moment before it is
/// mapped. Returns the removed names, sorted. Files that may not be removed are left.
std::vector<std::string> removeStaleSharedMemory(const std::string& directory = "/dev/shm");

}  // namespace omnifleet::bus
