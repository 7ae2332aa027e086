#pragma once

#include <string>
#include <vector>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

/// map.bt: the cells with the columns of the objects that have a height.
std::string octreeBytes(Merger& merger);

/// Writes the run directory's map files (DESIGN, "Run directory"), each whole or not at all (temporary file,
/// fsync, rename). One line per file that could not be written, which then keeps its old content; the others
/// are written.
std::vector<std::string> saveMap(Merger& merger, const std::string& folder);

}  // namespace omnifleet::global_merger
