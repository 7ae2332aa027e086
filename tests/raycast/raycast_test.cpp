// The whole fleet in one process on images of a second renderer, which was not used in development. It has
// other light, another tone curve, floors of lino, parquet and carpet, and tape on the floor.

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

/// Changes the recording in `folder` before it is mapped.
using Edit = std::function<void(const std::string& folder)>;

/// Renders a recording, maps it, and compares the map with the truth.
evaluation::MapMetrics mapRecording(const RecordingOptions& options, const Edit& edit = {}) {
  const fs::path folder =
      fs::path(::testing::TempDir()) / ("omnifleet_raycast_" + std::to_string(::getpid()));
  record((folder / "recording").string(), options);
  if (edit) edit((folder / "recording").string());
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

RecordingOptions smallRecording(unsigned seed, Floor floor) {
  RecordingOptions options;
  options.seed = seed;
  options.floor = floor;
  options.frames = 15;
  options.obstacles = 6;
  options.width_px = 480;
  options.height_px = 360;
  return options;
}

/// Planks of different colour and the joints between them are floor.
TEST(RayCast, MapsObstaclesOnParquet) {
  RecordingOptions options = smallRecording(1702, Floor::kParquet);
  options.projection = lens::Projection::kEquisolid;
  const auto metrics = mapRecording(options);
  EXPECT_GE(metrics.matches.size(), 5U);  // one obstacle is only seen from a distance
  EXPECT_TRUE(metrics.falsely_found.empty());
  EXPECT_LT(std::max(metrics.x_error_m, metrics.y_error_m), 0.01);
}

/// Tape is floor, although it differs from the floor in hue everywhere and obstacles stand on it.
TEST(RayCast, MapsNoTapeAsObstacle) {
  RecordingOptions options = smallRecording(1708, Floor::kLino);
  options.tape = true;
  const auto metrics = mapRecording(options);
  EXPECT_GE(metrics.matches.size(), 5U);
  EXPECT_TRUE(metrics.falsely_found.empty());
  EXPECT_LT(std::max(metrics.x_error_m, metrics.y_error_m), 0.02);
}

/// The first robot's wheels slip for one second: they report 1.5 m/s while the robot drives at most 0.3 m/s.
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

TEST(RayCast, KeepsMapAccurateWhileWheelsSlipForOneSecond) {
  RecordingOptions options = smallRecording(1702, Floor::kParquet);
  options.projection = lens::Projection::kEquisolid;
  const auto metrics = mapRecording(options, slip);
  EXPECT_GE(metrics.matches.size(), 5U);
  EXPECT_TRUE(metrics.falsely_found.empty());
  EXPECT_LT(std::max(metrics.x_error_m, metrics.y_error_m), 0.01);
}

}  // namespace
}  // namespace omnifleet::raycast
