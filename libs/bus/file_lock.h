#pragma once

#include <string>

namespace omnifleet::bus {

/// A small text file that is locked (flock(2)) from its first moment to the end of its process. The kernel
/// frees the lock however the process ends, and all processes of the machine see the lock, also those of
/// other containers. A free lock therefore proves that the process has ended; a process number proves
/// nothing, because every process namespace has its own.
class LockedFile {
 public:
  LockedFile() = default;
  /// Creates `path` with `text`, readable for all users. Replaces a file of this name. Throws
  /// std::system_error.
  LockedFile(const std::string& path, const std::string& text);
  /// Removes the file.
  ~LockedFile();
  LockedFile(LockedFile&& other) noexcept;
  LockedFile& operator=(LockedFile&& other) noexcept;

 private:
  std::string path_;
  int file_ = -1;
};

/// True when the file can be opened and no process holds a lock on it.
bool isUnlocked(const std::string& path);

}  // namespace omnifleet::bus
