#pragma once

#include <string>
#include <string_view>

namespace omnifleet::dataset {

/// A file that appears completely or not at all. It is written beside its target, synced, then renamed over
/// it. Without commit(), the destructor removes the temporary file and the old file stays unchanged.
class AtomicFile {
 public:
  /// Creates the parent directories. Throws std::runtime_error when that fails.
  explicit AtomicFile(std::string path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Path to write to until commit(), for libraries that write by name (octomap, cv::imwrite). It has the
  /// extension of the target.
  const std::string& temporaryPath() const { return temporary_; }

  /// fsync, rename, fsync of the directory. Throws std::runtime_error that names the target and the reason
  /// (disk full, not writable). The old file is then unchanged.
  void commit();

 private:
  std::string path_, temporary_;
  bool committed_ = false;
};

/// Writes the whole content at once. Throws std::runtime_error like AtomicFile; a short write is a failure.
void writeAtomic(const std::string& path, std::string_view content);

/// mkdir -p. Throws std::runtime_error that names the directory and the reason.
void makeDirectories(const std::string& path);

/// The whole file as bytes. Throws std::runtime_error that names the file.
std::string readFile(const std::string& path);

}  // namespace omnifleet::dataset
