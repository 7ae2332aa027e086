// The whole fleet in one process on pictures of a renderer that nothing was developed on: other light,
// another tone curve, floors of lino, parquet and carpet, tape on them.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "dataset/map_files.h"
#include "evaluation/map_metrics.h"
#include "fleet_in_process/in_process.h"
#include "tests/raycast/recording.h"

namespace omnifleet::raycast {
namespace {

namespace fs = std::filesystem;

evaluation::MapMetrics mapped(const RecordingOptions& options) {
  const fs::path folder =
      fs::path(::testing::TempDir()) / ("omnifleet_raycast_" + std::to_string(::getpid()));
  record((folder / "recording").string(), options);
  services::InProcessRun run;
  run.dataset = (folder / "recording").string();
  run.out = (folder / "out").string();
  run.log_level = "off";
  services::runInProcess(run);
  const auto metrics =
      evaluation::compareMaps(dataset::readObjects(run.dataset + "/groundtruth/scene.geojson"),
                              dataset::readObjects(run.out + "/objects.geojson"), {});
  fs::remove_all(folder);
  std::printf("found %zu of %d, false %zu, %.2f / %.2f cm, IoU %.3f\n", metrics.matches.size(),
              metrics.truths, metrics.falsely_found.size(), 100 * metrics.x_error_m, 100 * metrics.y_error_m,
              metrics.iou);
  return metrics;
}

RecordingOptions small(unsigned seed, Floor floor) {
  RecordingOptions options;
  options.seed = seed;
  options.floor = floor;
  options.frames = 15;
  options.things = 6;
  options.width_px = 480;
  options.height_px = 360;
  return options;
}

/// Planks that differ, and their joints, are no things.
TEST(RayCast, ThingsOnParquetAreMapped) {
  RecordingOptions options = small(1702, Floor::kParquet);
  options.projection = lens::Projection::kEquisolid;
  const auto metrics = mapped(options);
  EXPECT_GE(metrics.matches.size(), 5U);  // one is seen from afar only
  EXPECT_TRUE(metrics.falsely_found.empty());
  EXPECT_LT(std::max(metrics.x_error_m, metrics.y_error_m), 0.01);
}

/// Nor is tape, of another hue than the floor all along, which the things stand on.
TEST(RayCast, TapeIsNoThing) {
  RecordingOptions options = small(1708, Floor::kLino);
  options.tape = true;
  const auto metrics = mapped(options);
  EXPECT_GE(metrics.matches.size(), 5U);
  EXPECT_TRUE(metrics.falsely_found.empty());
  EXPECT_LT(std::max(metrics.x_error_m, metrics.y_error_m), 0.02);
}

}  // namespace
}  // namespace omnifleet::raycast
