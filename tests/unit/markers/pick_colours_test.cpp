// Picks the colours of painted markers and finds the robots with them.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "marker_scenes.h"
#include "markers/markers_run.h"

namespace omnifleet::markers {
namespace {

struct Painted {
  cv::Mat image;
  std::map<std::string, Pose2> truth;
  std::vector<Pick> picks;
};

Painted painted(const dataset::MarkerSet& set) {
  Painted p;
  Painter painter(ceilingCamera());
  double y = -0.6;
  for (const auto& [robot, unused] : set.robots) {
    const Pose2 pose{0.1, y += 0.35, 0.4};
    p.truth[robot] = pose;
    painter.robot(set, robot, pose);
    const auto add = [&, name = robot](const char* region, const Eigen::Vector2d& offset) {
      const Eigen::Vector2d at = pose * offset;
      const Eigen::Vector2d pixel = painter.camera.pixelFromPoint({at.x(), at.y(), set.height_m}).value();
      p.picks.push_back({name, region, {cvRound(pixel.x()), cvRound(pixel.y())}});
    };
    add("cover", {-0.005, 0.04});
    add("tail", set.tail_offset_m);
    add("head", set.head_offset_m);
  }
  Imaging imaging;
  imaging.gain = 0.8;
  imaging.noise = 4.0;
  p.image = painter.image(imaging);
  return p;
}

std::string errorOf(const std::vector<PickedRegion>& regions, dataset::MarkerSet set) {
  try {
    enterColours(regions, {}, set);
  } catch (const options::Error& error) {
    return error.what();
  }
  return "";
}

TEST(PickColours, WritesSetThatFindsTheRobots) {
  auto set = coverSet();
  const Painted scene = painted(set);
  std::vector<PickedRegion> regions;
  for (const Pick& pick : scene.picks) regions.push_back(pickRegion(scene.image, pick));
  for (auto& [robot, colours] : set.robots) colours = {};
  enterColours(regions, {}, set);
  for (const auto& [robot, colours] : coverSet().robots) {
    EXPECT_LT(chromaDistance(set.robots.at(robot).head, colours.head), 0.05) << robot;
    EXPECT_LT(chromaDistance(set.robots.at(robot).cover, colours.cover), 0.08) << robot;
  }
  const auto again = dataset::MarkerSet::read(options::Section::parse(set.toYaml(), "markers.yaml"));
  auto finder = MarkerFinder::make(lens::Camera(ceilingCamera()), again, {});
  const auto& found = finder->find(scene.image, 0);
  EXPECT_EQ(found.size(), 4U);
  for (const Detection& d : found)
    EXPECT_LT((d.map_from_base.translation() - scene.truth.at(d.robot).translation()).norm(), 0.001);
  const cv::Mat picture = pictureOf(scene.image, regions);
  EXPECT_EQ(picture.cols, 2 * scene.image.cols);
  if (std::getenv("OVERLAYS") != nullptr)
    cv::imwrite(std::string(std::getenv("OVERLAYS")) + "/picked.png", picture);
}

TEST(PickColours, NamesTheTwoColoursThatAreTooNear) {
  const auto set = coverSet();
  const Painted scene = painted(set);
  std::vector<PickedRegion> regions;
  for (const Pick& pick : scene.picks) regions.push_back(pickRegion(scene.image, pick));
  EXPECT_EQ(errorOf(regions, set), "");
  auto near = regions;
  near[2].rgb = {215, 66, 40};  // r1's head, 0.12 from the red of r2's tail
  EXPECT_THAT(errorOf(near, set),
              testing::AllOf(testing::HasSubstr("r1: head"), testing::HasSubstr("too near")));
  auto grey = regions;
  grey[0].rgb = {100, 102, 101};
  EXPECT_THAT(errorOf(grey, set), testing::HasSubstr("r1.cover_rgb"));
  regions.pop_back();
  EXPECT_THAT(errorOf(regions, set), testing::HasSubstr("r4: --head is missing"));
}

TEST(PickColours, RejectsUnusablePixels) {
  const cv::Mat image(480, 640, CV_8UC3, cv::Scalar(150, 160, 165));
  EXPECT_THROW(pickRegion(image, {"r1", "head", {640, 10}}), options::Error);
  EXPECT_THROW(pickRegion(image, {"r1", "head", {100, 10}}), options::Error);  // the floor
  EXPECT_EQ(pixelFromText("--head", "12,34"), cv::Point(12, 34));
  EXPECT_THROW(pixelFromText("--head", "12;34"), options::Error);
  EXPECT_THROW(pixelFromText("--head", "12,34,5"), options::Error);
}

}  // namespace
}  // namespace omnifleet::markers
