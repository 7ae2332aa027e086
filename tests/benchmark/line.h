#pragma once

#include <vector>

#include "observation/observation.h"
#include "tests/benchmark/scenes.h"

namespace omnifleet::bench {

/// What the stages behind the local mapper get to see: a recording through mapper and classifier of every
/// robot, before anything is timed.
struct Line {
  Line(const Recording& recording, int steps);
  std::vector<std::vector<LocalMap>> local_maps;  ///< [step][robot]
  std::vector<std::vector<Objects>> objects;      ///< [step][robot]
};

}  // namespace omnifleet::bench
