#pragma once

#include "observation/observation.h"
#include "tests/benchmark/naive_mapper.h"

namespace omnifleet::bench {

/// Agreement of the local mapper and the naive mapper on one frame, as counts.
struct Agreement {
  int objects = 0;          ///< local mapper: contact within 2 m, at least half of the hull on the naive plan
  int matched_objects = 0;  ///< of `objects`: naive regions fill at least half of the part on the plan
  int regions = 0;          ///< naive mapper: at least 240 cm² large, nearest point within 2 m
  int matched_regions = 0;  ///< of `regions`: at least half lies inside hulls of the local mapper
  int rays = 0;             ///< local mapper: rays that end at an object within 2 m
  int equal_rays = 0;       ///< of `rays`: the naive range differs by less than 0.1 m
};
Agreement compare(const LocalMap& local_map, const NaiveMapper& naive,
                  const std::vector<NaiveMapper::Region>& regions);

}  // namespace omnifleet::bench
