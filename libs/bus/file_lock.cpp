#include "bus/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

namespace omnifleet::bus {

LockedFile::LockedFile(const std::string& path, const std::string& text) : path_(path) {
  // The process locks the file before it names it, so no other process finds it unlocked.
  const std::string::size_type folder_end = path.rfind('/') + 1;
  std::string hidden = path.substr(0, folder_end) + ".omnifleet_XXXXXX";
  file_ = ::mkostemp(hidden.data(), O_CLOEXEC);
  const bool done = file_ >= 0 && ::flock(file_, LOCK_EX | LOCK_NB) == 0 && ::fchmod(file_, 0644) == 0 &&
                    ::write(file_, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                    ::rename(hidden.c_str(), path.c_str()) == 0;
  if (done) return;
  const int error = errno;
  if (file_ >= 0) {
    ::unlink(hidden.c_str());
    ::close(file_);
  }
  throw std::system_error(error, std::generic_category(), path);
}

LockedFile::~LockedFile() {
  if (file_ < 0) return;
  ::unlink(path_.c_str());
  ::close(file_);
}

LockedFile::LockedFile(LockedFile&& other) noexcept
    : path_(std::move(other.path_)), file_(std::exchange(other.file_, -1)) {}

LockedFile& LockedFile::operator=(LockedFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(file_, other.file_);
  return *this;
}

bool isUnlocked(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0) return false;
  const bool free = ::flock(file, LOCK_EX | LOCK_NB) == 0;
  ::close(file);
  return free;
}

}  // namespace omnifleet::bus
