// A run in which no frame could be read fails and gives the reason, in every mode.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/multiprocess/process.h"

namespace omnifleet::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Outcome {
  int code = -1;
  std::string text;
};

Outcome outcomeOf(const std::vector<std::string>& argv, const std::string& folder) {
  Process process(argv, folder + "/output.log");
  const auto code = process.wait(100s);  // beyond the limit of 60 s after the last frame
  return {code.value_or(-1), process.output()};
}

/// A fleet file of one robot whose camera reads ten files that are no images.
std::string damagedFolder(const std::string& folder) {
  fs::create_directories(folder + "/images");
  for (int i = 0; i < 10; ++i) std::ofstream(folder + "/images/" + std::to_string(10 + i) + ".jpg") << "cut";
  std::ofstream(folder + "/sensor.yaml")
      << "projection: equidistant\nimage_width: 640\nimage_height: 480\nfocal_px: 150\n"
         "principal_point_px: [319.5, 239.5]\nfov_deg: 185\nposition_m: [0, 0, 0.5]\n";
  std::ofstream(folder + "/fleet.yaml")
      << "name: lab\nrobots:\n  r1: {initial_pose: [0, 0, 0], body: {radius_m: 0.15, height_m: 0.3}, "
         "wheel_separation_m: 0.26, wheels: false}\n"
         "cameras:\n  r1/fisheye: {source: folder, path: images, sensor: sensor.yaml, rate_hz: 10}\n";
  return folder + "/fleet.yaml";
}

void expectFailure(const Outcome& run) {
  EXPECT_EQ(run.code, 1) << run.text;
  EXPECT_THAT(run.text, AllOf(HasSubstr("r1/fisheye: none of its 10 frames could be read"),
                              HasSubstr("[map_empty] no usable frame of r1 has arrived"),
                              HasSubstr("failed: "), Not(HasSubstr("done: "))));
}

TEST(UnreadableFrames, FailReplayOfFolder) {
  const std::string folder = freshDir("damaged_folder");
  expectFailure(outcomeOf(
      {program("launch"), "run", damagedFolder(folder), "--out", folder + "/out", "--domain", "69"}, folder));
  EXPECT_FALSE(fs::exists(folder + "/out/map.png"));
}

TEST(UnreadableFrames, FailLiveRunSoonAfterTheLastFrame) {
  const std::string folder = freshDir("damaged_folder_live");
  expectFailure(outcomeOf({program("launch"), "run", damagedFolder(folder), "--realtime", "--out",
                           folder + "/out", "--domain", "69"},
                          folder));
}

/// Two robots; the rows of the camera of one or of both name no file.
class EmptyNames : public ::testing::Test {
 protected:
  void SetUp() override {
    Process make(
        {program("make_recording"), sourceDir() + "/config/arenas/small.yaml", "--seed", "3", "--out", data_},
        folder_ + "/make.log");
    ASSERT_EQ(make.wait(120s), std::optional<int>(0)) << make.output();
  }
  void empty(const std::string& robot) const {
    const std::string path = data_ + "/" + robot + "/fisheye/data.csv";
    std::ifstream in(path);
    std::string text;
    for (std::string line; std::getline(in, line);)
      text += (line[0] == '#' ? line : line.substr(0, line.find(',') + 1)) + "\n";
    in.close();
    std::ofstream(path) << text;
  }
  Outcome replay() const {
    return outcomeOf({program("launch"), "replay", data_, "--out", folder_ + "/out", "--domain", "69"},
                     folder_);
  }
  std::string folder_ = freshDir("empty_names"), data_ = folder_ + "/data";
};

/// The recording has images of the ceiling camera, so it is not refused.
TEST_F(EmptyNames, AreAFailureIfNoRobotHasFrames) {
  empty("r1");
  empty("r2");
  const Outcome run = replay();
  EXPECT_EQ(run.code, 1) << run.text;
  EXPECT_THAT(run.text,
              AllOf(HasSubstr("r1/fisheye: none of its"), HasSubstr("no usable frame of r1 has arrived")));
}

TEST_F(EmptyNames, AreReportedWithTheRobotIfAnotherOneHasFrames) {
  empty("r2");
  const Outcome run = replay();
  EXPECT_EQ(run.code, 0) << run.text;
  EXPECT_THAT(run.text, HasSubstr("r2/fisheye: none of its"));
}

}  // namespace
}  // namespace omnifleet::test
