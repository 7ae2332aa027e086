// The whole fleet in one process on pictures of a renderer that nothing was developed on: other light,
// another tone curve, floors of lino, parquet and carpet, tape on them.

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "evaluation/map_metrics.h"
#include "fleet_in_process/in_process.h"
#include "tests/raycast/recording.h"

namespace omnifleet::raycast {
namespace {

namespace fs = std::filesystem;

/// Called on the folder of a recording before it is mapped.
using Mishap = std::function<void(const std::string& folder)>;

evaluation::MapMetrics mapped(const RecordingOptions& options, const Mishap& mishap = {}) {
  const fs::path folder =
      fs::path(::testing::TempDir()) / ("omnifleet_raycast_" + std::to_string(::getpid()));
  record((folder / "recording").string(), options);
  if (mishap) mishap((folder / "recording").string());
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

/// The first robot's wheels slip for a second: told at 1.5 m/s while it goes at a tenth of that.
void slip(const std::string& folder) {
  const std::string path = folder + "/r1/wheels/data.csv";
  std::ifstream in(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  in.close();
  ASSERT_GE(lines.size(), 12U);
  for (std::size_t i = 7; i < 12; ++i) lines[i] = lines[i].substr(0, lines[i].find(',')) + ",1.5,1.5";
  std::ofstream out(path);
  for (const std::string& line : lines) out << line << "\n";
}

TEST(RayCast, WheelsThatSlipForASecondSmearNothing) {
  RecordingOptions options = small(1702, Floor::kParquet);
  options.projection = lens::Projection::kEquisolid;
  const auto metrics = mapped(options, slip);
  EXPECT_GE(metrics.matches.size(), 5U);
  EXPECT_TRUE(metrics.falsely_found.empty());
  EXPECT_LT(std::max(metrics.x_error_m, metrics.y_error_m), 0.01);
}

}  // namespace
}  // namespace omnifleet::raycast
