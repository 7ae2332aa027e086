#include "local_mapper/local_mapper.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "local_mapper/debug_images.h"
#include "tests/unit/services/local_mapper/fisheye_scene.h"
#include "tests/unit/services/local_mapper/silhouette_truth.h"

namespace omnifleet::local_mapper {
namespace {

using testing::box;
using testing::Prism;

class LocalMapperTest : public ::testing::Test {
 protected:
  LocalMapperTest() : camera_(testing::fisheyeModel()) {
    scene_.prisms = {{box(0.9, 0.1, 0.2, 0.15, 0.4), 0.12, {40, 40, 200}},
                     {box(-0.6, 0.9, 0.15, 0.15, 0.1), 0.2, {45, 45, 45}},
                     {circlePolygon({0.1, -1.2}, 0.1, 48), 0.15, {60, 190, 60}},
                     {box(-1.6, -0.7, 0.2, 0.2, 0.0), 0.1, {210, 130, 40}}};
  }
  testing::TrueObject truthOf(const Prism& prism, const Pose2& world_from_base) const {
    testing::TrueObject truth;
    for (const auto& p : prism.footprint_m) truth.floor_m.push_back(world_from_base.inverse() * p);
    truth.silhouette_m =
        testing::prismSilhouette(truth.floor_m, prism.height_m, camera_.foot(), camera_.height());
    return truth;
  }
  static Motion motion(const Pose2& previous_from_current) {
    Motion m;
    m.valid = true;
    m.previous_from_current = previous_from_current;
    return m;
  }

  lens::Camera camera_;
  testing::Scene scene_;
};

TEST_F(LocalMapperTest, MeasuresSilhouettesWithSubpixelError) {
  LocalMapper mapper(camera_, {});
  const Pose2 pose{0.02, -0.03, 0.2};
  const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, pose), 0), {});
  ASSERT_EQ(map.state, FrameState::kOk);
  ASSERT_EQ(map.objects.size(), scene_.prisms.size());
  std::vector<testing::TrueObject> truth;
  for (const auto& prism : scene_.prisms) truth.push_back(truthOf(prism, pose));
  const auto matches = testing::match(truth, map.objects);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    ASSERT_GE(matches[i], 0);
    const auto& seen = map.objects[static_cast<std::size_t>(matches[i])];
    double mean = 0, square = 0;
    const auto errors = testing::supportErrors(truth[i], seen, camera_);
    EXPECT_EQ(errors.size(), static_cast<std::size_t>(SupportFunction::kDirections));
    for (const auto& e : errors) {
      mean += e.pixels / static_cast<double>(errors.size());
      square += e.pixels * e.pixels / static_cast<double>(errors.size());
    }
    // Corners are blunted, and the maximum exaggerates smooth outlines; each within two tenths of a pixel.
    EXPECT_NEAR(mean, 0.0, 0.2) << i;
    EXPECT_LT(std::sqrt(square), 0.4) << i;  // the σ of the support values
    EXPECT_FALSE(seen.truncated);
    EXPECT_GT(seen.solidity, 0.94);
    double contact = 1e9;
    for (const auto& p : truth[i].silhouette_m) contact = std::min(contact, p.norm());
    EXPECT_LE(seen.contact_m.norm(), contact + 0.01);
    EXPECT_TRUE(contains(seen.hull_m, seen.centroid_m));
  }
}

TEST_F(LocalMapperTest, EndsScanAtObjectsAndLabelsThem) {
  LocalMapper mapper(camera_, {});
  const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {});
  ASSERT_EQ(map.scan.range_m.size(), 360U);
  const auto truth = truthOf(scene_.prisms[2], {});
  const double bearing = std::atan2(-1.2, 0.1);
  const auto i = static_cast<std::size_t>(std::lround((bearing + 2 * M_PI) * 180.0 / M_PI));
  EXPECT_EQ(map.scan.label[i], RayLabel::kUnknown);
  EXPECT_NEAR(map.scan.range_m[i], std::hypot(0.1, 1.2) - 0.1, 0.012);
  ASSERT_GT(map.scan.object[i], 0);
  EXPECT_EQ(map.objects[map.scan.object[i] - 1U].label, map.scan.object[i]);
  EXPECT_EQ(map.scan.label[45], RayLabel::kFloorEnd);
}

