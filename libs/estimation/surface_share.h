#pragma once

#include "scan/map_overlap.h"

namespace omnifleet::estimation {

/// Share of the length of the common surfaces that contradict, long walls included; 0 without any. Two single
/// scans have few surfaces, so every metre counts.
inline double contradictingShare(const scan::Overlap& overlap) {
  const double all_m = overlap.agree_m + overlap.contradict_m;
  return all_m > 0 ? overlap.contradict_m / all_m : 0.0;
}

}  // namespace omnifleet::estimation
