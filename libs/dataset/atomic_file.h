#pragma once

#include <string>
#include <string_view>

namespace omnifleet::dataset {

/// A file that appears whole or not at all: written beside its target, synced, then renamed over it. Without
/// commit() the destructor removes the temporary file and the old file stays as it was.
class AtomicFile {
 public:
  /// Creates the parent directories. Throws std::runtime_error when that fails.
  explicit AtomicFile(std::string path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Where to write until commit(); for libraries that write by name (octomap, cv::imwrite). It keeps the
  /// target's extension.
  const std::string& temporaryPath() const { return temporary_; }

  /// fsync, rename, fsync of the directory. Throws std::runtime_error naming the target and the reason (disk
  /// full, not writable); the old file is then untouched.
  void commit();

 private:
  std::string path_, temporary_;
  bool committed_ = false;
};

/// The whole content at once. Throws std::runtime_error as AtomicFile; a short write counts as failure.
void writeAtomic(const std::string& path, std::string_view content);

/// mkdir -p. Throws std::runtime_error naming the directory and the reason.
void makeDirectories(const std::string& path);

/// Whole file as bytes. Throws std::runtime_error naming the file.
std::string readFile(const std::string& path);

}  // namespace omnifleet::dataset
