// A published ceiling video without ground truth. Parked robots must not move, ids must not change, and
// neither the yellow team nor the ball may be reported as a robot. Frames in which a stick hides the pushed
// robot are not tested; an independent colour test detects them.

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

struct Trail {
  std::vector<Eigen::Vector2d> middles_px;
  std::vector<int> frames;
};

double rms(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean(0, 0);
  for (const auto& p : points) mean += p / static_cast<double>(points.size());
  double sum = 0;
  for (const auto& p : points) sum += (p - mean).squaredNorm() / static_cast<double>(points.size());
  return std::sqrt(sum / 2.0);  // per axis
}

/// Number of pixels of the green and of the light-blue patches, by hue. Independent of the code under test.
struct Visible {
  int green_px, blue_px;
};
Visible visible(const cv::Mat& bgr) {
  cv::Mat hsv, mask;
  cv::cvtColor(bgr, hsv, cv::COLOR_BGR2HSV);
  cv::inRange(hsv, cv::Scalar(50, 90, 100), cv::Scalar(75, 255, 255), mask);
  const int green = cv::countNonZero(mask);
  cv::inRange(hsv, cv::Scalar(98, 60, 140), cv::Scalar(122, 255, 255), mask);
  return {green, cv::countNonZero(mask)};
}

int median(std::vector<int> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

struct Film {
  int frames = 0;
  std::map<std::string, Trail> trails;
  std::vector<Visible> visible;
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

/// Runs the detector over the video. OVERLAYS=DIR writes every 25th frame with its detections.
Film follow(cv::VideoCapture& video) {
  const auto markers = dataset::MarkerSet::load(sourceFolder() + "/tests/unit/markers/vss_markers.yaml");
  FinderOptions options;
  options.min_saturation = 0.2;    // the patches are pale
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
    for (const Detection& d : detections) {
      const Pose2& p = d.map_from_base;
      film.trails[d.robot].middles_px.push_back(*camera->pixelFromPoint({p.x_m, p.y_m, markers.height_m}));
      film.trails[d.robot].frames.push_back(film.frames);
    }
    film.visible.push_back(visible(image));
    if (std::getenv("OVERLAYS") != nullptr && film.frames % 25 == 0) {
      draw(image, detections,
           std::string(std::getenv("OVERLAYS")) + "/" + std::to_string(film.frames) + ".png");
    }
  }
  return film;
}

TEST(OverheadVideo, KeepsIdsAndPositionsOfParkedRobots) {
  const std::string path = dataFolder() + "/overhead/vss/robot_move.mp4";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
  cv::VideoCapture video(path);
  ASSERT_TRUE(video.isOpened());
  const Film film = follow(video);
  ASSERT_EQ(film.frames, 502);
  ASSERT_EQ(film.trails.size(), 3U);

  // Two robots never move: `pink` is fully visible; `red` is at the left edge, with half of its red patch
  // outside the image. The requirement for parked real robots is 0.25 px RMS. That includes a shift of the
  // whole image by 2 px around frame 110.
  for (const char* parked : {"pink", "red"}) {
    const Trail& trail = film.trails.at(parked);
    EXPECT_GE(trail.frames.size(), 495U) << parked;
    EXPECT_LE(rms(trail.middles_px), 0.25) << parked;
    std::printf("%s: %zu of 502 frames, %.3f px rms per axis\n", parked, trail.frames.size(),
                rms(trail.middles_px));
  }

  // `green` is pushed by a stick that hides it at times. It must be found wherever its patches are visible.
  std::vector<int> greens, blues;
  for (const Visible& v : film.visible) greens.push_back(v.green_px), blues.push_back(v.blue_px);
  const int green = median(greens), blue = median(blues);
  const Trail& trail = film.trails.at("green");
  int shown = 0, found = 0;
  for (int f = 0; f < film.frames; ++f) {
    const Visible& v = film.visible[static_cast<std::size_t>(f)];
    if (v.green_px < 0.8 * green || v.blue_px < 0.93 * blue) continue;  // one of three patches hidden: 0.67
    ++shown;
    found += std::count(trail.frames.begin(), trail.frames.end(), f) > 0 ? 1 : 0;
  }
  std::printf("green: %d of %d frames where it is visible (%zu in all)\n", found, shown, trail.frames.size());
  EXPECT_GE(shown, 450);
  EXPECT_EQ(found, shown);
  for (std::size_t i = 1; i < trail.frames.size(); ++i) {
    // Pushed at up to 0.7 m/s, which is 7 px per frame. The next robot is 100 px away.
    const int gap = trail.frames[i] - trail.frames[i - 1];
    EXPECT_LE((trail.middles_px[i] - trail.middles_px[i - 1]).norm(), 10.0 * gap)
        << "frame " << trail.frames[i];
  }

  // The yellow team and the ball never move and must never be reported.
  for (const Eigen::Vector2d& other : {Eigen::Vector2d(368, 47), {429, 209}, {366, 335}}) {
    for (const auto& [robot, t] : film.trails) {
      for (const auto& p : t.middles_px) EXPECT_GT((p - other).norm(), 25.0) << robot;
    }
  }
}

}  // namespace
}  // namespace omnifleet::markers