/// One region closes around the robot: the scan ends at its near side, and it is no object.
TEST_F(LocalMapperTest, EndsScanAtWallsOfRoom) {
  scene_.prisms.clear();
  for (int side = 0; side < 4; ++side) {
    const double turn = 0.5 * M_PI * side;
    scene_.prisms.push_back(
        {box(1.3 * std::cos(turn), 1.3 * std::sin(turn), 0.1, 2.7, turn), 0.25, {60, 90, 190}});
  }
  LocalMapper mapper(camera_, {});
  const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {});
  ASSERT_EQ(map.state, FrameState::kOk);
  EXPECT_TRUE(map.objects.empty());
  for (std::size_t i = 0; i < 360; ++i) {
    const double bearing = static_cast<double>(i) * M_PI / 180.0;
    const double wall_m = 1.25 / std::max(std::abs(std::cos(bearing)), std::abs(std::sin(bearing)));
    EXPECT_EQ(map.scan.label[i], RayLabel::kObstacle) << i;
    EXPECT_NEAR(map.scan.range_m[i], wall_m, 0.04) << i;  // pixel rounding: 1 to 3 cm
  }
  EXPECT_NEAR(mapper.freeShare(), 0.55, 0.05);
}

/// Plaster as light as the floor: only its texture distinguishes it.
TEST_F(LocalMapperTest, EndsScanAtWallsOfCoarserTexture) {
  scene_.prisms.clear();
  const cv::Mat3b bare = testing::renderScene(scene_, camera_, {});
  for (int side = 0; side < 4; ++side) {
    const double turn = 0.5 * M_PI * side;
    scene_.prisms.push_back(
        {box(1.3 * std::cos(turn), 1.3 * std::sin(turn), 0.1, 2.7, turn), 0.25, {255, 0, 255}});
  }
  const cv::Mat3b marked = testing::renderScene(scene_, camera_, {});
  const cv::Vec3b floor = bare(cvRound(camera_.model().principal_point_px.y()),
                               cvRound(camera_.model().principal_point_px.x()) + 130);
  cv::Mat3b image = bare.clone();
  cv::Mat1f plaster(image.rows / 4, image.cols / 4);
  cv::theRNG().state = 5;
  cv::randn(plaster, 1.0, 0.1);
  cv::resize(plaster, plaster, image.size());
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      if (marked(y, x)[1] < 20) image(y, x) = cv::Vec3b(cv::Vec3f(floor) * plaster(y, x));
  LocalMapper mapper(camera_, {});
  const LocalMap& map = mapper.process(testing::frameOf(image, 0), {});
  ASSERT_EQ(map.state, FrameState::kOk);
  int beyond = 0, short_of = 0;
  for (std::size_t i = 0; i < 360; ++i) {
    const double bearing = static_cast<double>(i) * M_PI / 180.0;
    const double wall_m = 1.25 / std::max(std::abs(std::cos(bearing)), std::abs(std::sin(bearing)));
    beyond += map.scan.range_m[i] > wall_m + 0.1 ? 1 : 0;
    short_of += map.scan.range_m[i] < wall_m - 0.2 ? 1 : 0;
  }
  EXPECT_LT(beyond, 18);
  EXPECT_LT(short_of, 18);
}

TEST_F(LocalMapperTest, ReportsLittleFreeFloorForUnmaskedBody) {
  cv::Mat3b image = testing::renderScene(scene_, camera_, {});
  const Eigen::Vector2d& middle = camera_.model().principal_point_px;
  cv::circle(image, {cvRound(middle.x()), cvRound(middle.y())}, 95, cv::Scalar(40, 40, 45), cv::FILLED);
  lens::CameraModel unmasked = camera_.model();
  unmasked.self_mask_radius_px = 0.0;
  LocalMapper seeing(camera_, {}), blind(lens::Camera(unmasked), {});
  ASSERT_EQ(seeing.process(testing::frameOf(image, 0), {}).state, FrameState::kOk);
  EXPECT_GT(seeing.freeShare(), 0.9);
  ASSERT_EQ(blind.process(testing::frameOf(image, 0), {}).state, FrameState::kOk);
  EXPECT_LT(blind.freeShare(), 0.2);
}

