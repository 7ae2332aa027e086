#include "bus/shared_memory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>

#include "bus/frame_channel.h"
#include "bus/shared_memory_files.h"
#include "bus/topics.h"

namespace omnifleet::bus {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kMiB = 1u << 20;

struct FileSize {
  std::size_t bytes = 0, allocated = 0;
  std::size_t untouched() const { return bytes > allocated ? bytes - allocated : 0; }
};

FileSize sizeOf(const std::string& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return {};
  return {static_cast<std::size_t>(info.st_size), static_cast<std::size_t>(info.st_blocks) * 512};
}

/// Files that carry their own lock or are the lock.
bool hasLock(const std::string& directory, const std::string& name) {
  return fs::exists(fs::path(directory) / (name + "_el")) ||
         fs::exists(fs::path(directory) / (name + "_sl")) || isLockName(name) || startsWith(name, "sem.");
}

bool isOwnName(const std::string& name) {
  return startsWith(name, kOwnerFile) || startsWith(name, kFleetFile);
}

std::size_t inMiB(std::size_t bytes) {
  return (bytes + kMiB - 1) / kMiB;
}

std::string users(const SharedMemoryUse& use) {
  std::vector<std::string> all;
  for (const auto& [out, bytes] : use.fleets)
    all.push_back(fmt::format("{} MiB by the fleet with --out {}", inMiB(bytes), out));
  if (use.unknown_files > 0)
    all.push_back(
        fmt::format("{} MiB by {} of unknown owner, which this program does not remove "
                    "(fast_datasharing_*: delete {} when no other DDS program runs)",
                    inMiB(use.unknown_bytes), counted(use.unknown_files, "DDS file"),
                    use.unknown_files == 1 ? "it" : "them"));
  if (use.other_bytes > 0) all.push_back(fmt::format("{} MiB by other files", inMiB(use.other_bytes)));
  if (all.empty()) return {};
  return fmt::format("; held or reserved: {}", fmt::join(all, ", "));
}

[[noreturn]] void failShortage(std::size_t bytes, const SharedMemoryUse& use, std::size_t available,
                               const std::string& directory) {
  throw std::runtime_error(fmt::format(
      "{} has {} MiB free, but the frames of the cameras need {} MiB{}; enlarge it (mount -o "
      "remount,size=1G {}; Docker: --shm-size=1g), end what holds it, or use fewer or smaller cameras",
      directory, available / kMiB, bytes / kMiB + 1, users(use), directory));
}

/// Launchers count and reserve one after the other.
class CountingLock {
 public:
  explicit CountingLock(const std::string& directory)
      : folder_(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (folder_ >= 0) ::flock(folder_, LOCK_EX);
  }
  ~CountingLock() {
    if (folder_ >= 0) ::close(folder_);
  }
  CountingLock(const CountingLock&) = delete;
  CountingLock& operator=(const CountingLock&) = delete;

 private:
  int folder_;
};

/// Removes one file of a dead process.
void removeFile(const std::string& directory, const std::string& name, std::vector<std::string>& removed) {
  std::error_code refused;
  if (fs::remove(fs::path(directory) / name, refused) && isDdsName(name)) removed.push_back(name);
}

/// The data-sharing files of owners that have ended.
void removeOfOwners(const std::string& directory, const std::vector<std::string>& names,
                    std::vector<std::string>& removed) {
  for (const std::string& owner : names) {
    if (!startsWith(owner, kOwnerFile) || !isUnlocked(directory + "/" + owner)) continue;
    const std::string files = kDataSharingFile + owner.substr(kOwnerFile.size()) + ".";
    for (const std::string& name : names) {
      if (startsWith(name, files)) removeFile(directory, name, removed);
    }
    removeFile(directory, owner, removed);
  }
}

/// Segments and ports of the shared-memory transport of Fast DDS. Its own tool (`fastdds shm clean`) uses the
/// same proof.
void removeOfTransport(const std::string& directory, const std::vector<std::string>& names,
                       std::vector<std::string>& removed) {
  const std::set<std::string> present(names.begin(), names.end());
  std::set<std::string> dead;
  for (const std::string& lock : names) {
    if (!startsWith(lock, kTransportFile) || !isLockName(lock)) continue;
    const std::string stem = lock.substr(0, lock.size() - 3);
    const auto is_free = [&](const std::string& name) {
      return present.count(name) == 0 || isUnlocked(directory + "/" + name);
    };
    // A lock file exists for a moment before it is locked.
    if (isSettled(directory + "/" + lock) && is_free(stem + "_el") && is_free(stem + "_sl"))
      dead.insert(stem);
  }
  for (const std::string& stem : dead) {
    for (const std::string& name : {stem, "sem." + stem + "_mutex", stem + "_el", stem + "_sl"})
      removeFile(directory, name, removed);
  }
}

}  // namespace

