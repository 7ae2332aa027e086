#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "bus/file_lock.h"
#include "bus/qos.h"

namespace omnifleet::bus {

/// Slots besides the history. With 1 (the default of Fast DDS) the writer overwrote frames of a slow reader.
inline constexpr int kExtraFrameSlots = 2;

/// Bytes of /dev/shm for one camera: (history + extra) slots of its frame class.
std::size_t frameChannelBytes(std::size_t bytes_needed, RunMode mode);

/// Who uses a folder of shared memory.
struct SharedMemoryUse {
  std::size_t free_bytes = 0;
  /// Fast DDS makes its files sparse: they have their full size at once and take pages as frames are written.
  /// These pages are free now and will be used.
  std::size_t untouched_bytes = 0;
  std::map<std::string, std::size_t> fleets;  ///< run directory → bytes that its frames have or will have
  std::size_t pending_bytes = 0;  ///< of these fleets' frames, not yet in files: their cameras still start
  std::size_t unknown_files = 0;  ///< DDS files of which no running or ended process is known
  std::size_t unknown_bytes = 0;  ///< their size
  std::size_t other_bytes = 0;    ///< allocated by files that are not of DDS

  /// Bytes that no process holds or has reserved.
  std::size_t available() const;
};
/// Throws std::runtime_error when `directory` is not available.
SharedMemoryUse sharedMemoryUse(const std::string& directory = "/dev/shm");

/// Throws std::runtime_error with the sizes and the users of the memory when `directory` has less than
/// `bytes` free that no DDS file will fill. Without this check a later write would raise SIGBUS.
void requireSharedMemory(std::size_t bytes, const std::string& directory = "/dev/shm");

/// Reserves the frames of a whole fleet before its cameras start: other launchers count these bytes from now
/// on. Ends with its process.
class SharedMemoryReservation {
 public:
  /// @param out run directory; owners with the same one fill this reservation
  /// Throws std::runtime_error as requireSharedMemory(), with the reservations of other fleets counted.
  SharedMemoryReservation(std::size_t bytes, const std::string& out,
                          const std::string& directory = "/dev/shm");

 private:
  LockedFile file_;
};

/// Marks the files `fast_datasharing_*` of this process as those of a running process. These files carry no
/// lock, and the process number in their name means nothing in another process namespace.
class SharedMemoryOwner {
 public:
  /// @param domain a DDS domain in which this process has a participant; all participants of a process share
  ///     the first 8 bytes of their GUID, which begin the names of their files
  /// @param out run directory; empty: of no fleet
  /// Construct after the participant. Does nothing when there is no participant or the folder cannot be
  /// written: the files then stay after a kill.
  SharedMemoryOwner(int domain, const std::string& out, const std::string& directory = "/dev/shm");

  /// Allocates the files of this process, so that a write can no longer raise SIGBUS. Throws
  /// std::runtime_error when the memory does not suffice.
  void allocate() const;

 private:
  std::string prefix_, directory_;
  LockedFile file_;
};

/// Removes the DDS files whose process has provably ended, because the lock of the process is free:
/// `fast_datasharing_*` of a SharedMemoryOwner; `fastrtps_X`, with the sem.* of its lock, when X_el or X_sl
/// exist and are unlocked. All other files stay, also those without any lock. Files that this user may not
/// remove stay. @return the removed names of DDS files, sorted
std::vector<std::string> removeStaleSharedMemory(const std::string& directory = "/dev/shm");

}  // namespace omnifleet::bus
