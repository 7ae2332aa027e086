#include "bus/shared_memory_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <random>

namespace omnifleet::bus {
namespace {

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

bool startsWith(const std::string& text, const std::string& prefix) {
  return text.rfind(prefix, 0) == 0;
}

bool isDdsName(const std::string& name) {
  return startsWith(name, kDataSharingFile) || startsWith(name, kTransportFile) ||
         startsWith(name, "sem." + kTransportFile);
}

bool isLockName(const std::string& name) {
  return endsWith(name, "_el") || endsWith(name, "_sl");
}

std::string prefixIn(const std::string& name) {
  constexpr std::size_t kCharacters = 8 * 3 - 1;
  if (!startsWith(name, kDataSharingFile) || name.size() < kDataSharingFile.size() + kCharacters) return {};
  return name.substr(kDataSharingFile.size(), kCharacters);
}

std::vector<std::string> namesIn(const std::string& directory) {
  std::vector<std::string> names;
  std::error_code problem;
  for (std::filesystem::directory_iterator it(directory, problem), end; !problem && it != end;
       it.increment(problem))
    names.push_back(it->path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::string firstLine(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

bool isSettled(const std::string& path) {
  constexpr std::time_t kSettled_s = 2;
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && std::time(nullptr) - info.st_mtime >= kSettled_s;
}

std::string randomName() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

std::string counted(std::size_t number, const std::string& noun) {
  return fmt::format("{} {}{}", number, noun, number == 1 ? "" : "s");
}

std::string FleetRecord::text() const {
  return fmt::format("{} {}\n", bytes, out);
}

FleetRecord FleetRecord::read(const std::string& path) {
  std::ifstream file(path);
  FleetRecord record;
  if (!(file >> record.bytes)) return {};
  file.ignore(1);
  std::getline(file, record.out);
  return record;
}

}  // namespace omnifleet::bus
