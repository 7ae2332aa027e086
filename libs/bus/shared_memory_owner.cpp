#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "bus/shared_memory.h"
#include "bus/shared_memory_files.h"

namespace omnifleet::bus {
namespace {

/// "01.0f.78.fd.51.1a.90.de", as in names of files; empty without a participant.
std::string prefixOfThisProcess(int domain) {
  const auto participants =
      eprosima::fastdds::dds::DomainParticipantFactory::get_instance()->lookup_participants(
          static_cast<std::uint32_t>(domain));
  if (participants.empty()) return {};
  std::string text;
  for (int i = 0; i < 8; ++i)
    text += fmt::format("{}{:02x}", i == 0 ? "" : ".", participants.front()->guid().guidPrefix.value[i]);
  return text;
}

}  // namespace

SharedMemoryOwner::SharedMemoryOwner(int domain, const std::string& out, const std::string& directory)
    : prefix_(prefixOfThisProcess(domain)), directory_(directory) {
  if (prefix_.empty()) return;
  try {
    const std::string folder = out.empty() ? "" : std::filesystem::weakly_canonical(out).string();
    file_ = LockedFile(directory + "/" + kOwnerFile + prefix_, folder + "\n");
  } catch (const std::system_error&) {  // as documented
  }
}

void SharedMemoryOwner::allocate() const {
  for (const std::string& name : namesIn(directory_)) {
    if (prefix_.empty() || prefixIn(name) != prefix_) continue;
    const std::string path = directory_ + "/" + name;
    const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
    struct stat info {};
    if (file < 0) continue;
    const int error = ::fstat(file, &info) == 0 ? ::posix_fallocate(file, 0, info.st_size) : errno;
    ::close(file);
    if (error == ENOSPC)
      requireSharedMemory(
          static_cast<std::size_t>(info.st_size) - static_cast<std::size_t>(info.st_blocks) * 512 + 1,
          directory_);
    if (error == ENOSPC)
      throw std::runtime_error(fmt::format("{}: {}; enlarge {}", path, std::strerror(error), directory_));
  }
}

}  // namespace omnifleet::bus
