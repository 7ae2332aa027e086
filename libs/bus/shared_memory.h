#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "bus/qos.h"

namespace omnifleet::bus {

/// Slots besides the history. With 1 (the default of Fast DDS) the writer overwrote frames of a slow reader.
inline constexpr int kExtraFrameSlots = 2;

/// Bytes of /dev/shm for one camera: (history + extra) slots of its frame class.
std::size_t frameChannelBytes(std::size_t bytes_needed, RunMode mode);

/// Throws std::runtime_error with both sizes when `directory` has less than `bytes` free. Without this check
/// a later write would raise SIGBUS.
void requireSharedMemory(std::size_t bytes, const std::string& directory = "/dev/shm");

/// Removes `fast_datasharing_*` and `fastrtps_*` files (and the sem.* of their locks) that no process has
/// mapped or opened: remains of killed processes. Checks twice, because a file exists a moment before it is
/// mapped. Files that this user may not remove stay. @return the removed names, sorted
std::vector<std::string> removeStaleSharedMemory(const std::string& directory = "/dev/shm");

}  // namespace omnifleet::bus
