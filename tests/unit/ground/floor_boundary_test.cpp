// Boundaries of a rectangular room, rendered through the lens model. Inverse range to its walls has a closed
// form.
#include "ground/floor_boundary.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// Four walls n·p = d about the foot of the camera, all in base_link.
struct WalledRoom {
  double heading_rad = 0.2;
  std::array<double, 4> distance_m{1.3, 1.0, 0.9, 1.4};
  cv::Vec3f floor{150.0f, 160.0f, 170.0f}, wall{70.0f, 60.0f, 90.0f};
  double far_share = 1.0;  ///< light at the rim of the image relative to its centre
  bool even_wall = false;  ///< the light of the walls does not fall off

  /// n·p/d of the nearest wall: above 1 behind it, and the inverse range for a unit vector.
  double depth(const Eigen::Vector2d& p) const {
    double most = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double a = heading_rad + 0.5 * M_PI * k;
      const double share = p.dot(Eigen::Vector2d(std::cos(a), std::sin(a)));
      most = std::max(most, share / distance_m[static_cast<std::size_t>(k)]);
    }
    return most;
  }
};

class RenderedRoom {
 public:
  explicit RenderedRoom(const WalledRoom& room = {}, double pitch_deg = 0.0)
      : room_(room), camera_(model(pitch_deg)), view_(camera_, ViewOptions{}) {}

  static lens::CameraModel model(double pitch_deg) {
    lens::CameraModel model = testing::fisheye();
    model.position_m = {0.06, -0.03, 0.5};
    model.rotation_rpy_deg.y() = pitch_deg;
    return model;
  }

  const lens::Camera& camera() const { return camera_; }
  const FloorView& view() const { return view_; }

  /// Each pixel is the mean over its area: 8 × 8 samples where an edge crosses it.
  cv::Mat3b image() const {
    cv::Mat3b image(camera_.model().image_height_px, camera_.model().image_width_px);
    cv::Mat1b corners(image.rows + 1, image.cols + 1);  // of the pixels: 1 on a wall
    for (int y = 0; y < corners.rows; ++y)
      for (int x = 0; x < corners.cols; ++x) corners(y, x) = onWall({x - 0.5, y - 0.5}) ? 1 : 0;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const int walls = corners(y, x) + corners(y, x + 1) + corners(y + 1, x) + corners(y + 1, x + 1);
        const double share = walls % 4 == 0 ? walls / 4 : wallShare(x, y);
        const double falling = light(x, y), on_wall = room_.even_wall ? 1.0 : falling;
        const cv::Vec3f colour = room_.floor * ((1.0 - share) * falling) + room_.wall * (share * on_wall);
        for (int c = 0; c < 3; ++c) image(y, x)[c] = cv::saturate_cast<std::uint8_t>(colour[c]);
      }
    }
    return image;
  }

  /// 255 on the walls. @param off_px the mask begins so much farther from the image centre than the wall
  cv::Mat1b mask(double off_px) const {
    cv::Mat1b mask(camera_.model().image_height_px, camera_.model().image_width_px);
    const Eigen::Vector2d centre = camera_.model().principal_point_px;
    for (int y = 0; y < mask.rows; ++y) {
      for (int x = 0; x < mask.cols; ++x) {
        const Eigen::Vector2d from_centre = Eigen::Vector2d(x, y) - centre;
        mask(y, x) = onWall(centre + from_centre * (1.0 - off_px / from_centre.norm())) ? 255 : 0;
      }
    }
    return mask;
  }

  double inverseRange(std::size_t bearing, std::size_t bearings) const {
    return room_.depth(direction(bearing, bearings));
  }

  /// How much farther out the found edge is than the true one, pixels of the image.
  double error(const Boundary& boundary, std::size_t i) const {
    const std::size_t n = boundary.inverse_m.size();
    const auto at = [&](double inverse) {
      const Eigen::Vector2d p = camera_.foot() + direction(i, n) / inverse;
      return *camera_.pixelFromPoint({p.x(), p.y(), 0.0});
    };
    const double found = boundary.inverse_m[i], truth = inverseRange(i, n);
    return (at(found) - at(truth)).norm() * (found < truth ? 1.0 : -1.0);
  }

  static Eigen::Vector2d direction(std::size_t bearing, std::size_t bearings) {
    const double a = 2.0 * M_PI * static_cast<double>(bearing) / static_cast<double>(bearings);
    return {std::cos(a), std::sin(a)};
  }

 private:
  bool onWall(const Eigen::Vector2d& pixel) const {
    const auto floor = camera_.floorFromPixel(pixel);
    return !floor || room_.depth(*floor - camera_.foot()) > 1.0;
  }
  double wallShare(int x, int y) const {
    int inside = 0;
    for (int i = 0; i < 64; ++i)
      inside += onWall({x - 0.5 + (i % 8 + 0.5) / 8, y - 0.5 + (i / 8 + 0.5) / 8}) ? 1 : 0;
    return inside / 64.0;
  }
  double light(int x, int y) const {
    const Eigen::Vector2d from_centre = Eigen::Vector2d(x, y) - camera_.model().principal_point_px;
    return 1.0 - (1.0 - room_.far_share) * std::min(1.0, from_centre.squaredNorm() / (230.0 * 230.0));
  }

  WalledRoom room_;
  lens::Camera camera_;
  FloorView view_;
};

