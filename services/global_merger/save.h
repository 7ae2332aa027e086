#pragma once

#include <string>
#include <vector>

#include "global_merger/merger.h"

namespace omnifleet::global_merger {

/// Writes the map files into a folder: the run directory for the common map, each completely or not at all
/// (temporary file, fsync, rename). Returns one line per file that could not be written, which keeps its old
/// content; the others are written. Uses the outlines as last fitted. A robot whose poses are all in other
/// frames has no files here; those of an earlier save, when it had no pose yet, are removed.
std::vector<std::string> saveMap(const Merger& merger, const std::string& folder);

/// Removes the files that saveMap() writes for the map of one robot alone, and folders that are empty then.
/// Returns one line per file that could not be removed.
std::vector<std::string> removeMap(const std::string& robot, const std::string& folder);

}  // namespace omnifleet::global_merger
