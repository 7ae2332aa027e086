#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/merge_file.h"
#include "global_merger/merger.h"

namespace omnifleet::global_merger {

/// How the poses of each robot relate to the common map: what the localizer has published last (topic
/// alignment). Of a robot that it has published nothing about, only the poses are known: those without a
/// frame of their own claim to be in the map. Such a robot has neither score nor time.
/// @param robots of the fleet @param alignments the latest ones, by robot; others than `robots` are left out
dataset::MergeReport mergeReport(const std::vector<std::string>& robots,
                                 const std::map<std::string, Alignment>& alignments, const Merger& common);

}  // namespace omnifleet::global_merger