int found(const Boundary& boundary) {
  return static_cast<int>(
      std::count_if(boundary.sigma.begin(), boundary.sigma.end(), [](float sigma) { return sigma > 0.0f; }));
}

struct EdgeErrors {
  int bearings = 0, near = 0;  ///< near: within 0.1 px
  double mean_px = 0.0;
};

EdgeErrors errorsOf(const RenderedRoom& room, const Boundary& boundary) {
  EdgeErrors errors;
  int n = 0;
  for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i, ++errors.bearings) {
    if (!(boundary.inverse_m[i] > 0.0f)) continue;
    const double error = room.error(boundary, i);
    errors.near += std::abs(error) <= 0.1 ? 1 : 0;
    errors.mean_px += error;
    ++n;
  }
  errors.mean_px /= std::max(1, n);
  return errors;
}

/// A tenth of a pixel is what 8-bit colours, 64 samples per pixel and bilinear sampling leave; room corners
/// bend the edge within the window.
void expectSharp(const RenderedRoom& room, const cv::Mat& image, double mask_off_px) {
  FloorBoundary finder(room.camera(), room.view(), {});
  const EdgeErrors errors = errorsOf(room, finder.find(image, room.mask(mask_off_px)));
  EXPECT_GE(errors.near, 0.95 * errors.bearings) << "mask off by " << mask_off_px << " px";
  EXPECT_LT(std::abs(errors.mean_px), 0.05) << "mask off by " << mask_off_px << " px";
}

TEST(FloorBoundary, FindsWallsWithinATenthOfAPixel) {
  const RenderedRoom room;
  const cv::Mat3b image = room.image();
  for (const double off_px : {-2.0, -1.0, 0.0, 1.0}) expectSharp(room, image, off_px);
}

TEST(FloorBoundary, FindsWallsWhereLightFallsOff) {
  WalledRoom dark_rim;
  dark_rim.far_share = 0.6;
  const RenderedRoom room(dark_rim);
  const cv::Mat3b image = room.image();
  for (const double off_px : {-2.0, 0.0, 1.0}) expectSharp(room, image, off_px);
}

TEST(FloorBoundary, ExtrapolatesTheLightOfTheFloorToTheEdge) {
  WalledRoom dark_rim;
  dark_rim.far_share = 0.25;
  dark_rim.even_wall = true;
  dark_rim.wall = {20.0f, 20.0f, 20.0f};
  const RenderedRoom room(dark_rim);
  expectSharp(room, room.image(), 0.0);
}

TEST(FloorBoundary, FindsWallsThatDifferInOneColourOnly) {
  WalledRoom red;
  red.floor = {100.0f, 100.0f, 100.0f};
  red.wall = {100.0f, 100.0f, 180.0f};
  const RenderedRoom room(red);
  expectSharp(room, room.image(), 0.0);
}

