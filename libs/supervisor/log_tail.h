#pragma once

#include <string>
#include <vector>

namespace omnifleet::supervisor {

/// The last `lines` lines of a file, from at most its last 64 KiB; empty when it cannot be read.
std::vector<std::string> lastLines(const std::string& path, int lines);

}  // namespace omnifleet::supervisor
