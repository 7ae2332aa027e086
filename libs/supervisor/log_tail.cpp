#include "supervisor/log_tail.h"

#include <algorithm>
#include <fstream>

namespace omnifleet::supervisor {

std::vector<std::string> lastLines(const std::string& path, int lines) {
  constexpr std::streamoff kMost = 64 * 1024;
  std::vector<std::string> result;
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (path.empty() || !file || lines <= 0) return result;
  const std::streamoff size = file.tellg();
  file.seekg(std::max<std::streamoff>(0, size - kMost));
  for (std::string line; std::getline(file, line);) result.push_back(line);
  const auto count = static_cast<std::size_t>(lines);
  if (result.size() > count) result.erase(result.begin(), result.end() - static_cast<std::ptrdiff_t>(count));
  return result;
}

}  // namespace omnifleet::supervisor
