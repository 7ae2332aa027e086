// What the round edge of an image says about a lens: right lenses are silent, wrong ones are named.

#include "local_mapper/lens_verdict.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dataset/dataset.h"
#include "dataset/frame_source.h"
#include "local_mapper/messages.h"
#include "tests/test_data.h"

namespace omnifleet::local_mapper {
namespace {

/// A lens of 960×600 px; `fov_deg` 0: not stated.
lens::CameraModel lensOf(const std::string& projection, double focal_px, double fov_deg,
                         const std::string& distortion = "", const Eigen::Vector2d& centre_px = {480, 300}) {
  const test::TempFolder folder;
  std::ofstream file(folder / "sensor.yaml");
  file << fmt::format(
      "camera_model: {}\nprojection: {}\nimage_width: 960\nimage_height: 600\nfocal_px: {}\n"
      "principal_point_px: [{}, {}]\ndistortion: [{}]\nposition_m: [0, 0, 0.5]\n",
      projection == "pinhole" ? "pinhole" : "fisheye", projection, focal_px, centre_px.x(), centre_px.y(),
      distortion);
  if (fov_deg > 0.0) file << "fov_deg: " << fov_deg << "\n";
  file.close();
  return lens::CameraModel::load(folder / "sensor.yaml");
}

lens::CameraModel reloaded(const lens::CameraModel& model) {
  const test::TempFolder folder;
  std::ofstream(folder / "sensor.yaml") << model.toYaml();
  return lens::CameraModel::load(folder / "sensor.yaml");
}

constexpr const char* kKannala = "0.013, 0.003, -0.006, 0.001";
constexpr double kFocal_px = 230.0, kView_deg = 185.0;

/// The circle at which a lens of 185° with the terms above ends: r = f (θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹).
ImageCircle trueCircle(const Eigen::Vector2d& centre_px = {480, 300}) {
  const double t = 0.5 * kView_deg * M_PI / 180.0;
  ImageCircle circle;
  circle.centre_px = centre_px;
  circle.radius_px = kFocal_px * (t + 0.013 * std::pow(t, 3) + 0.003 * std::pow(t, 5) -
                                  0.006 * std::pow(t, 7) + 0.001 * std::pow(t, 9));
  circle.centre_sigma_px = circle.radius_sigma_px = 0.1;
  return circle;
}

Contradiction against(const lens::CameraModel& model, const ImageCircle& circle = trueCircle()) {
  return judgeLens(circle, model, {}).contradiction;
}

TEST(LensVerdict, IsSilentAboutTheRightLens) {
  for (const double fov_deg : {0.0, 185.0, 170.0}) {  // not stated, true, less than the lens shows
    const lens::CameraModel model = lensOf("kannala_brandt", kFocal_px, fov_deg, kKannala);
    const LensVerdict verdict = judgeLens(trueCircle(), model, {});
    EXPECT_EQ(verdict.contradiction, Contradiction::kNone) << fov_deg;
    EXPECT_NEAR(verdict.view_deg, kView_deg, 0.1) << fov_deg;
    EXPECT_EQ(verdict.states_view, fov_deg > 0.0);
  }
  // An error of 5 % or a field stop that is 5 % off centre is no wrong lens.
  EXPECT_EQ(against(lensOf("kannala_brandt", 1.05 * kFocal_px, 185.0, kKannala)), Contradiction::kNone);
  EXPECT_EQ(against(lensOf("kannala_brandt", kFocal_px, 0.0, kKannala), trueCircle({498, 300})),
            Contradiction::kNone);
}

/// The recorder writes the widest field of view that CameraModel::read assumed. It is still not stated.
TEST(LensVerdict, IsSilentAboutARecordingOfALensWithoutStatedView) {
  const lens::CameraModel model = reloaded(lensOf("kannala_brandt", kFocal_px, 0.0, kKannala));
  EXPECT_FALSE(judgeLens(trueCircle(), model, {}).states_view);
  EXPECT_EQ(against(model), Contradiction::kNone);
}

TEST(LensVerdict, IsSilentAboutEveryProjection) {
  const double half = 0.5 * kView_deg * M_PI / 180.0;
  const std::vector<std::pair<const char*, double>> ends = {{"equidistant", half},
                                                            {"equisolid", 2.0 * std::sin(0.5 * half)},
                                                            {"stereographic", 2.0 * std::tan(0.5 * half)},
                                                            {"orthographic", 1.0}};
  for (const auto& [projection, end] : ends) {
    ImageCircle circle = trueCircle();
    circle.radius_px = 200.0 * end;
    for (const double fov_deg : {0.0, 180.0})
      EXPECT_EQ(against(lensOf(projection, 200.0, fov_deg), circle), Contradiction::kNone) << projection;
  }
}

/// A polynomial fitted to the inner 160° only turns back inside the circle: it describes what it was fitted
/// to.
TEST(LensVerdict, ContinuesAModelThatEndsInsideTheCircle) {
  const lens::CameraModel model = lensOf("kannala_brandt", kFocal_px, 0.0, "0.02, 0.01, -0.0235, 0");
  ASSERT_GT(model.fov_deg, 160.0);
  ASSERT_LT(model.fov_deg, 180.0);
  const LensVerdict verdict = judgeLens(trueCircle(), model, {});
  EXPECT_EQ(verdict.contradiction, Contradiction::kNone);
  EXPECT_NEAR(verdict.view_deg, kView_deg, 20.0);
  // With half the focal length it would have to continue to twice the angle.
  EXPECT_EQ(against(lensOf("kannala_brandt", 0.5 * kFocal_px, 0.0, "0.02, 0.01, -0.0235, 0")),
            Contradiction::kTooWide);
}

TEST(LensVerdict, NamesAWrongFocalLength) {
  EXPECT_EQ(against(lensOf("kannala_brandt", 2.0 * kFocal_px, 185.0, kKannala)), Contradiction::kStated);
  EXPECT_EQ(against(lensOf("kannala_brandt", 2.0 * kFocal_px, 0.0, kKannala)), Contradiction::kTooNarrow);
  for (const double fov_deg : {0.0, 185.0})
    EXPECT_EQ(against(lensOf("kannala_brandt", 0.5 * kFocal_px, fov_deg, kKannala)), Contradiction::kTooWide);
}

TEST(LensVerdict, NamesAWrongProjection) {
  ImageCircle circle = trueCircle();
  circle.radius_px = 150.0 * 2.0 * std::sin(M_PI / 4.0);
  EXPECT_EQ(against(lensOf("equidistant", 150.0, 180.0), circle), Contradiction::kStated);
}

/// The user who states the view decides: a mask in front of a lens makes a narrow round image.
TEST(LensVerdict, BelievesAStatedUnusualView) {
  ImageCircle circle = trueCircle();
  circle.radius_px = 250.0;  // 2·250/300 rad = 95.5°
  EXPECT_EQ(against(lensOf("equidistant", 300.0, 0.0), circle), Contradiction::kTooNarrow);
  EXPECT_EQ(against(lensOf("equidistant", 300.0, 95.0), circle), Contradiction::kNone);
  circle.radius_px = 260.0;  // 2·260/100 rad = 298°
  EXPECT_EQ(against(lensOf("equidistant", 100.0, 0.0), circle), Contradiction::kTooWide);
  EXPECT_EQ(against(lensOf("equidistant", 100.0, 298.0), circle), Contradiction::kNone);
}

TEST(LensVerdict, NamesExchangedNumbers) {
  EXPECT_EQ(against(lensOf("kannala_brandt", kFocal_px, 0.0, kKannala, {300, 480})), Contradiction::kCentre);
  EXPECT_EQ(against(lensOf("kannala_brandt", kFocal_px, 185.0, kKannala, {300, 480})),
            Contradiction::kCentre);
  EXPECT_EQ(against(lensOf("kannala_brandt", 390.0, 0.0, kKannala, {230, 230})), Contradiction::kCentre);
}

/// A centre that is known to a few pixels only contradicts nothing.
TEST(LensVerdict, DoubtsAnUncertainCentre) {
  ImageCircle circle = trueCircle({525, 300});
  const lens::CameraModel model = lensOf("kannala_brandt", kFocal_px, 0.0, kKannala);
  EXPECT_EQ(against(model, circle), Contradiction::kCentre);
  circle.centre_sigma_px = 5.0;
  EXPECT_EQ(against(model, circle), Contradiction::kNone);
}

/// The commonest mistake: the file of a fisheye lens that is read as pinhole.
TEST(LensVerdict, KnowsThatAPinholeCameraHasNoRoundImage) {
  EXPECT_EQ(against(lensOf("pinhole", kFocal_px, 0.0)), Contradiction::kNoEdge);
}

/// Case 10: the lens of the other camera of a chain. Its principal point is 14 px off, 3.8 % of the radius,
/// and the image ends at 200° instead of 185°. Both occur with right lenses; the log says both.
TEST(LensVerdict, LeavesAPlausibleLensToTheUser) {
  const LensVerdict verdict =
      judgeLens(trueCircle(), lensOf("kannala_brandt", 200.0, 0.0, "0.02, 0, 0, 0", {470, 310}), {});
  EXPECT_EQ(verdict.contradiction, Contradiction::kNone);
  EXPECT_NEAR(verdict.centre_off_px, std::hypot(10.0, 10.0), 1e-9);
  const std::string line = imageEnd("r1/fisheye", verdict);
  EXPECT_NE(line.find("14.1 px off the principal point"), std::string::npos) << line;
  EXPECT_NE(line.find(fmt::format("a view of {:.1f}°", verdict.view_deg)), std::string::npos) << line;
}

TEST(LensCheck, DecidesOnceInTheFirstFrames) {
  const lens::CameraModel model = lensOf("pinhole", kFocal_px, 0.0);
  cv::Mat dark(600, 960, CV_8UC3, cv::Scalar::all(3)), lit = dark.clone(), small = dark(cv::Rect(0, 0, 9, 9));
  cv::circle(lit, {480, 300}, 280, cv::Scalar::all(120), cv::FILLED);
  ImageCircleOptions options;
  options.frames = 3;
  LensCheck check(model, options), late(model, options);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(check.examine(small)) << "a frame of another size does not count";
  EXPECT_FALSE(check.examine(dark));
  EXPECT_TRUE(check.examine(lit));
  EXPECT_FALSE(check.examine(lit));
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(late.examine(dark));
  EXPECT_FALSE(late.examine(lit));
}

/// The same lens without a stated field of view.
lens::CameraModel withoutStatedView(lens::CameraModel model) {
  const test::TempFolder folder;
  std::string text = model.toYaml();
  const std::size_t key = text.find("fov_deg:");
  text.erase(key, text.find('\n', key) - key + 1);
  std::ofstream(folder / "sensor.yaml") << text;
  return lens::CameraModel::load(folder / "sensor.yaml");
}

using Changed = std::pair<Contradiction, lens::CameraModel>;

/// Wrong versions of a fisheye lens whose image ends inside the sensor, and how each contradicts.
std::vector<Changed> wrongLenses(const lens::CameraModel& right) {
  std::vector<Changed> wrong(4, {Contradiction::kNone, right});
  wrong[0].first = Contradiction::kCentre;
  wrong[0].second.principal_point_px = {right.principal_point_px.x() - 60.0, right.principal_point_px.y()};
  wrong[1].first = Contradiction::kTooNarrow;
  wrong[1].second.focal_px *= 2.0;
  wrong[2].first = Contradiction::kTooWide;
  wrong[2].second.focal_px *= 0.5;
  wrong[3].first = Contradiction::kNoEdge;
  wrong[3].second.kind = lens::CameraKind::kPinhole;
  wrong[3].second.projection = lens::Projection::kPinhole;
  return wrong;
}

class RecordedLens : public ::testing::TestWithParam<const char*> {};

TEST_P(RecordedLens, IsRightAndWrongVersionsAreNamed) {
  OMNIFLEET_NEEDS_DATA(folder, GetParam());
  for (const auto& robot : dataset::Dataset::open(folder).robots) {
    const lens::CameraModel& stated = robot.fisheye->camera;
    const lens::CameraModel right = withoutStatedView(stated);
    const auto source = dataset::openStream(*robot.fisheye, dataset::Colour::kBgr);
    cv::Mat image;
    dataset::FrameInfo info;
    for (int i = 0; i < 10 && source->next(image, info); ++i) {
      const auto circle = findImageCircle(image, {});
      ASSERT_TRUE(circle) << robot.name;
      EXPECT_EQ(against(stated, *circle), Contradiction::kNone) << robot.name;
      EXPECT_EQ(against(right, *circle), Contradiction::kNone) << robot.name;
      EXPECT_NEAR(viewAtCircle(*circle, right), stated.fov_deg, 1.0) << robot.name;
      for (const auto& [how, lens] : wrongLenses(right))
        EXPECT_EQ(against(withoutStatedView(lens), *circle), how) << robot.name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(LensVerdict, RecordedLens, ::testing::Values("rendered_sample", "room_sample"));

/// Images of another renderer, and of a real camera whose lens is that of another copy of the same rig.
TEST(LensVerdict, IsSilentAboutTheLensesOfForeignImages) {
  OMNIFLEET_NEEDS_DATA(folder, "fisheye_downward");
  lens::CameraModel model;
  model.projection = lens::Projection::kOcam;
  model.image_width_px = model.image_height_px = 1920;
  model.principal_point_px = {959.5975, 959.6058};
  model.distortion = {-611.6546, 0, 5.8327e-04, -1.2432e-07, 2.1582e-10, 0.9998, 2.0141e-04, -2.1536e-04};
  const lens::CameraModel rendered = withoutStatedView(model);
  model.image_height_px = 1080;
  model.principal_point_px = {963.6545, 532.8951};
  model.distortion = {
      -368.4018, 0,     0.001229407337764, -1.541328325870701e-06, 3.209246532312631e-09, 1.0002,
      -0.0101,   0.0095};
  const lens::CameraModel real = withoutStatedView(model);
  int circles = 0;
  for (const char* part : {"real_table", "sim_calib_chess", "sim_two_pose"}) {
    for (const auto& entry : std::filesystem::directory_iterator(folder + "/" + part)) {
      const cv::Mat image = cv::imread(entry.path().string());
      const auto circle = image.empty() ? std::nullopt : findImageCircle(image, {});
      if (!circle) continue;  // a rim without contrast
      ++circles;
      EXPECT_EQ(against(image.rows == 1080 ? real : rendered, *circle), Contradiction::kNone) << entry.path();
    }
  }
  EXPECT_GE(circles, 15);
}

}  // namespace
}  // namespace omnifleet::local_mapper
