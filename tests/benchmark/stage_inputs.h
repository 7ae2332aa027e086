#pragma once

#include <vector>

#include "observation/observation.h"
#include "tests/benchmark/scenes.h"

namespace omnifleet::bench {

/// Inputs of the stages after the local mapper: a recording, processed by local mapper and classifier of
/// every robot before any measurement.
struct StageInputs {
  StageInputs(const Recording& recording, int steps);
  std::vector<std::vector<LocalMap>> local_maps;  ///< [step][robot]
  std::vector<std::vector<Objects>> objects;      ///< [step][robot]
};

}  // namespace omnifleet::bench
