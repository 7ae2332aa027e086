// Published chessboard images of real and simulated fisheye lenses (see the README of the test data).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "calibrate/calibrate_run.h"
#include "tests/test_data.h"

namespace omnifleet::calibrate {
namespace {

Report calibrated(const std::string& images, const std::string& match, const std::string& board,
                  double square_m, lens::Projection projection) {
  const omnifleet::test::TempFolder folder;
  Options options;
  options.images = images;
  options.match = match;
  options.board = calibration::Board::parse(board, square_m);
  options.projection = projection;
  options.out = folder / "sensor.yaml";
  return run(options, [](const std::string&, bool) {});
}

// Published by the authors of the images: fx 610.694, fy 610.568, centre (959.731, 959.739), 0.28 px.
TEST(ExternalBoards, CalibratesSimulatedCamera) {
  OMNIFLEET_NEEDS_DATA(path, "fisheye_downward/sim_calib_chess");
  const Report report = calibrated(path, "*.jpg", "9x6", 0.116, lens::Projection::kKannalaBrandt);
  EXPECT_EQ(report.used.size(), 12u);
  EXPECT_THAT(report.without_board, ::testing::IsEmpty());
  EXPECT_LE(report.total_rms_px, 0.5);
  EXPECT_NEAR(report.model.reprojection_rms_px, report.total_rms_px, 1e-9);
  EXPECT_NEAR(report.model.focal_px.x(), 610.694, 3.0);  // 0.5 % between two calibrations of 12 images each
  EXPECT_NEAR(report.model.principal_point_px.x(), 959.731, 2.0);
  EXPECT_NEAR(report.model.principal_point_px.y(), 959.739, 2.0);
}

TEST(ExternalBoards, ReportsCountedSquaresAtFirstImage) {
  OMNIFLEET_NEEDS_DATA(path, "fisheye_downward/sim_calib_chess");
  try {
    calibrated(path, "*.jpg", "10x7", 0.116, lens::Projection::kKannalaBrandt);
    ADD_FAILURE() << "accepted";
  } catch (const options::Error& error) {
    EXPECT_THAT(error.what(),
                ::testing::AllOf(::testing::HasSubstr("--board: "), ::testing::HasSubstr("a1.jpg"),
                                 ::testing::HasSubstr("9x6 inner corners, not 10x7")));
  }
}

class RealLenses : public ::testing::TestWithParam<lens::Projection> {};

TEST_P(RealLenses, CalibratesFirstLens) {
  OMNIFLEET_NEEDS_DATA(path, "ocamcalib_fisheye");
  const Report report = calibrated(path, "Fisheye1_*", "6x8", 0.0325, GetParam());
  EXPECT_EQ(report.used.size(), 15u);
  EXPECT_LE(report.total_rms_px, 0.7);
}

TEST_P(RealLenses, CalibratesSecondLens) {
  OMNIFLEET_NEEDS_DATA(path, "ocamcalib_fisheye");
  const Report report = calibrated(path, "Fisheye2_*", "6x8", 0.117, GetParam());
  EXPECT_EQ(report.used.size(), 16u);
  EXPECT_LE(report.total_rms_px, 0.7);
}

INSTANTIATE_TEST_SUITE_P(Models, RealLenses,
                         ::testing::Values(lens::Projection::kKannalaBrandt, lens::Projection::kOcam));

TEST(ExternalBoards, WritesNoLensAboveReprojectionLimit) {
  OMNIFLEET_NEEDS_DATA(path, "ocamcalib_fisheye");
  const omnifleet::test::TempFolder folder;
  Options options;
  options.images = path;
  options.match = "Fisheye1_*";
  options.board = calibration::Board::parse("6x8", 0.0325);
  options.projection = lens::Projection::kStereographic;
  options.out = folder / "sensor.yaml";
  try {
    run(options, [](const std::string&, bool) {});
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("--max-rms-px"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("--projection"));
  }
  EXPECT_FALSE(std::filesystem::exists(options.out));
  options.max_rms_px = 1000.0;
  EXPECT_GT(run(options, [](const std::string&, bool) {}).total_rms_px, 2.0);
  EXPECT_TRUE(std::filesystem::exists(options.out));
}

TEST(ExternalBoards, RejectsBadInput) {
  const omnifleet::test::TempFolder folder;
  EXPECT_THROW(calibrated(folder.path(), "*", "9x6", 0.1, lens::Projection::kOcam), options::Error);
  EXPECT_THROW(calibrated(folder / "nowhere", "*", "9x6", 0.1, lens::Projection::kOcam), options::Error);
  EXPECT_THROW(projectionFromName("fish"), options::Error);
}

}  // namespace
}  // namespace omnifleet::calibrate
