#pragma once

#include <string>
#include <vector>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

/// Writes the run directory's map files (README, "What you get"), each whole or not at all (temporary file,
/// fsync, rename). One line per file that could not be written, which then keeps its old content; the others
/// are written. The outlines are those last fitted.
std::vector<std::string> saveMap(const Merger& merger, const std::string& folder);

}  // namespace omnifleet::global_merger
