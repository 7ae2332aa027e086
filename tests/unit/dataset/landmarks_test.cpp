#include "dataset/landmarks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "dataset/dataset.h"
#include "dataset/writer.h"
#include "options/options.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::HasSubstr;

class Landmarks : public ::testing::Test {
 protected:
  std::vector<Landmark> read(const std::string& text) {
    std::ofstream(path_) << text;
    return readLandmarks(path_);
  }
  /// Error message for the file, or "accepted".
  std::string refusal(const std::string& text) {
    try {
      read(text);
    } catch (const options::Error& error) {
      return error.what();
    }
    return "accepted";
  }
  const test::TempFolder folder_;
  const std::string path_ = folder_ / "landmarks.yaml";
};

TEST_F(Landmarks, ReadsLandmarksByNameWithDefaultSigma) {
  const auto all =
      read("landmarks:\n  door: {position_m: [1.5, -2]}\n  \"7\": {position_m: [0, 3], sigma_m: 0.02}\n");
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].name, "7");  // sorted by name
  EXPECT_EQ(all[0].position_m, Eigen::Vector2d(0, 3));
  EXPECT_EQ(all[0].sigma_m, 0.02);
  EXPECT_EQ(all[1].name, "door");
  EXPECT_EQ(all[1].position_m, Eigen::Vector2d(1.5, -2));
  EXPECT_EQ(all[1].sigma_m, Landmark().sigma_m);
}

TEST_F(Landmarks, ReadsWhatItWrites) {
  writeLandmarks(path_, {{"a", {1.0 / 3.0, -2e-7}, 0.005}, {"b 2", {1e3, 0}, 0.1}});
  const auto all = readLandmarks(path_);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].position_m, Eigen::Vector2d(1.0 / 3.0, -2e-7));
  EXPECT_EQ(all[1].name, "b 2");
  EXPECT_EQ(all[1].sigma_m, 0.1);
}

TEST_F(Landmarks, RejectsBadFilesWithFileAndLine) {
  EXPECT_THAT(refusal("landmarks:\n  a: {position_m: [1, 2]}\n  b: {sigma_m: 0.1}\n"),
              HasSubstr("landmarks.yaml:3: landmarks.b.position_m: is required"));
  EXPECT_THAT(refusal("landmarks:\n  a: {position_m: [1, 2, 3]}\n"), HasSubstr("landmarks.yaml:2"));
  EXPECT_THAT(refusal("landmarks:\n  a: {position_m: [1, .nan]}\n"), HasSubstr("landmarks.yaml:2"));
  EXPECT_THAT(refusal("landmarks:\n  a: {position_m: [1, 2], sigma_m: 0}\n"), HasSubstr("sigma_m"));
  EXPECT_THAT(refusal("landmarks:\n  a: {position_m: [1, 2], sigma: 0.1}\n"), HasSubstr("sigma"));
  EXPECT_THAT(refusal("landmark:\n  a: {position_m: [1, 2]}\n"), HasSubstr("landmark"));
  EXPECT_THAT(refusal("landmarks: {a: [\n"), HasSubstr("landmarks.yaml"));
  EXPECT_THROW(readLandmarks(folder_ / "none.yaml"), options::Error);
}

TEST_F(Landmarks, ReadsLandmarksOfDataset) {
  RobotRecording robot;
  robot.name = "r1";
  robot.body = {0.15, {}, 0.3, 0.26};
  writeDatasetYaml(folder_.path(), {robot});
  EXPECT_TRUE(Dataset::open(folder_.path()).landmarks.empty());
  std::ofstream(path_) << "landmarks:\n  a: {position_m: [1, 2]}\n";
  ASSERT_EQ(Dataset::open(folder_.path()).landmarks.size(), 1u);
  std::ofstream(path_) << "landmarks:\n  a: {}\n";
  EXPECT_THROW(Dataset::open(folder_.path()), options::Error);
}

}  // namespace
}  // namespace omnifleet::dataset
