#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "calibrate/calibrate_run.h"
#include "tests/test_data.h"

namespace omnifleet::calibrate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// Runs on a folder of images without a board: the names that the search read, and the refusal.
std::pair<std::vector<std::string>, std::string> searched(const omnifleet::test::TempFolder& folder) {
  Options options;
  options.images = folder.path();
  options.board = calibration::Board::parse("9x6", 0.025);
  options.out = folder / "sensor.yaml";
  std::vector<std::string> names;
  std::string refusal;
  try {
    run(options, [&](const std::string& name, bool) { names.push_back(name); });
  } catch (const std::exception& error) {
    refusal = error.what();
  }
  return {names, refusal};
}

TEST(ImageFolder, ReadsEachFormatThatTheCameraReads) {
  const omnifleet::test::TempFolder folder;
  for (const char* name : {"1.tif", "2.TIFF", "3.pgm", "4.ppm", "5.png", "6.jpg", "7.bmp"}) {
    const bool colour = std::string(name) == "4.ppm";
    cv::imwrite(folder / name, cv::Mat(48, 64, colour ? CV_8UC3 : CV_8UC1, cv::Scalar::all(90)));
  }
  EXPECT_THAT(searched(folder).first,
              ::testing::ElementsAre("1.tif", "2.TIFF", "3.pgm", "4.ppm", "5.png", "6.jpg", "7.bmp"));
}

TEST(ImageFolder, NamesOtherFormats) {
  const omnifleet::test::TempFolder folder;
  std::ofstream(folder / "1.gif") << "GIF89a";
  EXPECT_THAT(searched(folder).second, AllOf(HasSubstr("no image (png, jpg, jpeg, bmp, tif, tiff, pgm, ppm)"),
                                             HasSubstr("convert its .gif files to png")));
}

}  // namespace
}  // namespace omnifleet::calibrate
