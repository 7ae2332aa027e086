#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "dataset/atomic_file.h"
#include "lens/camera.h"
#include "tests/experiments/ahmed/error_curve.h"
#include "tests/experiments/ahmed/result.h"
#include "tests/experiments/ahmed/scale_pairs.h"
#include "tests/raycast/arena_recording.h"

namespace omnifleet::ahmed {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

std::string folder(const std::string& name) {
  const std::string path = ::testing::TempDir() + "/omnifleet_ahmed_" + name;
  fs::remove_all(path);
  return path;
}

TEST(AhmedScale, FitGivesTrueDistancesStraightAhead) {
  const std::string out = folder("scale");
  const Calibration calibration = calibrate(5, out);
  ASSERT_EQ(calibration.pairs.size(), 10U);
  EXPECT_EQ(distance_vector::ScaleFit::readPairs(out + "/pairs.csv").size(), 10U);
  const distance_vector::ScaleFit fit(calibration.pairs);
  // Ceiling camera c1 hangs 2.45–2.55 m high with about 590 px.
  EXPECT_NEAR(calibration.metres_per_ceiling_px, 2.5 / 590.0, 0.0005);
  raycast::ArenaOptions options;
  options.seed = 5;
  const lens::Camera camera(raycast::arenaStory(options).front);
  double worst = 0.0;  // of the fit: a polynomial of degree 4 does not follow the pole at the horizon
  for (std::size_t k = 0; k < fit.pairs().size(); ++k)
    worst = std::max(worst, std::abs(fit.residuals()[k]) / fit.pairs()[k].alpha());
  EXPECT_LT(worst, 0.07);
  for (const double distance_m : {0.25, 0.4, 0.7}) {
    const double robot_px = 239.0 - camera.pixelFromPoint({distance_m, 0.0, 0.0}).value().y();
    const auto measured = fit.ceilingPx(robot_px);
    ASSERT_TRUE(measured) << distance_m;
    // d_r is in whole pixels. The scale of the ceiling image varies by 2 % (distortion).
    const double pixel_m = calibration.metres_per_ceiling_px * fit.ceilingSlope(robot_px);
    EXPECT_NEAR(*measured * calibration.metres_per_ceiling_px, distance_m,
                (worst + 0.02) * distance_m + pixel_m);
  }
}

TEST(AhmedErrorCurve, ProjectionIsMoreAccurateThanLiteralMethod) {
  const std::string out = folder("curve");
  const Calibration calibration = calibrate(6, out + "/scale");
  dataset::writeAtomic(out + "/scale.yaml", distance_vector::ScaleFit(calibration.pairs).toYaml());
  dataset::writeAtomic(
      out + "/literal.yaml",
      "services: {local_mapper: {distance_vector: {method: literal, literal: {scale_file: " + out +
          "/scale.yaml, metres_per_ceiling_px: " + std::to_string(calibration.metres_per_ceiling_px) +
          "}}}}\n");
  raycast::ArenaOptions options;
  options.seed = 6;
  options.frames = 12;
  options.rate_hz = 0.5;  // places far apart
  raycast::recordArena(out + "/recording", options);
  const ErrorCurve curve = errorCurve({out + "/recording"}, {out + "/literal.yaml"});
  int compared = 0;
  for (std::size_t bin = 0; bin < curve.distance_m.size(); ++bin) {
    if (curve.distance_m[bin] > 1.0 || curve.literal[bin].count < 100 || curve.omnifleet[bin].count < 100)
      continue;
    ++compared;
    EXPECT_LT(curve.omnifleet[bin].median_m, 0.01)
        << curve.distance_m[bin];  // sub-pixel edges: 1 px is 4 cm at 1 m
    EXPECT_GT(curve.literal[bin].median_m, 2.0 * curve.omnifleet[bin].median_m) << curve.distance_m[bin];
  }
  EXPECT_GE(compared, 3);
  EXPECT_THAT(curve.csv(), HasSubstr("distance_m,literal_count"));
}

TEST(AhmedResult, SumsTrafficOfRobotAndReadsMetrics) {
  const std::string out = folder("result");
  raycast::ArenaOptions options;
  options.frames = 11;  // 2 s
  raycast::recordArena(out + "/seed_7/recording", options);
  const std::string run = out + "/seed_7/omnifleet";
  dataset::makeDirectories(run + "/log");
  std::ofstream(run + "/metrics.json") << R"({"cells": {"all": {"seen_occupied": 0.5}, "near_error_m": null,
    "on_robots": 3}, "paths": {"r1": {"distance_m": 0.001, "heading_rad": 0.01},
    "r2": {"distance_m": 0.003, "heading_rad": 0.03}, "r3": {"distance_m": 9, "heading_rad": 9}}})";
  const std::string line = "2026 [global_merger r1] info: topics that other hosts read: sent ";
  std::ofstream(run + "/log/global_merger_r1.log") << line << "4000 bytes, received 9 bytes\n";
  std::ofstream(run + "/log/classifier_r1.log") << line << "1000 bytes, received 9 bytes\n";
  std::ofstream(run + "/log/global_merger_r2.log") << line << "3000 bytes, received 9 bytes\n";
  std::ofstream(run + "/log/localizer.log") << line << "70000 bytes, received 9 bytes\n";
  const SeedFigures seed = SeedFigures::load(out, 7);
  ASSERT_EQ(seed.runs.size(), 1U);
  const RunFigures& figures = seed.runs.at("omnifleet");
  EXPECT_DOUBLE_EQ(figures.faces_occupied, 0.5);
  EXPECT_TRUE(std::isnan(figures.near_error_m));
  EXPECT_TRUE(std::isnan(figures.free_complete));
  EXPECT_DOUBLE_EQ(figures.on_robots, 3.0);
  EXPECT_DOUBLE_EQ(figures.position_m, 0.002);  // mapping robots only
  EXPECT_DOUBLE_EQ(figures.recorded_s, 2.0);
  EXPECT_DOUBLE_EQ(figures.sent_bytes_per_s, 0.5 * (5000 + 3000) / 2.0);
  EXPECT_THAT(rows(seed), HasSubstr("50.0"));
}

TEST(AhmedReport, GivesMedianAndWorstOfEachMethod) {
  std::vector<SeedFigures> seeds(3);
  for (std::size_t k = 0; k < 3; ++k) {
    seeds[k].seed = static_cast<std::uint32_t>(1000 + k);
    seeds[k].runs["omnifleet"].faces_occupied = 0.9 + 0.01 * static_cast<double>(k);
    seeds[k].runs["literal"].near_error_m = 0.01 * static_cast<double>(k + 1);
    seeds[k].runs["literal"].far_error_m = std::numeric_limits<double>::quiet_NaN();
  }
  seeds[0].runs["stale/omnifleet"].heading_rad = 0.1;
  seeds[0].runs["waiting/omnifleet"].heading_rad = 0.01;
  const std::string text = report(seeds);
  EXPECT_THAT(text, HasSubstr("3 seeds (1000 to 1002)"));
  EXPECT_THAT(text, HasSubstr("91.0 (90.0)"));  // faces: less is worse
  EXPECT_THAT(text, HasSubstr("2.00 (3.00)"));  // error: more is worse
  EXPECT_THAT(text, HasSubstr("261"));
  EXPECT_THAT(text, HasSubstr("Cost of a stale heading, 1 seed"));
  EXPECT_THAT(text, HasSubstr("5.73 (5.73)"));
  EXPECT_THAT(text, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace omnifleet::ahmed
