// Recordings and ground truth as people and their programs write them: used, or refused with the cause.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "dataset/atomic_file.h"
#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "dataset/image_names.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// A recording of one camera with two frames on disk, 10.png and 20.png.
class FieldRecording : public ::testing::Test {
 protected:
  void SetUp() override {
    put("dataset.yaml",
        "format: omnifleet-dataset\nversion: 1\nrobots:\n  r1:\n    body: {radius_m: 0.15, height_m: 0.3}\n");
    put("r1/fisheye/sensor.yaml",
        "projection: equidistant\nimage_width: 64\nimage_height: 48\nfocal_px: 15\n"
        "principal_point_px: [31.5, 23.5]\nfov_deg: 185\n");
    std::filesystem::create_directories(folder_ / "r1/fisheye/data");
    for (const char* name : {"10.png", "20.png"})
      cv::imwrite(folder_ / "r1/fisheye/data/" + name, cv::Mat(48, 64, CV_8UC1, cv::Scalar(90)));
  }
  void put(const std::string& name, const std::string& text) { writeAtomic(folder_ / name, text); }

  /// Refusal of the recording, or of its frames, with this data.csv.
  std::string refusal(const std::string& rows) {
    put("r1/fisheye/data.csv", "#timestamp [ns],filename\n" + rows);
    try {
      dataset_ = Dataset::open(folder_.path());
      checkFrames(dataset_);
    } catch (const options::Error& error) {
      return error.what();
    }
    return "";
  }
  std::vector<FrameState> states() const {
    const auto source = openStream(*dataset_.findStream("r1/fisheye"), Colour::kGrey);
    std::vector<FrameState> all;
    cv::Mat image;
    for (FrameInfo info; source->next(image, info);) all.push_back(info.state);
    return all;
  }

  test::TempFolder folder_;
  Dataset dataset_;
};

TEST_F(FieldRecording, ReadsNamesThatBeginWithData) {
  EXPECT_EQ(refusal("10,data/10.png\n20,20.png\n"), "");
  EXPECT_THAT(states(), ElementsAre(FrameState::kOk, FrameState::kOk));
  EXPECT_THAT(dataset_.warnings, IsEmpty());
}

TEST_F(FieldRecording, PrefersFolderDataWithinData) {
  std::filesystem::create_directories(folder_ / "r1/fisheye/data/data");
  std::filesystem::rename(folder_ / "r1/fisheye/data/10.png", folder_ / "r1/fisheye/data/data/10.png");
  EXPECT_EQ(refusal("10,data/10.png\n20,20.png\n"), "");
  EXPECT_THAT(states(), ElementsAre(FrameState::kOk, FrameState::kOk));
}

TEST_F(FieldRecording, NamesBackslashAndMissingExtension) {
  EXPECT_THAT(
      refusal("10,data\\10.png\n20,data\\20.png\n"),
      AllOf(HasSubstr("data.csv:2: the file 'data\\10.png' contains a backslash"), HasSubstr("no row")));
  EXPECT_THAT(refusal("10,10\n20,20\n"),
              HasSubstr("data.csv:2: the file '10' does not exist, but '10.png' does"));
  EXPECT_EQ(refusal("10,10\n20,20.png\n"), "");
  EXPECT_THAT(dataset_.warnings, ElementsAre(HasSubstr("write the name with its extension")));
}

TEST_F(FieldRecording, RefusesStreamOfWhichNoFrameCanBeRead) {
  EXPECT_THAT(refusal("10,a.png\n20,b.png\n"),
              AllOf(HasSubstr("r1/fisheye/data.csv: none of its 2 frames can be read"),
                    HasSubstr("a.png does not exist")));
  put("r1/fisheye/data/a.png", "no image");
  EXPECT_THAT(refusal("10,a.png\n"), HasSubstr("cannot be decoded"));
  cv::imwrite(folder_ / "r1/fisheye/data/a.png", cv::Mat(60, 80, CV_8UC1, cv::Scalar(90)));
  EXPECT_THAT(refusal("10,a.png\n"), HasSubstr("is 80×60, but its calibration is for 64×48"));
}

TEST_F(FieldRecording, AcceptsStreamWithOneReadableFrame) {
  EXPECT_EQ(refusal("10,a.png\n15,\n20,20.png\n"), "");
}

TEST_F(FieldRecording, RefusesRecordingWhoseRowsNameNoImage) {
  EXPECT_THAT(refusal("10,\n20,\n"),
              AllOf(HasSubstr("r1/fisheye/data.csv: no row names an image"), HasSubstr("2 r1/fisheye")));
  put("dataset.yaml",
      "format: omnifleet-dataset\nversion: 1\nrobots:\n  r1:\n    body: {radius_m: 0.15, height_m: 0.3}\n"
      "  r2:\n    body: {radius_m: 0.15, height_m: 0.3}\n");
  std::filesystem::create_directories(folder_ / "r2");
  std::filesystem::copy(folder_ / "r1/fisheye", folder_ / "r2/fisheye",
                        std::filesystem::copy_options::recursive);
  put("r2/fisheye/data.csv", "#timestamp [ns],filename\n10,10.png\n");
  EXPECT_EQ(refusal("10,\n20,\n"), "") << "another robot has images";
}