TEST(FloorBoundary, FindsWallsFromATiltedCamera) {
  const RenderedRoom room({}, 4.0);
  expectSharp(room, room.image(), 0.0);
}

TEST(FloorBoundary, StatesSigmaAsPixelsAlongTheBearing) {
  const RenderedRoom room;
  BoundaryOptions options;
  options.sigma_px = 0.4;
  FloorBoundary finder(room.camera(), room.view(), options);
  const Boundary& boundary = finder.find(room.image(), room.mask(0.0));
  EXPECT_TRUE(boundary.origin_m.isApprox(room.camera().foot()));
  const double f = room.camera().model().focal_px.x(), h = room.camera().height();
  for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i) {
    ASSERT_EQ(boundary.sigma[i] > 0.0f, boundary.inverse_m[i] > 0.0f) << i;
    if (!(boundary.sigma[i] > 0.0f)) continue;
    // Equidistant lens: 1/range = 1/(h·tan(r/f)), so d(1/range)/dr = 1/(h·f·sin²θ).
    const double theta = std::atan(1.0 / (h * static_cast<double>(boundary.inverse_m[i])));
    const double expected = options.sigma_px / (h * f * std::sin(theta) * std::sin(theta));
    // Steps of a path are one pixel long within the spacing of their candidates, 0.03 px.
    EXPECT_NEAR(boundary.sigma[i], expected, 0.06 * expected) << i;
  }
}

TEST(FloorBoundary, FindsNothingWhereTheMaskShowsOnlyFloor) {
  const RenderedRoom room;
  const cv::Mat3b image = room.image();
  FloorBoundary finder(room.camera(), room.view(), {});
  cv::Mat1b none(image.size(), 0);
  EXPECT_EQ(found(finder.find(image, none)), 0);
  cv::Mat1b half = room.mask(0.0);
  half.colRange(0, 320).setTo(0);  // image left is +y of base_link
  const Boundary& boundary = finder.find(image, half);
  for (std::size_t i = 30; i <= 330; ++i) EXPECT_EQ(boundary.sigma[i], 0.0f) << i;
  for (std::size_t i = 390; i <= 690; ++i) EXPECT_GT(boundary.sigma[i], 0.0f) << i;
}

/// A boundary without edges, to be completed; places known otherwise, two pixels off on the average.
class AddedEdges : public ::testing::Test {
 protected:
  AddedEdges()
      : none_(finder_.find(image_, cv::Mat1b(image_.size(), 0))), expected_m_(none_.inverse_m.size()) {
    for (std::size_t i = 0; i < expected_m_.size(); ++i)
      expected_m_[i] = static_cast<float>(0.98 * room_.inverseRange(i, expected_m_.size()));
  }
  /// σ in pixels along the bearing.
  double sigma_px(const Boundary& boundary, std::size_t i) const {
    const double f = room_.camera().model().focal_px.x(), h = room_.camera().height(),
                 theta = std::atan(1.0 / (h * static_cast<double>(boundary.inverse_m[i])));
    return static_cast<double>(boundary.sigma[i]) * h * f * std::sin(theta) * std::sin(theta);
  }

  RenderedRoom room_;
  cv::Mat3b image_ = room_.image();
  FloorBoundary finder_{room_.camera(), room_.view(), {}};
  Boundary none_;
  std::vector<float> expected_m_;
};

TEST_F(AddedEdges, LieAtWallsThatTheMaskMisses) {
  finder_.complete(image_, expected_m_, none_);
  const EdgeErrors errors = errorsOf(room_, none_);
  EXPECT_GE(found(none_), 0.95 * errors.bearings);
  EXPECT_GE(errors.near, 0.9 * errors.bearings);
  for (std::size_t i = 0; i < none_.sigma.size(); ++i) {
    if (none_.sigma[i] > 0.0f) {
      EXPECT_NEAR(sigma_px(none_, i), BoundaryOptions{}.wall_sigma_px, 0.1) << i;
    }
  }
}

