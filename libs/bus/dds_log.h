#pragma once

#include <functional>
#include <string>

namespace omnifleet::bus {

/// Sends the lines of the DDS library to `write` in place of the terminal, each different text once: "DDS
/// (category): text". `write` is called by a thread of the library, until the end of the process. An empty
/// function drops the lines.
void redirectDdsLog(std::function<void(const std::string&)> write);

}  // namespace omnifleet::bus
