// The evaluate program as users run it: output, file and exit codes. Also checks that no other code includes
// the ground truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <fstream>

#include "dataset/atomic_file.h"
#include "tests/test_data.h"

namespace omnifleet::evaluate {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string output;
};

Outcome run(const std::string& arguments) {
  const std::string command = std::string(OMNIFLEET_EVALUATE_PROGRAM) + " " + arguments + " 2>&1";
  Outcome result;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> chunk{};
  while (std::fgets(chunk.data(), chunk.size(), pipe)) result.output += chunk.data();
  const int status = ::pclose(pipe);
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return result;
}

/// A run that reports exactly the ground truth of the rendered sample.
class Program : public ::testing::Test {
 protected:
  void SetUp() override {
    recording_ = test::dataPath("rendered_sample");
    if (recording_.empty()) GTEST_SKIP() << "test data missing: rendered_sample";
    dataset::writeAtomic(out_ / "objects.geojson",
                         dataset::readFile(recording_ + "/groundtruth/scene.geojson"));
    for (const char* name : {"r1.tum", "r2.tum", "r3.tum"}) {
      dataset::writeAtomic(out_ / ("trajectories/" + std::string(name)),
                           dataset::readFile(recording_ + "/groundtruth/" + name));
    }
  }
  std::string recording_;
  const test::TempFolder out_;
};

TEST_F(Program, PrintsTableAndWritesMetrics) {
  const Outcome result = run(out_.path() + " " + recording_);
  EXPECT_EQ(result.code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("found 5 of 5, missed 0, false 0"));
  EXPECT_THAT(dataset::readFile(out_ / "metrics.json"), HasSubstr("\"recall\": 1.0"));
}

TEST_F(Program, AlignsFleetAndRejectsOtherAlignments) {
  const Outcome aligned = run(out_.path() + " " + recording_ + " --align fleet");
  EXPECT_EQ(aligned.code, 0) << aligned.output;
  EXPECT_THAT(aligned.output, HasSubstr("aligned to the truth by (0.000, 0.000) m"));
  EXPECT_EQ(run(out_.path() + " " + recording_ + " --align none").code, 0);
  const Outcome unknown = run(out_.path() + " " + recording_ + " --align robots");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.output, HasSubstr("--align"));
}

TEST_F(Program, ReturnsTwoForBadInput) {
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("--unknown " + out_.path() + " " + recording_).code, 2);
  const Outcome missing = run("/nowhere/at/all " + recording_);
  EXPECT_EQ(missing.code, 2);
  EXPECT_THAT(missing.output, HasSubstr("/nowhere/at/all: no such folder"));
  EXPECT_EQ(run(out_.path() + " " + out_.path()).code, 2) << "a run is not a recording";
  EXPECT_EQ(run("--help").code, 0);
}

TEST_F(Program, ReturnsOneForDamagedOrMissingResult) {
  dataset::writeAtomic(out_ / "objects.geojson", "{\"type\": \"Feat");
  const Outcome damaged = run(out_.path() + " " + recording_);
  EXPECT_EQ(damaged.code, 1);
  EXPECT_THAT(damaged.output, HasSubstr("objects.geojson"));
  fs::remove(out_ / "objects.geojson");
  EXPECT_EQ(run(out_.path() + " " + recording_).code, 1);
  EXPECT_FALSE(fs::exists(out_ / "metrics.json"));
}

TEST_F(Program, ReturnsOneIfTableCannotBePrinted) {
  EXPECT_EQ(run(out_.path() + " " + recording_ + " >/dev/full").code, 1);
  EXPECT_THAT(dataset::readFile(out_ / "metrics.json"), HasSubstr("\"recall\": 1.0"));
}

// The pipeline never reads the ground truth; only evaluate and tests do.
TEST(GroundTruthHeader, IsIncludedOnlyByEvaluateAndTests) {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  ASSERT_NE(source, nullptr) << "ctest must set OMNIFLEET_SOURCE_DIR";
  int readers = 0;
  for (const char* part : {"libs", "services"}) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(fs::path(source) / part)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cpp" && extension != ".h") continue;
      const std::string content = dataset::readFile(entry.path().string());
      if (content.find("dataset/ground_truth.h\"") == std::string::npos) continue;
      const std::string folder = entry.path().parent_path().filename().string();
      EXPECT_TRUE(folder == "evaluate" || folder == "dataset") << entry.path();
      ++readers;
    }
  }
  EXPECT_GE(readers, 2) << "the check must find the includes of evaluate";
}

}  // namespace
}  // namespace omnifleet::evaluate
