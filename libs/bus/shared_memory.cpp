#include "bus/shared_memory.h"

#include <sys/statvfs.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <thread>

#include "bus/frame_channel.h"
#include "bus/topics.h"

namespace omnifleet::bus {
namespace fs = std::filesystem;
namespace {

bool startsWith(const std::string& text, const std::string& prefix) {
  return text.rfind(prefix, 0) == 0;
}

bool isDdsFile(const std::string& name) {
  return startsWith(name, "fast_datasharing_") || startsWith(name, "fastrtps_") ||
         startsWith(name, "sem.fastrtps_");
}

bool isProcess(const fs::path& entry) {
  const std::string name = entry.filename().string();
  return !name.empty() &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c); });
}

/// Files of `directory` that one process has mapped.
void addMapped(const fs::path& process, const std::string& directory, std::set<std::string>& used) {
  std::ifstream maps(process / "maps");
  for (std::string line; std::getline(maps, line);) {
    const auto at = line.find(directory + "/");
    if (at == std::string::npos) continue;
    used.insert(line.substr(at + directory.size() + 1));
  }
}

/// Files of `directory` that one process holds open (a lock is a descriptor, not a mapping).
void addOpened(const fs::path& process, const std::string& directory, std::set<std::string>& used) {
  std::error_code problem;
  for (fs::directory_iterator it(process / "fd", problem), end; !problem && it != end;
       it.increment(problem)) {
    std::error_code unreadable;
    const std::string target = fs::read_symlink(it->path(), unreadable).string();
    if (!unreadable && startsWith(target, directory + "/")) used.insert(target.substr(directory.size() + 1));
  }
}

std::set<std::string> filesInUse(const std::string& directory) {
  std::set<std::string> used;
  std::error_code problem;
  for (fs::directory_iterator it("/proc", problem), end; !problem && it != end; it.increment(problem)) {
    if (!isProcess(it->path())) continue;
    addMapped(it->path(), directory, used);
    addOpened(it->path(), directory, used);
  }
  return used;
}

/// DDS files that no process uses now.
std::set<std::string> unusedFiles(const std::string& directory) {
  std::set<std::string> names;
  std::error_code problem;
  for (fs::directory_iterator it(directory, problem), end; !problem && it != end; it.increment(problem)) {
    const std::string name = it->path().filename().string();
    if (isDdsFile(name)) names.insert(name);
  }
  if (names.empty()) return names;
  for (const std::string& used : filesInUse(directory)) names.erase(used);
  return names;
}

}  // namespace

std::size_t frameChannelBytes(std::size_t bytes_needed, RunMode mode) {
  constexpr std::size_t kOverhead = 4096;  // headers, index, page rounding
  const auto slots = static_cast<std::size_t>(frameQos(mode).depth + kExtraFrameSlots);
  return slots * (frameClassFor(bytes_needed).capacity + kOverhead);
}

void requireSharedMemory(std::size_t bytes, const std::string& directory) {
  struct statvfs info {};
  if (::statvfs(directory.c_str(), &info) != 0)
    throw std::runtime_error(directory + ": shared memory not available");
  const auto free_bytes = static_cast<std::size_t>(info.f_bavail) * info.f_frsize;
  if (free_bytes >= bytes) return;
  throw std::runtime_error(directory + " has " + std::to_string(free_bytes >> 20) +
                           " MiB free, but the frames of the cameras need " +
                           std::to_string((bytes >> 20) + 1) +
                           " MiB; enlarge it, or use fewer or smaller cameras");
}

std::vector<std::string> removeStaleSharedMemory(const std::string& directory) {
  constexpr std::chrono::milliseconds kFromMakingToMapping{
      250};  // takes microseconds on a machine that is not overloaded
  std::vector<std::string> removed;
  const std::set<std::string> before = unusedFiles(directory);
  if (before.empty()) return removed;
  std::this_thread::sleep_for(kFromMakingToMapping);
  for (const std::string& name : unusedFiles(directory)) {
    std::error_code refused;
    if (before.count(name) > 0 && fs::remove(fs::path(directory) / name, refused)) removed.push_back(name);
  }
  return removed;
}

}  // namespace omnifleet::bus