/// Tape of 5 cm across the lines of sight, along one and oblique; the rays continue over it.
TEST_F(LocalMapperTest, IgnoresLinesOnTheFloor) {
  scene_.prisms.pop_back();
  scene_.prisms.push_back({box(-0.6, -0.2, 0.05, 1.0, 0.1), 0.001, {40, 200, 220}});
  scene_.prisms.push_back({box(0.45, -0.55, 0.7, 0.05, -0.885), 0.001, {40, 200, 220}});
  scene_.prisms.push_back({box(0.25, 0.75, 0.6, 0.05, 0.4), 0.001, {40, 200, 220}});
  LocalMapper mapper(camera_, {});
  const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {});
  ASSERT_EQ(map.state, FrameState::kOk);
  EXPECT_EQ(map.objects.size(), 3U);
  for (const std::size_t bearing : {190U, 310U, 70U}) {
    EXPECT_EQ(map.scan.label[bearing], RayLabel::kFloorEnd) << bearing;
    EXPECT_GT(map.scan.range_m[bearing], 1.2) << bearing;
  }
}

/// As thin and long as tape, but upright. Across the lines of sight the far side shows the height; along one
/// the upright sides diverge.
TEST_F(LocalMapperTest, KeepsThinWallsAndPostsAsObjects) {
  scene_.prisms = {{box(-0.8, 0.0, 0.05, 0.6, 0.0), 0.15, {40, 200, 220}},
                   {box(0.55, 0.0, 0.05, 0.05, 0.0), 0.25, {40, 200, 220}},
                   {box(0.0, 0.65, 0.05, 0.3, 0.0), 0.25, {40, 200, 220}},
                   {box(0.4, -0.7, 0.6, 0.05, 0.3), 0.12, {40, 200, 220}}};
  LocalMapper mapper(camera_, {});
  const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {});
  ASSERT_EQ(map.state, FrameState::kOk);
  EXPECT_EQ(map.objects.size(), scene_.prisms.size());
}

TEST_F(LocalMapperTest, EstimatesHeightsFromVectors) {
  LocalMapper mapper(camera_, {});
  const Pose2 before{0, 0, 0}, step{0.05, 0.0, 0.02}, after = before * step;
  mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, before), 0), {});
  const LocalMap& map =
      mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, after), 1), motion(step));
  std::vector<testing::TrueObject> truth;
  for (const auto& prism : scene_.prisms) truth.push_back(truthOf(prism, after));
  const auto matches = testing::match(truth, map.objects);
  int vectors = 0;
  for (std::size_t i = 0; i < 3; ++i) {  // the fourth is too far for its vectors
    ASSERT_GE(matches[i], 0);
    const auto& seen = map.objects[static_cast<std::size_t>(matches[i])];
    vectors += static_cast<int>(seen.vectors.size());
    if (seen.vectors.size() < 4) continue;
    EXPECT_NEAR(seen.height_m, scene_.prisms[i].height_m, 0.05) << i;
  }
  EXPECT_GE(vectors, 12);
}

TEST_F(LocalMapperTest, ComputesNoVectorsAcrossGapsAndBadFrames) {
  const cv::Mat3b image = testing::renderScene(scene_, camera_, {});
  const auto vectorsOf = [](const LocalMap& map) {
    std::size_t n = 0;
    for (const auto& o : map.objects) n += o.vectors.size();
    return n;
  };
  LocalMapper mapper(camera_, {});
  EXPECT_EQ(vectorsOf(mapper.process(testing::frameOf(image, 0), {})), 0U);
  EXPECT_GT(vectorsOf(mapper.process(testing::frameOf(image, 1), motion({}))), 0U);
  EXPECT_EQ(vectorsOf(mapper.process(testing::frameOf(image, 4), motion({}))), 0U);
  const LocalMap& doubled = mapper.process(testing::frameOf(image, 4), motion({}));
  EXPECT_EQ(doubled.state, FrameState::kOutOfOrder);
  EXPECT_TRUE(doubled.objects.empty());
  EXPECT_TRUE(doubled.scan.range_m.empty());
  EXPECT_EQ(vectorsOf(mapper.process(testing::frameOf(image, 5), motion({}))), 0U);
  EXPECT_EQ(mapper.process(testing::frameOf(image * 0.02, 6), {}).state, FrameState::kDark);
  EXPECT_EQ(vectorsOf(mapper.process(testing::frameOf(image, 7), motion({}))), 0U);
  EXPECT_GT(vectorsOf(mapper.process(testing::frameOf(image, 8), motion({}))), 0U);
}

