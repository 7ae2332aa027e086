#include "dataset/merge_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dataset/atomic_file.h"
#include "dataset/map_files.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

MergeReport someMerge() {
  MergeReport report;
  report["r1"] = {AlignmentStatus::kAnchored, "map", "initial pose", 1.0, {}, {}, 0.5};
  report["r2"] = {AlignmentStatus::kMatched,       "map", "3 shared places", 0.97, Pose2{1.5, -2.0, 0.1},
                  Eigen::Vector2d(0.0123, 0.0004), 12.25};
  report["r3"].reason = "no sample of this robot was received";
  return report;
}

TEST(MergeFile, WritesNullForWhatIsUnknown) {
  EXPECT_EQ(mergeText(someMerge()), R"({
  "robots": {
    "r1": {
      "status": "anchored",
      "frame": "map",
      "reason": "initial pose",
      "score": 1.0,
      "map_from_frame": null,
      "sigma": null,
      "time_s": 0.5
    },
    "r2": {
      "status": "matched",
      "frame": "map",
      "reason": "3 shared places",
      "score": 0.97,
      "map_from_frame": [
        1.5,
        -2.0,
        0.1
      ],
      "sigma": [
        0.0123,
        0.0004
      ],
      "time_s": 12.25
    },
    "r3": {
      "status": "undecided",
      "frame": null,
      "reason": "no sample of this robot was received",
      "score": null,
      "map_from_frame": null,
      "sigma": null,
      "time_s": null
    }
  }
}
)");
}

TEST(MergeFile, ReadsWhatItWrites) {
  const test::TempFolder folder;
  writeMerge(folder / "merge.json", someMerge());
  EXPECT_EQ(mergeText(readMerge(folder / "merge.json")), mergeText(someMerge()));
}

TEST(MergeFile, NamesFileAndRobotOfDamage) {
  const test::TempFolder folder;
  const std::string path = folder / "merge.json";
  const auto problemOf = [&](const std::string& text) {
    writeAtomic(path, text);
    try {
      readMerge(path);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(problemOf(R"({"robots": {"r7": {"status": "lucky", "frame": "map"}}})"),
              AllOf(HasSubstr(path), HasSubstr("r7"), HasSubstr("lucky")));
  EXPECT_THAT(problemOf(mergeText(someMerge()).substr(0, 100)), HasSubstr(path));
  EXPECT_THAT(problemOf("{}"), HasSubstr("robots"));
}

/// A reason is cut to the bound of its topic, perhaps within a character.
TEST(MergeFile, WritesReasonThatWasCutWithinACharacter) {
  MergeReport report;
  report["r1"].reason = std::string("σ").substr(0, 1);
  EXPECT_THAT(mergeText(report), HasSubstr("\"reason\""));
}

TEST(MapFiles, StateTheFrameOfARobotsOwnMap) {
  const test::TempFolder folder;
  OccupancyGrid grid;
  grid.width = grid.height = 1;
  grid.cells = {100};
  writeMapServer(folder / "own", grid, "r2");
  EXPECT_THAT(readFile(folder / "own.yaml"), HasSubstr("frame: \"r2\"\n"));
  EXPECT_EQ(readMapServer(folder / "own.yaml").cells, grid.cells);
  writeMapServer(folder / "map", grid);
  EXPECT_THAT(readFile(folder / "map.yaml"), ::testing::Not(HasSubstr("frame")));
  EXPECT_THAT(objectsText({}, {}, "r2"), HasSubstr("\"frame\": \"r2\""));
  EXPECT_THAT(objectsText({}), ::testing::Not(HasSubstr("\"frame\"")));
  writeObjects(folder / "objects.geojson", {}, {}, "r2");
  EXPECT_TRUE(readObjects(folder / "objects.geojson").empty());
}

}  // namespace
}  // namespace omnifleet::dataset
