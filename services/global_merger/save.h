#pragma once

#include <string>
#include <vector>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

/// Writes the map files of the run directory, each completely or not at all (temporary file, fsync, rename).
/// Returns one line per file that could not be written, which keeps its old content; the others are written.
/// Uses the outlines as last fitted.
std::vector<std::string> saveMap(const Merger& merger, const std::string& folder);

}  // namespace omnifleet::global_merger