TEST_F(LocalMapperTest, GivesEqualMapsForEqualFrames) {
  const cv::Mat3b image = testing::renderScene(scene_, camera_, {});
  LocalMapper a(camera_, {}), b(camera_, {});
  b.process(testing::frameOf(testing::renderScene({}, camera_, {}), 0), {});
  const LocalMap first = a.process(testing::frameOf(image, 1), {});
  const LocalMap& second = b.process(testing::frameOf(image, 1), {});
  ASSERT_EQ(first.objects.size(), second.objects.size());
  for (std::size_t i = 0; i < first.objects.size(); ++i)
    EXPECT_EQ(first.objects[i].supports.b_m, second.objects[i].supports.b_m);
  EXPECT_EQ(first.scan.range_m, second.scan.range_m);
}

TEST_F(LocalMapperTest, ReportsRegionsThatMayBeObjectsOfFloorColour) {
  // A disc with a tenth less brightness and a sharp edge, at that distance ahead.
  LocalMapper mapper(camera_, {});
  scene_.prisms.clear();
  const auto undecided = [&](double distance_m) -> const std::vector<Eigen::Vector2d>& {
    cv::Mat3b image = testing::renderScene(scene_, camera_, {});
    const auto pixel = camera_.pixelFromPoint({distance_m, 0.0, 0.0});
    if (distance_m > 0)
      cv::circle(image, cv::Point2d(pixel->x(), pixel->y()), 14, {132, 141, 150}, cv::FILLED);
    mapper.process(testing::frameOf(image, 0), {});
    return mapper.undecided();
  };
  ASSERT_EQ(undecided(1.0).size(), 1U);
  const auto disc = camera_.pixelFromPoint({1.0, 0.0, 0.0});
  const auto begin = camera_.pixelFromPoint({undecided(1.0)[0].x(), undecided(1.0)[0].y(), 0.0});
  ASSERT_TRUE(disc && begin);
  EXPECT_NEAR((*begin - *disc).norm(), 14.0, 2.0) << "nearest point of its rim";
  EXPECT_TRUE(undecided(0.0).empty());
  EXPECT_TRUE(undecided(3.2).empty()) << "beyond the reach of objects";
}

/// A box enters the view of a narrow lens, at all angles. Each usable support value is that of the whole box,
/// not of the visible part.
TEST_F(LocalMapperTest, GivesSupportsOfWholeObjectAtEdgeOfView) {
  lens::CameraModel model = camera_.model();
  model.fov_deg = 140.0;
  const lens::Camera narrow(model);
  int cut = 0, given = 0;
  for (int k = 0; k < 24; ++k) {
    scene_.prisms = {{box(0.75 + 0.03 * k, 0.0, 0.24, 0.3, 0.27 * k), 0.16, {40, 40, 200}}};
    LocalMapper mapper(narrow, {});
    const Pose2 pose{0.0, 0.0, 0.4 * k};
    const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, narrow, pose), 0), {});
    if (map.objects.empty()) continue;  // a sliver
    ASSERT_EQ(map.objects.size(), 1U) << k;
    cut += map.objects[0].truncated ? 1 : 0;
    const auto expected =
        SupportFunction::of(truthOf(scene_.prisms[0], pose).silhouette_m, narrow.foot(), 1.0);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const float sigma = map.objects[0].supports.sigma_m[i];
      if (!(sigma > 0.0f)) continue;
      ++given;
      EXPECT_NEAR(map.objects[0].supports.b_m[i], expected.b_m[i], 4.0f * sigma) << k << ' ' << i;
    }
  }
  EXPECT_GE(cut, 15);
  EXPECT_GE(given, 300);
}

TEST_F(LocalMapperTest, MarksCutBlobAsTruncatedAndSkipsFarBlob) {
  scene_.prisms = {{box(0.42, 0.0, 0.2, 0.2, 0.0), 0.1, {40, 40, 200}},
                   {box(-2.4, 0.3, 0.3, 0.3, 0.0), 0.15, {45, 45, 45}}};
  Options options;
  options.silhouette.far_contact_m = 0.0;
  LocalMapper mapper(camera_, options);
  const LocalMap& map = mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {});
  ASSERT_EQ(map.objects.size(), 1U);
  EXPECT_TRUE(map.objects[0].truncated);
  int unusable = 0;
  for (const float sigma : map.objects[0].supports.sigma_m) unusable += sigma > 0 ? 0 : 1;
  EXPECT_GT(unusable, 0);
  EXPECT_LT(unusable, SupportFunction::kDirections);
  const std::size_t towards_far = 173;  // bearing of the far box: an obstacle of the scan, but no object
  EXPECT_EQ(map.scan.label[towards_far], RayLabel::kUnknown);
  EXPECT_EQ(map.scan.object[towards_far], 0);
}

