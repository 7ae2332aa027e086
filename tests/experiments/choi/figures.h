#pragma once

#include <string>
#include <vector>

#include "result.h"
#include "seed_run.h"

namespace omnifleet::choi {

/// Writes figs. 4–6, 8, 9, 11–18 and 20–22 of one seed as PNG files to `folder`. Throws std::runtime_error if
/// a file cannot be read or written.
void drawFigures(const SeedData& data, const std::string& folder);

void drawLocalFigures(const SeedData& data, const std::string& folder);   ///< 4–6, 8, 9, 14–17
void drawGlobalFigures(const SeedData& data, const std::string& folder);  ///< 11–13, 18
void drawPathFigures(const SeedData& data, const std::string& folder);    ///< 20–22

/// §IV.4: error, overlap and share of found obstacles over the number of robots, all seeds.
void drawTeams(const std::vector<SeedResult>& results, const std::string& path);

}  // namespace omnifleet::choi