/// Of 6 levels, less than an edge has whose place is not known otherwise.
TEST_F(AddedEdges, LieAtFaintWalls) {
  WalledRoom faint;
  faint.wall = {146.0f, 160.0f, 174.0f};
  const RenderedRoom room(faint);
  const cv::Mat3b image = room.image();
  EXPECT_EQ(found(finder_.find(image, room.mask(0.0))), 0);
  finder_.complete(image, expected_m_, none_);
  EXPECT_GE(found(none_), 0.9 * static_cast<double>(expected_m_.size()));
  EXPECT_LT(std::abs(errorsOf(room, none_).mean_px), 0.3);
}

TEST_F(AddedEdges, HaveAtLeastTheirScatterAsSigma) {
  // Every other stretch of 3 degrees looks like floor up to 3 px above the foot of the wall.
  const cv::Mat1b wall = room_.mask(0.0), upper = room_.mask(3.0);
  for (int y = 0; y < image_.rows; ++y)
    for (int x = 0; x < image_.cols; ++x)
      if (wall(y, x) != 0 && upper(y, x) == 0 &&
          static_cast<int>(std::atan2(y - 240.0, x - 320.0) / (M_PI / 60.0) + 120.0) % 2 == 0)
        image_(y, x) = {150, 160, 170};
  finder_.complete(image_, expected_m_, none_);
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < none_.sigma.size(); ++i)
    if (none_.sigma[i] > 0.0f) sigmas.push_back(sigma_px(none_, i));
  ASSERT_GE(sigmas.size(), 400U);
  std::nth_element(sigmas.begin(), sigmas.begin() + 200, sigmas.end());
  EXPECT_GT(sigmas[200], 1.2);
}

TEST_F(AddedEdges, AreLeftOutWhereTheyAreAlone) {
  for (std::size_t i = 0; i < expected_m_.size(); ++i)
    if (i < 100 || i >= 110) expected_m_[i] = 0.0f;
  finder_.complete(image_, expected_m_, none_);
  EXPECT_EQ(found(none_), 0);
}

TEST_F(AddedEdges, ReplaceNoEdgeThatIsKnown) {
  Boundary known = finder_.find(image_, room_.mask(0.0));
  const std::vector<float> before = known.inverse_m, sigma = known.sigma;
  for (float& expected : expected_m_) expected *= 0.97f;
  finder_.complete(image_, expected_m_, known);
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (!(before[i] > 0.0f)) continue;
    EXPECT_EQ(known.inverse_m[i], before[i]) << i;
    EXPECT_EQ(known.sigma[i], sigma[i]) << i;
  }
}

TEST(FloorBoundary, IgnoresSpecksInTheMask) {
  const RenderedRoom room;
  const cv::Mat3b image = room.image();
  cv::Mat1b mask = room.mask(0.0), near;
  BoundaryOptions options;
  options.run_px = 3.0;  // steps of 1 px: up to two of them lie in one pixel
  FloorBoundary finder(room.camera(), room.view(), {}), patient(room.camera(), room.view(), options);
  const std::vector<float> clean = finder.find(image, mask).inverse_m;
  cv::dilate(mask, near, cv::Mat1b(17, 17, static_cast<std::uint8_t>(1)));
  for (int y = 60; y < 420; y += 7)
    for (int x = 140; x < 500; x += 7)
      if (near(y, x) == 0) mask(y, x) = 255;
  EXPECT_EQ(patient.find(image, mask).inverse_m, clean);
  const std::vector<float> specked = finder.find(image, mask).inverse_m;
  for (std::size_t i = 0; i < clean.size(); ++i)
    EXPECT_TRUE(specked[i] == clean[i] || specked[i] == 0.0f) << i << ": a speck is no edge";
}

TEST(FloorBoundary, FindsNoEdgeBelowTheLeastContrast) {
  WalledRoom pale;
  pale.floor = {150.0f, 150.0f, 150.0f};
  pale.wall = {145.0f, 145.0f, 145.0f};
  const RenderedRoom room(pale);
  const cv::Mat3b image = room.image();
  FloorBoundary strict(room.camera(), room.view(), {});
  EXPECT_EQ(found(strict.find(image, room.mask(0.0))), 0);
  BoundaryOptions options;
  options.min_contrast = 2.0;
  FloorBoundary sensitive(room.camera(), room.view(), options);
  EXPECT_GT(found(sensitive.find(image, room.mask(0.0))), 700) << "the edge is there";
}