TEST_F(LocalMapperTest, AcceptsOnlyClearShapesBeyondTwoMetres) {
  const auto objectsWith = [&](const Options& options) {
    LocalMapper mapper(camera_, options);
    return mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {}).objects.size();
  };
  Options without;
  without.silhouette.far_contact_m = 0.0;
  scene_.prisms = {{box(2.4, 0.1, 0.3, 0.3, 0.4), 0.2, {40, 40, 200}}};
  EXPECT_EQ(objectsWith({}), 1U);
  EXPECT_EQ(objectsWith(without), 0U);
  // A large ragged region, like a worn place of the floor: accepted only nearby.
  for (const double away : {2.15, 1.3}) {
    scene_.prisms = {{box(away, 0.1, 0.2, 1.2, 0.0), 0.01, {40, 40, 200}},
                     {box(away + 0.4, -0.4, 0.8, 0.2, 0.0), 0.01, {40, 40, 200}}};
    EXPECT_EQ(objectsWith({}) > 0, away < 2.0) << away;
  }
  scene_.prisms = {{box(3.4, 0.1, 0.3, 0.3, 0.4), 0.2, {40, 40, 200}}};
  EXPECT_EQ(objectsWith({}), 0U);
}

TEST_F(LocalMapperTest, SkipsAndCountsPointsBeyondFOfEquationSeven) {
  Options options;
  options.lens.projection = "orthographic";
  // F is chosen so that the floor at 1 m is just beyond it: of four objects the near half of one remains.
  const Eigen::Vector2d at_1m = *camera_.pixelFromPoint({1.0, 0.0, 0.0});
  options.lens.focal_px = (at_1m - camera_.model().principal_point_px).norm();
  LocalMapper literal(camera_, options), calibrated(camera_, {});
  const cv::Mat3b image = testing::renderScene(scene_, camera_, {});
  for (std::uint32_t i = 0; i < 2; ++i) {
    const LocalMap& map = literal.process(testing::frameOf(image, i), motion({}));
    calibrated.process(testing::frameOf(image, i), motion({}));
    EXPECT_LT(map.objects.size(), scene_.prisms.size());
    for (const auto& object : map.objects) {
      for (const auto& p : object.hull_m) EXPECT_TRUE(p.allFinite());
      for (const float b : object.supports.b_m) EXPECT_TRUE(std::isfinite(b));
    }
  }
  EXPECT_GT(literal.rejectedPoints(), 100U);
  EXPECT_EQ(calibrated.rejectedPoints(), 0U);
}

TEST_F(LocalMapperTest, BuildsFeatureHullsFromEndsOfVectors) {
  Options options;
  options.silhouette.outline = "features";
  LocalMapper mapper(camera_, options);
  mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, {}), 0), {});
  const Pose2 step{0.05, 0.0, 0.02};
  const LocalMap& map =
      mapper.process(testing::frameOf(testing::renderScene(scene_, camera_, step), 1), motion(step));
  int checked = 0;
  for (const auto& object : map.objects) {
    if (object.vectors.size() < 3) {
      for (const float sigma : object.supports.sigma_m) EXPECT_LE(sigma, 0.0f);
      continue;
    }
    ++checked;
    std::vector<cv::Point2f> ends, hull;
    for (const auto& v : object.vectors) ends.emplace_back(v.to_m.x(), v.to_m.y());
    cv::convexHull(ends, hull);
    if (hull.size() < 3) continue;
    EXPECT_NEAR(signedArea(object.hull_m), cv::contourArea(hull), 1e-6) << object.label;
    for (std::size_t k = 0; k < object.supports.size(); ++k) {
      const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(object.supports.size());
      double b = -1e9;
      for (const auto& p : hull) b = std::max(b, p.x * std::cos(phi) + p.y * std::sin(phi));
      EXPECT_NEAR(object.supports.b_m[k], b, 1e-5);  // float precision
    }
  }
  EXPECT_GE(checked, 2);
}

