// The stage on external images. Skipped where they are missing.

#include <gtest/gtest.h>

#include <cmath>

#include "dataset/frame_source.h"
#include "local_mapper/local_mapper.h"
#include "tests/test_data.h"
#include "tests/unit/services/local_mapper/silhouette_truth.h"

namespace omnifleet::local_mapper {
namespace {

TEST(Recordings, FindsAllObjectsOfRenderedSampleAndNoOthers) {
  OMNIFLEET_NEEDS_DATA(folder, "rendered_sample");
  const auto data = dataset::Dataset::open(folder);
  const auto truth = dataset::GroundTruth::load(folder);
  double contact_px = 0, top_px = 0;
  int contact_n = 0, top_n = 0, frames = 0;
  for (const auto& robot : data.robots) {
    const lens::Camera camera(robot.fisheye->camera);
    LocalMapper mapper(camera, {});
    const auto source = dataset::openStream(*robot.fisheye, dataset::Colour::kBgr);
    Frame frame;
    dataset::FrameInfo info;
    while (source->next(frame.image, info)) {
      frame.acquired_ns = info.time_ns;
      frame.sequence = info.sequence;
      const LocalMap& map = mapper.process(frame, {});
      ASSERT_EQ(map.state, FrameState::kOk);
      ++frames;
      const auto objects = testing::trueObjects(data, truth, robot.name, info.time_ns, camera);
      const auto matches = testing::match(objects, map.objects);
      std::vector<int> uses(map.objects.size(), 0);
      for (std::size_t i = 0; i < objects.size(); ++i) {
        if (matches[i] >= 0) ++uses[static_cast<std::size_t>(matches[i])];
        if (objects[i].contact_m <= 2.0) {
          EXPECT_GE(matches[i], 0) << robot.name << " " << info.sequence << " " << objects[i].name;
        }
      }
      for (std::size_t k = 0; k < uses.size(); ++k)
        EXPECT_GE(uses[k], 1) << "false object in " << robot.name << " " << info.sequence;
      for (std::size_t i = 0; i < objects.size(); ++i) {
        if (matches[i] < 0 || uses[static_cast<std::size_t>(matches[i])] != 1) continue;
        const auto& seen = map.objects[static_cast<std::size_t>(matches[i])];
        if (seen.solidity < 0.94 || seen.truncated) continue;
        for (const auto& e : testing::supportErrors(objects[i], seen, camera)) {
          (e.far_side ? top_px : contact_px) += e.pixels;
          ++(e.far_side ? top_n : contact_n);
        }
      }
    }
  }
  EXPECT_EQ(frames, 51);
  ASSERT_GT(contact_n, 5000);
  // Required accuracy of outlines.
  EXPECT_NEAR(contact_px / contact_n, 0.0, 0.1);
  EXPECT_NEAR(top_px / top_n, 0.0, 0.2);
}

class RealTable : public ::testing::TestWithParam<std::pair<std::string, std::vector<cv::Point>>> {};

/// Each block of real_table as seen by eye, given by a pixel on it. The bare grid must be floor.
TEST_P(RealTable, FindsBlocksAndTakesBareGridForFloor) {
  const auto& [file, blocks] = GetParam();
  OMNIFLEET_NEEDS_DATA(folder, "fisheye_downward/real_table");
  lens::CameraModel model;
  model.projection = lens::Projection::kOcam;
  model.image_width_px = 1920;
  model.image_height_px = 1080;
  model.focal_px = {368.4018, 368.4018};
  model.principal_point_px = {963.6545, 532.8951};
  model.fov_deg = 180.0;
  model.distortion = {
      -368.4018, 0,     0.001229407337764, -1.541328325870701e-06, 3.209246532312631e-09, 1.0002,
      -0.0101,   0.0095};
  model.position_m = {0, 0, 0.5};  // unknown; only the image is evaluated here
  Options options;
  options.view.seed_rectangle_px = {800, 200, 350, 350};
  options.view.min_depression_deg = 5.0;
  options.silhouette.min_area_px = 200;
  options.ground.line_width_m = 0.012;
  options.ground.max_line_px = 15;
  LocalMapper mapper(lens::Camera(model), options);
  Frame frame;
  std::vector<unsigned char> buffer;
  std::string note;
  ASSERT_EQ(dataset::decodeImage(folder + "/" + file, dataset::Colour::kBgr, {1920, 1080}, buffer,
                                 frame.image, note),
            FrameState::kOk);
  ASSERT_EQ(mapper.process(frame, {}).state, FrameState::kOk);
  const auto blobAt = [&](const cv::Point& p) {
    for (const auto& blob : mapper.connectedBlobs())
      for (const auto& run : blob.runs)
        if (run.row == p.y && p.x >= run.begin && p.x < run.end) return blob.label;
    return 0;
  };
  for (const auto& block : blocks) EXPECT_GT(blobAt(block), 0) << block;
  // The part of the grid that is bare in every image.
  int covered = 0;
  for (const auto& blob : mapper.connectedBlobs())
    for (const auto& run : blob.runs)
      if (run.row >= 420 && run.row < 500)
        covered += std::max(0, std::min(run.end, 1180) - std::max(run.begin, 820));
  EXPECT_EQ(covered, 0);
}

INSTANTIATE_TEST_SUITE_P(
    Photographs, RealTable,
    ::testing::Values(
        std::make_pair("real_02.jpg", std::vector<cv::Point>{{1157, 248}}),
        std::make_pair("real_03.jpg", std::vector<cv::Point>{{1140, 320}, {1160, 178}, {1098, 66}}),
        std::make_pair("real_04.jpg", std::vector<cv::Point>{{890, 195}}),
        std::make_pair("real_11.jpg",
                       std::vector<cv::Point>{{745, 165}, {825, 160}, {900, 130}, {980, 145}, {1050, 157}}),
        std::make_pair("real_12.jpg", std::vector<cv::Point>{{890, 190}, {925, 190}})));

}  // namespace
}  // namespace omnifleet::local_mapper
