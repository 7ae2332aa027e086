#include "dataset/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace omnifleet::dataset {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& action, int error) {
  throw std::runtime_error(fmt::format("{}: {}: {}", path, action, std::strerror(error)));
}

/// A file descriptor that the destructor closes.
class Descriptor {
 public:
  Descriptor(const std::string& path, int flags, mode_t mode = 0)
      : fd_(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

void sync(const std::string& temporary, const std::string& path) {
  const Descriptor file(temporary, O_RDONLY);
  if (file.get() < 0) fail(path, "cannot be written", errno);
  if (::fsync(file.get()) != 0) fail(path, "cannot be written", errno);
}

/// Best effort, because some file systems cannot sync a directory.
void syncDirectory(const std::filesystem::path& directory) {
  const Descriptor folder(directory.empty() ? "." : directory.string(), O_RDONLY | O_DIRECTORY);
  if (folder.get() >= 0) ::fsync(folder.get());
}

void writeAll(const std::string& temporary, const std::string& path, std::string_view content) {
  const Descriptor file(temporary, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file.get() < 0) fail(path, "cannot be written", errno);
  while (!content.empty()) {
    const ssize_t written = ::write(file.get(), content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(path, "cannot be written", errno);
    content.remove_prefix(static_cast<std::size_t>(written));
  }
}

}  // namespace

AtomicFile::AtomicFile(std::string path) : path_(std::move(path)) {
  static std::atomic<unsigned> counter{0};
  const std::filesystem::path target(path_);
  if (target.has_parent_path()) makeDirectories(target.parent_path().string());
  const std::string name = fmt::format(".{}.{}-{}{}", target.stem().string(), ::getpid(),
                                       counter.fetch_add(1), target.extension().string());
  temporary_ = (target.parent_path() / name).string();
}

AtomicFile::~AtomicFile() {
  if (!committed_) ::unlink(temporary_.c_str());
}

void AtomicFile::commit() {
  sync(temporary_, path_);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail(path_, "cannot be replaced", errno);
  committed_ = true;
  syncDirectory(std::filesystem::path(path_).parent_path());
}

void writeAtomic(const std::string& path, std::string_view content) {
  AtomicFile file(path);
  writeAll(file.temporaryPath(), path, content);
  file.commit();
}

void makeDirectories(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw std::runtime_error(fmt::format("{}: cannot be created: {}", path, error.message()));
}

std::string readFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw std::runtime_error(path + ": is a directory, not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(fmt::format("{}: cannot be read: {}", path, std::strerror(errno)));
  std::ostringstream content;
  content << file.rdbuf();
  if (file.bad()) throw std::runtime_error(path + ": cannot be read");
  return content.str();
}

}  // namespace omnifleet::dataset
