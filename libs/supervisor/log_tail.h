#pragma once

#include <string>
#include <vector>

namespace omnifleet::supervisor {

/// The last `lines` lines of a file, read from its end (at most 64 KiB); none where it cannot be read.
std::vector<std::string> lastLines(const std::string& path, int lines);

}  // namespace omnifleet::supervisor
