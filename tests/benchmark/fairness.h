#pragma once

#include "observation/observation.h"
#include "tests/benchmark/naive_mapper.h"

namespace omnifleet::bench {

/// How well two mappers agree on one frame.
struct Agreement {
  int objects = 0;  ///< of ours: within 2 m, and for the most part on the naive mapper's plan
  int found = 0;    ///< of these: its regions cover at least half of the object
  int regions = 0;  ///< of the naive mapper: large ones within the same distance
  int known = 0;    ///< of these: at least half lies on objects of ours
  int rays = 0;     ///< of our scan that end at something near
  int alike = 0;    ///< of these: the naive mapper's end within a decimetre
};
Agreement compare(const LocalMap& ours, const NaiveMapper& naive,
                  const std::vector<NaiveMapper::Region>& regions);

}  // namespace omnifleet::bench
