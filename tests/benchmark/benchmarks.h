#pragma once

#include "tests/benchmark/measure.h"
#include "tests/benchmark/scenes.h"

namespace omnifleet::bench {

// Each function registers the benchmarks of one source file. `scenes` and `plan` must exist until all have
// run.
void registerLocalMapper(Scenes& scenes, const Plan& plan);
void registerMap(const Plan& plan);
void registerStages(Scenes& scenes, const Plan& plan);
void registerImages(Scenes& scenes, const Plan& plan);
void registerDistanceVector(const Plan& plan);
void registerFloorMotion(const Plan& plan);
void registerAppearance(const Plan& plan);
void registerTransport(const Plan& plan);
void registerFleet(Scenes& scenes, const Plan& plan);

}  // namespace omnifleet::bench
