#include "bus/folder_claim.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "options/options.h"

namespace omnifleet::bus {
namespace {

std::string claimText(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// The name of the file still leads to this open file.
bool isAt(int file, const std::string& path) {
  struct stat opened {
  }, named{};
  return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
         opened.st_dev == named.st_dev;
}

void writeClaim(int file, const std::string& text) {
  const std::string line = text + "\n";
  if (::ftruncate(file, 0) != 0 ||
      ::pwrite(file, line.data(), line.size(), 0) != static_cast<ssize_t>(line.size())) {
    // Only the message of another launcher lacks the name.
  }
}

[[noreturn]] void failInUse(const std::string& folder, const std::string& path) {
  const std::string owner = claimText(path);
  throw options::Error(fmt::format(
      "--out {}: in use by another running fleet{}; the files of both would mix. Wait for its end, or choose "
      "another folder: --out {}_2",
      folder, owner.empty() ? "" : " (" + owner + ")", folder));
}

std::string absolute(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::weakly_canonical(path, ignored).string();
}

}  // namespace

int FolderClaim::lock(const std::string& path, int kind) {
  for (;;) {
    const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (file < 0) throw options::Error(fmt::format("--out: {}: {}", path, std::strerror(errno)));
    if (::flock(file, kind | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) return file;  // no locks on this file system
      ::close(file);
      return -1;
    }
    if (isAt(file, path)) return file;
    ::close(file);  // its owner removed it after open()
  }
}

FolderClaim::FolderClaim(const std::string& folder, const std::string& fleet, const std::string& host)
    : path_(folder + "/.claim") {
  file_ = lock(path_, LOCK_EX);
  const std::string owner = absolute(fleet);
  if (file_ >= 0) writeClaim(file_, owner);
  if (host.empty() && file_ < 0) failInUse(folder, path_);
  if (host.empty()) return;
  if (file_ >= 0) {
    ::flock(file_, LOCK_SH | LOCK_NB);
  } else {
    // Another part that starts holds the lock alone for a moment. flock() has no timeout, and a fleet without
    // parts holds it for its whole run, so this polls.
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(300);
    while ((file_ = lock(path_, LOCK_SH)) < 0 && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (file_ < 0) failInUse(folder, path_);
  }
  try {
    claimPart(folder, owner, host);
  } catch (...) {
    ::close(file_);
    throw;
  }
}

void FolderClaim::claimPart(const std::string& folder, const std::string& fleet, const std::string& host) {
  if (claimText(path_) != fleet) failInUse(folder, path_);
  std::string name = host;
  std::replace(name.begin(), name.end(), '/', '_');
  part_path_ = folder + "/.claim_" + name;
  part_ = lock(part_path_, LOCK_EX);
  if (part_ < 0) failInUse(folder, part_path_);
  writeClaim(part_, fmt::format("{}, --host {}", fleet, host));
}

FolderClaim::~FolderClaim() {
  if (part_ >= 0) {
    ::unlink(part_path_.c_str());
    ::close(part_);
  }
  // Only the last part may remove the common file.
  if (::flock(file_, LOCK_EX | LOCK_NB) == 0) ::unlink(path_.c_str());
  ::close(file_);
}

}  // namespace omnifleet::bus
