// Truncated, corrupted and random files cause an error or a warning, never a crash or the pixels of another
// frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

cv::Mat noise(int seed) {
  cv::Mat image(48, 64, CV_8UC3);
  cv::RNG random(static_cast<std::uint64_t>(seed));
  random.fill(image, cv::RNG::UNIFORM, 0, 255);
  return image;
}

std::vector<unsigned char> encoded(const char* extension) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, noise(1), bytes);
  return bytes;
}

std::string text(const std::vector<unsigned char>& bytes) {
  return {bytes.begin(), bytes.end()};
}

/// Writes a file without the sync to disk of the library, because these tests write hundreds of files.
void put(const std::string& path, const std::string& content) {
  std::ofstream(path, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
}

class DamagedImages : public ::testing::TestWithParam<const char*> {};

TEST_P(DamagedImages, RejectsTruncatedImageAtAnyLength) {
  const test::TempFolder folder;
  const std::vector<unsigned char> whole = encoded(GetParam());
  std::vector<unsigned char> buffer;
  std::string note;
  const std::string path = folder / "image";
  int taken = 0;
  // Every length within the header, then in strides. The last bytes of a PNG (its IEND chunk) contain no
  // pixels.
  for (std::size_t size = 0; size + 16 < whole.size(); size += size < 700 ? 1 : 97) {
    put(path, text({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}));
    cv::Mat image = noise(2);
    taken += decodeImage(path, Colour::kBgr, {64, 48}, buffer, image, note) == FrameState::kOk;
    EXPECT_EQ(image.size(), cv::Size(64, 48));
  }
  EXPECT_EQ(taken, 0);
}

TEST_P(DamagedImages, KeepsMemoryOfCallerWithFlippedBits) {
  const test::TempFolder folder;
  const std::vector<unsigned char> whole = encoded(GetParam());
  std::mt19937 random(4);
  std::vector<unsigned char> buffer, loan(64 * 48 * 3 + 64, 0xAB);
  std::string note;
  const std::string path = folder / "image";
  for (int trial = 0; trial < 150; ++trial) {
    std::vector<unsigned char> bytes = whole;
    for (int i = 0; i < 3; ++i)
      bytes[random() % bytes.size()] ^= static_cast<unsigned char>(1u << (random() % 8));
    put(path, text(bytes));
    cv::Mat image(48, 64, CV_8UC3, loan.data());
    const FrameState state = decodeImage(path, Colour::kBgr, {64, 48}, buffer, image, note);
    EXPECT_EQ(image.data, loan.data());
    EXPECT_EQ(note.empty(), state == FrameState::kOk);
  }
  for (std::size_t i = 64 * 48 * 3; i < loan.size(); ++i)
    EXPECT_EQ(loan[i], 0xAB) << "bytes beyond the frame were overwritten";
}

INSTANTIATE_TEST_SUITE_P(Formats, DamagedImages, ::testing::Values(".png", ".jpg"),
                         [](const auto& one) { return std::string(one.param + 1); });

/// Replaces some bytes by others that have a meaning in csv, YAML or JSON.
std::string scrambled(std::string content, std::mt19937& random) {
  constexpr std::string_view kBytes = ",:[]{}\"'#-+.eEnai09\n\t \\\xff\x00";
  for (int i = 0; i < 4; ++i) content[random() % content.size()] = kBytes[random() % kBytes.size()];
  if (random() % 3 == 0) content.resize(random() % content.size() + 1);
  return content;
}

template <typename Read>
void neverCrashes(const std::string& name, const std::string& content, const Read& read) {
  const test::TempFolder folder;
  std::mt19937 random(11);
  int refused = 0;
  for (int trial = 0; trial < 150; ++trial) {
    put(folder / name, scrambled(content, random));
    try {
      read(folder / name);
    } catch (const std::runtime_error& error) {  // options::Error derives from it
      ++refused;
      EXPECT_THAT(error.what(), ::testing::HasSubstr(name)) << "the error does not name the file";
    }
  }
  EXPECT_GT(refused, 0);
}

TEST(DamagedText, SurvivesDamagedObjects) {
  MapObject object;
  object.outline_m = {{0, 0}, {1, 0}, {1, 1}};
  object.observers = {"r1"};
  neverCrashes("objects.geojson", objectsText({object, object}), [](const std::string& path) {
    for (const MapObject& one : readObjects(path)) EXPECT_GE(one.outline_m.size(), 3u);
  });
}

TEST(DamagedText, SurvivesDamagedTrajectories) {
  neverCrashes("r1.tum", tumText({{1, Pose2{1, 2, 3}}}), [](const std::string& path) {
    for (const StampedPose3& pose : readTum(path)) EXPECT_TRUE(pose.flat().map_from_base.isFinite());
  });
}

TEST(DamagedText, SurvivesDamagedLocalizationFiles) {
  neverCrashes("r1.csv", "#t,s,e,c\n10,localized,none,0\n", [](const std::string& path) {
    for (const StampedLocalization& row : readLocalization(path)) EXPECT_GE(row.correction_sigmas, 0.0);
  });
}

TEST(DamagedText, SurvivesDamagedGraphs) {
  neverCrashes("p.g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.5\nEDGE_SE2 0 1 1 0 0.5 1 0 0 1 0 1\n",
               [](const std::string& path) { readG2o(path); });
}

TEST(DamagedText, SurvivesDamagedSensorFiles) {
  neverCrashes(
      "sensor.yaml",
      "camera_model: fisheye\nprojection: equidistant\nimage_width: 64\nimage_height: 48\nfocal_px: 15.5\n"
      "principal_point_px: [31.5, 23.5]\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n",
      [](const std::string& path) {
        const lens::CameraModel model = lens::CameraModel::load(path);
        EXPECT_GT(model.focal_px.minCoeff(), 0.0);
        EXPECT_TRUE(model.position_m.allFinite());
      });
}

TEST(DamagedText, SurvivesDamagedWheelTables) {
  neverCrashes("data.csv", "#t,l,r\n10,0.5,0.25\n20,0.5,0.25\n30,0.125,1e-3\n", [](const std::string& path) {
    std::vector<std::string> warnings;
    TimeNs latest = std::numeric_limits<TimeNs>::min();
    for (const WheelRow& row : readWheels(path, warnings)) {
      EXPECT_TRUE(std::isfinite(row.left_mps) && std::isfinite(row.right_mps));
      EXPECT_GE(row.time_ns, latest);
      latest = row.time_ns;
    }
  });
}

}  // namespace
}  // namespace omnifleet::dataset