TEST_F(LocalMapperTest, RendersObjectsInDebugImages) {
  LocalMapper mapper(camera_, {});
  const cv::Mat3b image = testing::renderScene(scene_, camera_, {});
  mapper.process(testing::frameOf(image, 0), {});
  const LocalMap& map = mapper.process(testing::frameOf(image, 1), motion({}));
  const auto pictures = DebugImages::render(mapper, map, image);
  EXPECT_EQ(pictures.labels.size(), image.size());
  cv::Mat1b changed;
  cv::inRange(pictures.labels != image, cv::Scalar(0, 0, 0), cv::Scalar(0, 0, 0), changed);
  EXPECT_GT(cv::countNonZero(changed == 0), 500);
  EXPECT_FALSE(pictures.local_map.empty());
  const std::string prefix = ::testing::TempDir() + "/local_mapper_debug";
  EXPECT_TRUE(pictures.save(prefix).empty());
  const auto problems = pictures.save("/nonexistent/folder/frame");
  ASSERT_EQ(problems.size(), 4U);
  EXPECT_NE(problems[0].find("/nonexistent/folder/frame_labels.png"), std::string::npos);
}

TEST(LocalMapperOptions, ReadsAllKeysAndChecksBounds) {
  const auto o =
      Options::read(options::Section::parse("{frame: {dark_level: 5}, view: {seed_ring_px: 30}, ground: "
                                            "{method: histogram}, connection: {method: rectangles},"
                                            " contour: {refine: false}, lens: {projection: orthographic},"
                                            " silhouette: {max_contact_m: 1.5, outline: features}, "
                                            "scan: {rays: 720}, flow: {sigma_px: 0.3}}",
                                            "t.yaml"));
  EXPECT_EQ(o.scan.rays, 720);
  EXPECT_EQ(o.ground.method, "histogram");
  EXPECT_EQ(o.lens.projection, "orthographic");
  EXPECT_EQ(o.silhouette.outline, "features");
  EXPECT_THROW(Options::read(options::Section::parse("{lens: {projection: pinhole}}", "t.yaml")),
               options::Error);
  EXPECT_THROW(Options::read(options::Section::parse("{scans: {}}", "t.yaml")), options::Error);
  EXPECT_THROW(Options::read(options::Section::parse("{scan: {rays: 1}}", "t.yaml")), options::Error);
  EXPECT_THROW(Options::read(options::Section::parse("{silhouette: {max_contact_m: far}}", "t.yaml")),
               options::Error);
}

/// A region connected to a dark object that resembles its shadow, except for its sharp outline and soft foot,
/// may be another object: no floor is visible through it. Floor is visible through shadows.
TEST_F(LocalMapperTest, EndsRaysAtPossibleFaceBesideObject) {
  scene_.prisms.clear();
  const cv::Rect face(300, 370, 50, 40), dark_object(340, 360, 60, 60);
  const Eigen::Vector2d behind = *camera_.floorFromPixel(Eigen::Vector2d(322, 408));
  const Eigen::Vector2d before = *camera_.floorFromPixel(Eigen::Vector2d(320, 370));
  for (const float foot_px : {14.0f, 1.0f}) {
    cv::Mat image = testing::renderScene(scene_, camera_, {});
    for (int y = 350; y < face.br().y; ++y) {
      const float depth = std::clamp((static_cast<float>(y - face.y) + 0.5f) / foot_px + 0.5f, 0.0f, 1.0f);
      for (int x = face.x; x < face.br().x; ++x) image.at<cv::Vec3b>(y, x) *= 1.0f - 0.4f * depth;
    }
    image(dark_object).setTo(cv::Scalar::all(15));
    LocalMapper mapper(camera_, {});
    const LocalMap& map = mapper.process(testing::frameOf(image, 0), {});
    ASSERT_EQ(map.state, FrameState::kOk);
    const Eigen::Vector2d to = behind - map.scan.origin_m;
    const auto rays = static_cast<double>(map.scan.range_m.size());
    const double turns = std::atan2(to.y(), to.x()) / (2.0 * M_PI);
    const auto ray = static_cast<std::size_t>(std::lround((turns + 1.0) * rays)) % map.scan.range_m.size();
    if (foot_px > 1.0f) {
      EXPECT_EQ(map.scan.label[ray], RayLabel::kUndecided);
      EXPECT_NEAR(map.scan.range_m[ray], (before - map.scan.origin_m).norm(), 0.05);
    } else {
      EXPECT_GT(map.scan.range_m[ray], to.norm());
    }
    EXPECT_TRUE(mapper.undecided().empty()) << "too many to be reported";
  }
}

}  // namespace
}  // namespace omnifleet::local_mapper