std::size_t frameChannelBytes(std::size_t bytes_needed, RunMode mode) {
  constexpr std::size_t kOverhead = 4096;  // headers, index, page rounding
  const auto slots = static_cast<std::size_t>(frameQos(mode).depth + kExtraFrameSlots);
  return slots * (frameClassFor(bytes_needed).capacity + kOverhead);
}

std::size_t SharedMemoryUse::available() const {
  const std::size_t promised = untouched_bytes + pending_bytes;
  return free_bytes > promised ? free_bytes - promised : 0;
}

SharedMemoryUse sharedMemoryUse(const std::string& directory) {
  struct statvfs info {};
  if (::statvfs(directory.c_str(), &info) != 0)
    throw std::runtime_error(directory + ": shared memory not available");
  SharedMemoryUse use;
  use.free_bytes = static_cast<std::size_t>(info.f_bavail) * info.f_frsize;
  const std::vector<std::string> names = namesIn(directory);
  std::map<std::string, std::string> out_of;  // prefix of the files of an owner → its run directory
  std::map<std::string, std::size_t> in_files;
  for (const std::string& name : names) {
    const std::string path = directory + "/" + name;
    if (startsWith(name, kOwnerFile)) out_of[name.substr(kOwnerFile.size())] = firstLine(path);
    if (startsWith(name, kFleetFile) && !isUnlocked(path)) {
      const FleetRecord fleet = FleetRecord::read(path);
      if (!fleet.out.empty()) use.fleets[fleet.out] += fleet.bytes;
    }
  }
  for (const std::string& name : names) {
    const FileSize size = sizeOf(directory + "/" + name);
    if (!isDdsName(name)) {
      if (!isOwnName(name)) use.other_bytes += size.allocated;
      continue;
    }
    use.untouched_bytes += size.untouched();
    const auto owner = out_of.find(prefixIn(name));
    if (owner != out_of.end()) {
      in_files[owner->second] += size.bytes;
    } else if (!hasLock(directory, name)) {
      ++use.unknown_files;
      use.unknown_bytes += size.bytes;
    }
  }
  for (auto& [out, bytes] : use.fleets) {
    const std::size_t made = in_files[out];
    use.pending_bytes += bytes > made ? bytes - made : 0;
    bytes = std::max(bytes, made);
  }
  return use;
}

void requireSharedMemory(std::size_t bytes, const std::string& directory) {
  // The launcher has reserved the memory of this fleet and has counted what other fleets still need.
  const SharedMemoryUse use = sharedMemoryUse(directory);
  const std::size_t available =
      use.free_bytes > use.untouched_bytes ? use.free_bytes - use.untouched_bytes : 0;
  if (available < bytes) failShortage(bytes, use, available, directory);
}

SharedMemoryReservation::SharedMemoryReservation(std::size_t bytes, const std::string& out,
                                                 const std::string& directory) {
  const CountingLock lock(directory);
  const SharedMemoryUse use = sharedMemoryUse(directory);
  if (use.available() < bytes) failShortage(bytes, use, use.available(), directory);
  try {
    file_ = LockedFile(directory + "/" + kFleetFile + randomName(),
                       FleetRecord{bytes, fs::weakly_canonical(out).string()}.text());
  } catch (const std::system_error&) {
    // The folder cannot be written: DDS will say so.
  }
}

std::vector<std::string> removeStaleSharedMemory(const std::string& directory) {
  const std::vector<std::string> names = namesIn(directory);
  std::vector<std::string> removed;
  removeOfOwners(directory, names, removed);
  removeOfTransport(directory, names, removed);
  for (const std::string& name : names) {
    if (startsWith(name, kFleetFile) && isUnlocked(directory + "/" + name))
      removeFile(directory, name, removed);
  }
  std::sort(removed.begin(), removed.end());
  return removed;
}

}  // namespace omnifleet::bus
