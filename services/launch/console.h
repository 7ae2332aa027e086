#pragma once

#include <string>

namespace omnifleet::launch {

/// Writes to stderr what can be written without waiting, and drops the rest: a reader that is gone or does
/// not read (a closed terminal, `| head -1`, a stopped pager) must not end or delay a run. SIGPIPE must be
/// ignored.
void print(const std::string& text);

}  // namespace omnifleet::launch
