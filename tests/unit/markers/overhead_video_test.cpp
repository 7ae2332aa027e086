// A published ceiling video without ground truth. Parked robots must not move, ids must not change, and
// neither the yellow team nor the ball may be reported as a robot. A stick hides parts of the pushed robot in
// a dozen frames; an independent colour test decides where it is visible.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "markers/patch_finder.h"
#include "test_data.h"

namespace omnifleet::markers {
namespace {

constexpr int kGui_px = 95;

/// A camera 2 m above the field with 311 px/m at the height of the markers.
lens::CameraModel assumedCamera(int width, int height) {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = width;
  model.image_height_px = height;
  model.focal_px = {603.0, 603.0};
  model.principal_point_px = {0.5 * (width - 1), 0.5 * (height - 1)};
  model.position_m = {0.0, 0.0, 2.0};
  return model;
}

/// A robot with a light-blue patch.
struct Robot {
  std::string name;
  int low_hue, high_hue;          ///< of the individual patch, OpenCV
  cv::Rect place;                 ///< of a robot that never moves; empty: anywhere else
  std::vector<cv::Range> parked;  ///< frames in which it stands, by inspection of the video
};
const std::vector<Robot>& robots() {
  static const std::vector<Robot> kRobots{
      {"green", 50, 75, {}, {{0, 136}, {260, 366}, {410, 502}}},
      {"pink", 165, 180, {100, 340, 60, 60}, {{0, 502}}},
      {"red", 165, 180, {0, 200, 35, 50}, {{0, 502}}},  // half of its red patch is outside of the image
  };
  return kRobots;
}

/// Pixels of a hue. Independent of the code under test.
cv::Mat1b pixelsOf(const cv::Mat& hsv, int low_hue, int high_hue) {
  cv::Mat1b mask;
  cv::inRange(hsv, cv::Scalar(low_hue, 90, 100), cv::Scalar(high_hue, 255, 255), mask);
  return mask;
}
cv::Mat1b bluePixels(const cv::Mat& hsv) {
  cv::Mat1b mask;
  cv::inRange(hsv, cv::Scalar(95, 60, 140), cv::Scalar(122, 255, 255), mask);
  return mask;
}

/// Numbers of pixels of both patches of a robot.
struct Patches {
  int own_px = 0, blue_px = 0;
};
Patches patchesOf(const Robot& robot, const cv::Mat& hsv) {
  cv::Mat1b own = pixelsOf(hsv, robot.low_hue, robot.high_hue), blue = bluePixels(hsv);
  if (!robot.place.empty()) return {cv::countNonZero(own(robot.place)), cv::countNonZero(blue(robot.place))};
  for (const Robot& other : robots())
    if (!other.place.empty()) own(other.place) = 0, blue(other.place) = 0;
  return {cv::countNonZero(own), cv::countNonZero(blue)};
}

int median(std::vector<int> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// What was reported of a robot in a frame.
struct Sight {
  int frame = 0;
  Eigen::Vector2d middle_px{0.0, 0.0}, team_px{0.0, 0.0};
  double heading_rad = 0.0;
  bool right_colour = false;  ///< the image has the robot's hues at the places of its patches
};

/// Largest rms about the mean per axis in any of the ranges of frames.
struct Jitter {
  double middle_px = 0.0, team_px = 0.0, heading_deg = 0.0;
};
Jitter jitterOf(const std::vector<Sight>& sights, const std::vector<cv::Range>& ranges) {
  Jitter worst;
  for (const cv::Range& range : ranges) {
    Eigen::Matrix<double, 5, 1> sum = Eigen::Matrix<double, 5, 1>::Zero(), squares = sum;
    int count = 0;
    for (const Sight& s : sights) {
      if (s.frame < range.start || s.frame >= range.end) continue;
      Eigen::Matrix<double, 5, 1> value;
      value << s.middle_px, s.team_px, std::remainder(s.heading_rad - sights.front().heading_rad, 2.0 * M_PI);
      sum += value;
      squares += value.cwiseAbs2();
      ++count;
    }
    if (count == 0) continue;
    const Eigen::Matrix<double, 5, 1> variance = (squares / count - (sum / count).cwiseAbs2()).cwiseMax(0.0);
    worst.middle_px = std::max(worst.middle_px, std::sqrt(0.5 * variance.head<2>().sum()));
    worst.team_px = std::max(worst.team_px, std::sqrt(0.5 * variance.segment<2>(2).sum()));
    worst.heading_deg = std::max(worst.heading_deg, std::sqrt(variance[4]) * 180.0 / M_PI);
  }
  return worst;
}

struct Film {
  int frames = 0;
  std::map<std::string, std::vector<Sight>> sights;
  std::map<std::string, std::vector<Patches>> patches;  ///< per frame
};

void draw(const cv::Mat& image, const std::vector<Detection>& detections, const std::string& path) {
  cv::Mat picture;
  cv::resize(image, picture, {}, 2, 2, cv::INTER_NEAREST);
  const auto at = [](const Eigen::Vector2d& p) { return cv::Point2d(2 * p.x() + 0.5, 2 * p.y() + 0.5); };
  for (const Detection& d : detections) {
    cv::line(picture, at(d.team_px), at(d.individual_px), {255, 255, 255}, 2);
    cv::putText(picture, d.robot, at(d.team_px) + cv::Point2d(20, 0), 0, 0.7, {0, 255, 255}, 2);
  }
  cv::imwrite(path, picture);
}

/// Runs the detector over the video. OVERLAYS=DIR writes every 25th frame, without and with its detections.
Film follow(cv::VideoCapture& video, double tone_gamma) {
  const auto markers = dataset::MarkerSet::load(sourceFolder() + "/tests/unit/markers/vss_markers.yaml");
  FinderOptions options;
  options.min_saturation = 0.2;  // the patches are pale
  options.tone_gamma = tone_gamma;
  options.max_scale_error = 0.12;  // 1 of 12 px: their sizes are measured by hand in the video
  std::unique_ptr<MarkerFinder> finder;
  std::unique_ptr<lens::Camera> camera;
  Film film;
  for (cv::Mat whole; video.read(whole); ++film.frames) {
    const cv::Mat image = whole(cv::Rect(kGui_px, 0, whole.cols - kGui_px, whole.rows)).clone();
    if (!finder) {
      camera = std::make_unique<lens::Camera>(assumedCamera(image.cols, image.rows));
      finder = MarkerFinder::make(*camera, markers, options);
    }
    const auto& detections = finder->find(image, film.frames * 33333333LL);
    cv::Mat hsv;
    cv::cvtColor(image, hsv, cv::COLOR_BGR2HSV);
    for (const Robot& robot : robots()) film.patches[robot.name].push_back(patchesOf(robot, hsv));
    for (const Detection& d : detections) {
      const Pose2& p = d.map_from_base;
      const auto robot =
          std::find_if(robots().begin(), robots().end(), [&](const Robot& r) { return r.name == d.robot; });
      const auto shows = [&](const cv::Mat1b& mask, const Eigen::Vector2d& at) {
        return cv::countNonZero(mask(cv::Rect(cvRound(at.x()) - 3, cvRound(at.y()) - 3, 7, 7) &
                                     cv::Rect({0, 0}, mask.size()))) > 0;
      };
      film.sights[d.robot].push_back(
          {film.frames, *camera->pixelFromPoint({p.x_m, p.y_m, markers.height_m}), d.team_px, p.theta_rad,
           robot != robots().end() && shows(bluePixels(hsv), d.team_px) &&
               shows(pixelsOf(hsv, robot->low_hue, robot->high_hue), d.individual_px)});
    }
    if (std::getenv("OVERLAYS") != nullptr && film.frames % 25 == 0) {
      draw(image, detections,
           std::string(std::getenv("OVERLAYS")) + "/" + std::to_string(film.frames) + ".png");
      cv::imwrite(std::string(std::getenv("OVERLAYS")) + "/" + std::to_string(film.frames) + "_image.png",
                  image);
    }
  }
  return film;
}

/// A robot is visible if three quarters of each of its patches are.
bool isVisible(const Patches& now, int own_px, int blue_px) {
  return now.own_px >= 0.75 * own_px && now.blue_px >= 0.75 * blue_px;
}

class OverheadVideo : public ::testing::TestWithParam<double> {};

TEST_P(OverheadVideo, FindsEveryVisibleRobotAndKeepsParkedOnesInPlace) {
  const std::string path = dataFolder() + "/overhead/vss/robot_move.mp4";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  cv::VideoCapture video(path);
  ASSERT_TRUE(video.isOpened());
  const Film film = follow(video, GetParam());
  ASSERT_EQ(film.frames, 502);
  ASSERT_EQ(film.sights.size(), robots().size());
  for (const Robot& robot : robots()) {
    const auto& patches = film.patches.at(robot.name);
    const auto& sights = film.sights.at(robot.name);
    std::vector<int> own, blue;
    for (const Patches& p : patches) own.push_back(p.own_px), blue.push_back(p.blue_px);
    const int own_px = median(own), blue_px = median(blue);
    int visible = 0, found = 0, wrong = 0, switched = 0;
    for (int f = 0; f < film.frames; ++f) {
      if (!isVisible(patches[static_cast<std::size_t>(f)], own_px, blue_px)) continue;
      ++visible;
      found +=
          std::any_of(sights.begin(), sights.end(), [f](const Sight& s) { return s.frame == f; }) ? 1 : 0;
    }
    for (std::size_t i = 0; i < sights.size(); ++i) {
      wrong += sights[i].right_colour ? 0 : 1;
      // Pushed at up to 0.7 m/s, which is 7 px per frame. The next robot is 100 px away.
      switched += i > 0 && (sights[i].middle_px - sights[i - 1].middle_px).norm() >
                               10.0 * (sights[i].frame - sights[i - 1].frame)
                      ? 1
                      : 0;
    }
    const Jitter jitter = jitterOf(sights, robot.parked);
    std::printf(
        "%-5s visible in %d frames, found in %d of them and %zu others, %d wrong colours, %d id switches; "
        "parked: %.3f px, team patch %.3f px, %.2f deg rms\n",
        robot.name.c_str(), visible, found, sights.size() - static_cast<std::size_t>(found), wrong, switched,
        jitter.middle_px, jitter.team_px, jitter.heading_deg);
    EXPECT_GE(visible, 485) << robot.name;
    EXPECT_EQ(found, visible) << robot.name;
    EXPECT_EQ(wrong, 0) << robot.name;
    EXPECT_EQ(switched, 0) << robot.name;
    EXPECT_LE(jitter.middle_px, 0.25) << robot.name;
  }
  // The yellow team and the ball never move and must never be reported.
  for (const Eigen::Vector2d& other : {Eigen::Vector2d(368, 47), {429, 209}, {366, 335}})
    for (const auto& [robot, sights] : film.sights)
      for (const Sight& s : sights) EXPECT_GT((s.middle_px - other).norm(), 25.0) << robot;
}

INSTANTIATE_TEST_SUITE_P(ToneGamma, OverheadVideo, ::testing::Values(1.0, 2.2));

}  // namespace
}  // namespace omnifleet::markers