TEST(ImageNames, ListsOneSetForAllPrograms) {
  for (const char* name : {"a.png", "a.JPG", "a.jpeg", "a.bmp", "a.tif", "a.TIFF", "a.pgm", "a.ppm"})
    EXPECT_TRUE(isImageName(name)) << name;
  for (const char* name : {"a.gif", "a", "a.yaml", ".png"}) EXPECT_FALSE(isImageName(name)) << name;
}

std::string collection(const std::string& features) {
  return R"({"type": "FeatureCollection", "features": [)" + features + "]}";
}
constexpr const char* kSquare =
    R"("geometry": {"type": "Polygon", "coordinates": [[[0, 0], [0.3, 0], [0.3, 0.2], [0, 0.2], [0, 0]]]}})";

/// scene.geojson with these features.
class FieldScene : public ::testing::Test {
 protected:
  GroundTruth load(const std::string& features) {
    writeAtomic(folder_ / "groundtruth/scene.geojson", collection(features));
    return GroundTruth::load(folder_.path());
  }
  std::string refusal(const std::string& features) {
    try {
      load(features);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  test::TempFolder folder_;
};

TEST_F(FieldScene, TakesNullAsAbsent) {
  const GroundTruth truth =
      load(std::string(
               R"({"type": "Feature", "properties": {"id": null, "kind": null, "name": null, "height_m": null,
      "observations": null, "observers": null, "centroid": null}, )") +
           kSquare);
  ASSERT_EQ(truth.scene.size(), 1u);
  EXPECT_EQ(truth.scene[0].kind, "obstacle");
  EXPECT_EQ(truth.scene[0].height_m, 0.0);
  EXPECT_EQ(truth.scene[0].centroid_m, Eigen::Vector2d(0.15, 0.1));
}

TEST_F(FieldScene, NamesPropertyOfWrongTypeInPlainWords) {
  const std::string first = std::string(R"({"properties": {}, )") + kSquare;
  const struct {
    const char* property;
    const char* problem;
  } rows[] = {{R"("height_m": "0.3")", "properties.height_m: expected a number, found string"},
              {R"("kind": 3)", "properties.kind: expected text, found number"},
              {R"("name": [1])", "properties.name: expected text, found array"},
              {R"("observations": 1.5)", "properties.observations: expected a whole number, found number"},
              {R"("observers": "r1")", "properties.observers: expected a list of names, found string"},
              {R"("centroid": [1])", "properties.centroid: expected [x, y], found array"}};
  for (const auto& row : rows) {
    EXPECT_THAT(
        refusal(first + R"(, {"properties": {)" + row.property + "}, " + kSquare),
        AllOf(HasSubstr(std::string("scene.geojson: feature 2: ") + row.problem), Not(HasSubstr("json."))));
  }
  EXPECT_THAT(refusal(R"({"geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, "x"], [1, 1]]]}})"),
              HasSubstr("geometry.coordinates: expected a number, found string"));
  EXPECT_THAT(refusal(R"({"geometry": {"type": "Polygon"}})"),
              HasSubstr("geometry.coordinates: expected a list"));
  EXPECT_THAT(refusal("{\"properties\": }"),
              AllOf(HasSubstr("scene.geojson:1: not valid JSON"), Not(HasSubstr("json."))));
}

TEST_F(FieldScene, UsesClosedLinesAndNamesTheOthers) {
  const GroundTruth truth = load(
      R"({"properties": {"kind": "obstacle"}, "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0], [1, 1], [0, 0]]}},
      {"properties": {}, "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0], [1, 1]]}},
      {"properties": {}, "geometry": {"type": "Point", "coordinates": [0, 0]}},
      {"properties": {}, "geometry": null},
      {"properties": {"kind": "structure"}, "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0]]}},
      {"properties": {"kind": "rejected"}, "geometry": {"type": "Point", "coordinates": [0, 0]}})");
  ASSERT_EQ(truth.scene.size(), 2u);
  EXPECT_EQ(truth.scene[0].outline_m.size(), 3u);
  EXPECT_TRUE(truth.scene[1].isOpen());
  EXPECT_THAT(truth.warnings, ElementsAre(HasSubstr("scene.geojson: feature 2: a line that is not closed"),
                                          HasSubstr("feature 3: a Point has no area"),
                                          HasSubstr("feature 4: has no geometry")));
}

}  // namespace
}  // namespace omnifleet::dataset