TEST(FloorBoundary, FindsNoEdgeFarFromTheMask) {
  const RenderedRoom room;
  FloorBoundary finder(room.camera(), room.view(), {});
  // The mask ends 8 px inside of the walls: beyond max_shift_px.
  EXPECT_EQ(found(finder.find(room.image(), room.mask(-8.0))), 0);
}

TEST(FloorBoundary, TreatsGreyAndColourImagesAlike) {
  const RenderedRoom room;
  const cv::Mat3b colour = room.image();
  const cv::Mat1b mask = room.mask(1.0);
  cv::Mat1b grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  expectSharp(room, grey, 1.0);
  cv::Mat3b three;
  cv::cvtColor(grey, three, cv::COLOR_GRAY2BGR);
  FloorBoundary finder(room.camera(), room.view(), {});
  const std::vector<float> of_grey = finder.find(grey, mask).inverse_m;
  EXPECT_EQ(finder.find(three, mask).inverse_m, of_grey) << "same values in three channels";
  const Boundary boundary = finder.find(colour, mask);
  int far = 0;
  for (std::size_t i = 0; i < of_grey.size(); ++i) {
    if (!(boundary.sigma[i] > 0.0f) || !(of_grey[i] > 0.0f)) continue;
    far += std::abs(boundary.inverse_m[i] - of_grey[i]) > 0.4f * boundary.sigma[i] ? 1 : 0;  // 0.1 px
  }
  EXPECT_LE(far, 10);
}

TEST(FloorBoundary, FindsNothingOnMaskedBearings) {
  const RenderedRoom room;
  // The robot hides a sector about +x (image top) from the centre to the rim.
  cv::Mat1b hidden(480, 640, static_cast<std::uint8_t>(0));
  cv::ellipse(hidden, {320, 240}, {400, 400}, 0.0, -100.0, -80.0, 255, cv::FILLED);
  const FloorView view(room.camera(), ViewOptions{}, hidden);
  FloorBoundary finder(room.camera(), view, {});
  const Boundary& boundary = finder.find(room.image(), room.mask(0.0));
  const std::size_t n = boundary.inverse_m.size();
  for (std::size_t i = 0; i <= 16; ++i) {  // ±8° of the ±10°
    EXPECT_EQ(boundary.inverse_m[i], 0.0f) << i;
    EXPECT_EQ(boundary.sigma[(n - i) % n], 0.0f) << i;
  }
  for (const std::size_t i : {30UL, n - 30UL}) EXPECT_GT(boundary.sigma[i], 0.0f) << i;
}

TEST(FloorBoundary, KeepsItsBuffersBetweenImages) {
  const RenderedRoom room;
  const cv::Mat3b image = room.image();
  const cv::Mat1b mask = room.mask(0.0), none(image.size(), static_cast<std::uint8_t>(0));
  FloorBoundary finder(room.camera(), room.view(), {});
  const Boundary& first = finder.find(image, mask);
  const float *inverse = first.inverse_m.data(), *sigma = first.sigma.data();
  const std::vector<float> values = first.inverse_m;
  for (const cv::Mat1b& objects : {none, mask, none, mask}) {
    const Boundary& next = finder.find(image, objects);
    EXPECT_EQ(&next, &first);
    EXPECT_EQ(next.inverse_m.data(), inverse);
    EXPECT_EQ(next.sigma.data(), sigma);
  }
  EXPECT_EQ(first.inverse_m, values) << "results do not depend on earlier images";
}

TEST(FloorBoundary, RejectsACameraWithoutFloor) {
  const RenderedRoom room;
  BoundaryOptions options;
  options.max_angle_deg = 30.0;  // within the robot's own mask
  EXPECT_THROW(FloorBoundary(room.camera(), room.view(), options), options::Error);
}

}  // namespace
}  // namespace omnifleet::ground
