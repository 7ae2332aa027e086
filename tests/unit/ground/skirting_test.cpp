// Skirting boards in a rectangular room, rendered through the lens model. The floor ends at the foot of the
// walls, in closed form; the mask ends it at the upper edge of the boards, as the segmentation does where
// they look like floor.
#include "ground/skirting.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "ground/floor_view.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

constexpr double kCamera_m = 0.5, kBoard_m = 0.08;

/// What the floor and the lower part of the walls look like.
struct Boards {
  cv::Vec3f floor{150.0f, 160.0f, 170.0f}, board{158.0f, 160.0f, 165.0f}, wall{70.0f, 60.0f, 90.0f};
  std::array<double, 4> distance_m{1.2, 1.7, 1.0, 2.0};
  double height_m = kBoard_m;  ///< of the boards; 0: none
  double strip_m = 0.0;        ///< width of a strip of the board's colour on the floor along the walls
  double strip_px = 0.0;       ///< likewise, in the image: as compression colours the floor beside an edge
  double door_from = 9.0, door_to = 9.0;  ///< bearings, radians: no board in between
  bool round = false;                     ///< one wall around the camera, at the first distance
};

class SkirtedRoom {
 public:
  explicit SkirtedRoom(const Boards& boards)
      : boards_(boards), camera_(model()), view_(camera_, ViewOptions{}), floor_(camera_, view_, {}) {
    render();
  }

  /// Skirting over some frames with new noise. @param step_m of the camera along x before each one but the
  /// first @return the last boundary
  Boundary run(Skirting& skirting, int frames = 6, double step_m = 0.0) {
    Boundary boundary;
    for (int i = 0; i < frames; ++i) {
      Motion motion;
      motion.valid = true;
      if (i > 0 && step_m > 0.0) {
        motion.previous_from_current = {step_m, 0.0, 0.0};
        at_m_.x() += step_m;
        render();
      }
      const cv::Mat3b image = frame();
      boundary = floor_.find(image, mask_);
      ends_ = skirting.apply(image, motion, boundary);
    }
    return boundary;
  }
  Skirting skirting() const { return {kCamera_m, floor_, {}}; }

  Skirting unused() const {
    SkirtingOptions options;
    options.use = false;
    return {kCamera_m, floor_, options};
  }

  double bearing(std::size_t i) const { return 2.0 * M_PI * static_cast<double>(i) / 720.0; }
  double range(std::size_t i) const {
    const Eigen::Vector2d u(std::cos(bearing(i)), std::sin(bearing(i)));
    return boards_.round ? boards_.distance_m[0] : 1.0 / depth(u);
  }
  bool isDoor(double bearing) const { return bearing > boards_.door_from && bearing < boards_.door_to; }
  const std::vector<Skirting::End>& ends() const { return ends_; }
  int count(Skirting::End end) const { return static_cast<int>(std::count(ends_.begin(), ends_.end(), end)); }
  int movedCount() const { return count(Skirting::End::kFoot); }

 private:
  static lens::CameraModel model() {
    lens::CameraModel model = testing::fisheye();
    model.position_m = {0.0, 0.0, kCamera_m};
    return model;
  }
  double depth(const Eigen::Vector2d& p) const {
    if (boards_.round) return p.norm() / boards_.distance_m[0];
    double most = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double a = 0.2 + 0.5 * M_PI * k;
      const Eigen::Vector2d normal(std::cos(a), std::sin(a));
      most = std::max(most,
                      p.dot(normal) / (boards_.distance_m[static_cast<std::size_t>(k)] - at_m_.dot(normal)));
    }
    return most;
  }
  /// Colour at a point of the image, and whether the mask covers it.
  std::pair<cv::Vec3f, bool> at(const Eigen::Vector2d& pixel) const {
    const auto floor = camera_.floorFromPixel(pixel);
    if (!floor) return {boards_.wall, true};
    const double depth = this->depth(*floor);
    if (depth <= 1.0) {
      const double to_wall_m = (1.0 / depth - 1.0) * floor->norm();
      if (boards_.strip_px > 0.0 && isNearWall(pixel)) return {boards_.board, false};
      return {to_wall_m < boards_.strip_m ? boards_.board : boards_.floor, false};
    }
    const double height_m = kCamera_m * (1.0 - 1.0 / depth);
    double bearing = std::atan2(floor->y(), floor->x());
    if (bearing < 0.0) bearing += 2.0 * M_PI;
    if (height_m >= boards_.height_m || isDoor(bearing)) return {boards_.wall, true};
    return {boards_.board, false};
  }
  /// Whether a wall is seen `strip_px` farther out.
  bool isNearWall(const Eigen::Vector2d& pixel) const {
    const lens::CameraModel& model = camera_.model();
    const Eigen::Vector2d out = pixel - model.principal_point_px;
    const auto floor = camera_.floorFromPixel(pixel + boards_.strip_px * out.normalized());
    return !floor || depth(*floor) > 1.0;
  }
  /// Each pixel is the mean of 3 × 3 samples of its area.
  void render() {
    clean_.create(camera_.model().image_height_px, camera_.model().image_width_px);
    mask_.create(clean_.size());
    for (int y = 0; y < clean_.rows; ++y) {
      for (int x = 0; x < clean_.cols; ++x) {
        const auto [colour, covered] = at({static_cast<double>(x), static_cast<double>(y)});
        cv::Vec3f sum = colour * (1.0f / 9.0f);
        for (int k = 0; k < 9; ++k)
          if (k != 4) sum += at({x + (k % 3 - 1) / 3.0, y + (k / 3 - 1) / 3.0}).first * (1.0f / 9.0f);
        clean_(y, x) = sum;
        mask_(y, x) = covered ? 255 : 0;
      }
    }
  }
  /// With new texture: σ of 2 grey levels, equal in all channels.
  cv::Mat3b frame() {
    cv::Mat3b image(clean_.size());
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const auto texture = static_cast<float>(random_.gaussian(2.0));
        for (int c = 0; c < 3; ++c)
          image(y, x)[c] = cv::saturate_cast<std::uint8_t>(clean_(y, x)[c] + texture);
      }
    }
    return image;
  }

  Boards boards_;
  lens::Camera camera_;
  FloorView view_;
  FloorBoundary floor_;
  cv::Mat3f clean_;
  cv::Mat1b mask_;
  cv::RNG random_{7};
  Eigen::Vector2d at_m_ = Eigen::Vector2d::Zero();  ///< the camera
  std::vector<Skirting::End> ends_;
};

/// Share of the bearings that `counts` and whose range is right to 4 % or another share; upper edges are 19 %
/// too far.
double shareRight(
    const SkirtedRoom& room, const Boundary& boundary,
    const std::function<bool(double)>& counts = [](double) { return true; }, double share = 0.04) {
  int right = 0, all = 0;
  for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i) {
    if (!counts(room.bearing(i)) || boundary.inverse_m[i] <= 0.0f) continue;
    ++all;
    right += std::abs(1.0 / boundary.inverse_m[i] / room.range(i) - 1.0) < share ? 1 : 0;
  }
  return all > 0 ? static_cast<double>(right) / all : 0.0;
}

TEST(Skirting, FindsFootAndHeightOfFaintBoards) {
  SkirtedRoom room{Boards{}};
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting);
  EXPECT_NEAR(skirting.height_m(), kBoard_m, 0.004);
  EXPECT_GE(shareRight(room, boundary), 0.95);
}

// Before a dark board the upper edge is located less precisely, so the height is. The feet are edges by
// themselves.
TEST(Skirting, FindsBoardsAsDarkAsShadow) {
  Boards boards;
  boards.board = 0.7f * boards.floor;
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting);
  EXPECT_NEAR(skirting.height_m(), kBoard_m, 0.008);
  EXPECT_GE(shareRight(room, boundary), 0.95);
}

// σ of the feet covers their errors: normalized squares have a mean of 1 or less.
TEST(Skirting, StatesSigmaThatCoversTheError) {
  SkirtedRoom room{Boards{}};
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting);
  double sum = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i) {
    if (boundary.inverse_m[i] <= 0.0f) continue;
    sum += std::pow((boundary.inverse_m[i] - 1.0 / room.range(i)) / boundary.sigma[i], 2);
    ++n;
  }
  EXPECT_LT(sum / n, 1.5);
}

TEST(Skirting, LeavesDoorsWithoutBoards) {
  Boards boards;
  boards.door_from = 1.2;
  boards.door_to = 1.9;
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting);
  const auto inDoor = [](double bearing) { return bearing > 1.3 && bearing < 1.8; };
  EXPECT_GE(shareRight(room, boundary, inDoor), 0.95);
  EXPECT_GE(shareRight(room, boundary, [&](double b) { return b < 1.1 || b > 2.0; }), 0.95);
}

TEST(Skirting, ChangesNothingWithoutBoards) {
  Boards boards;
  boards.height_m = 0.0;
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  EXPECT_GE(shareRight(room, room.run(skirting)), 0.98);
  EXPECT_EQ(skirting.height_m(), 0.0);
  EXPECT_EQ(room.movedCount(), 0);
}

TEST(Skirting, TakesStripOfOneWidthForFloor) {
  Boards boards;
  boards.height_m = 0.0;
  boards.strip_m = 0.15;
  boards.board = 0.7f * boards.floor;
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  room.run(skirting);
  EXPECT_EQ(room.movedCount(), 0);
}

// At one distance a board and a strip look alike.
TEST(Skirting, ChangesNothingWhereAllWallsAreEquallyFar) {
  Boards boards;
  boards.round = true;
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  room.run(skirting);
  EXPECT_EQ(room.movedCount(), 0);
}

// The spread of the heights is not known after a few frames.
TEST(Skirting, ChangesNothingInFewFrames) {
  SkirtedRoom room{Boards{}};
  Skirting skirting = room.skirting();
  room.run(skirting, 4);
  EXPECT_EQ(room.movedCount(), 0);
}

TEST(Skirting, IsOffIfSwitchedOff) {
  SkirtedRoom room{Boards{}};
  Skirting skirting = room.unused();
  room.run(skirting);
  EXPECT_EQ(skirting.height_m(), 0.0);
  EXPECT_EQ(room.movedCount(), 0);
}

/// Boards of 3 to 5 pixels.
Boards farBoards() {
  Boards boards;
  boards.distance_m = {3.2, 2.4, 2.8, 3.5};
  return boards;
}

// Until the parallax is known, σ covers the foot and the upper edge.
TEST(Skirting, StaysUndecidedAboutNarrowBoardsAtOnePlace) {
  SkirtedRoom room{farBoards()};
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting);
  EXPECT_EQ(room.movedCount(), 0);
  EXPECT_GE(room.count(Skirting::End::kUndecided), 500);
  for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i) {
    if (room.ends()[i] != Skirting::End::kUndecided) continue;
    ASSERT_LT(std::abs(boundary.inverse_m[i] - 1.0 / room.range(i)), 2.5 * boundary.sigma[i]) << i;
  }
}

// One pixel of such boards is 2 to 3 cm of height.
TEST(Skirting, FindsNarrowBoardsByTheirParallax) {
  SkirtedRoom room{farBoards()};
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting, 14, 0.1);
  EXPECT_NEAR(skirting.height_m(), kBoard_m, 0.015);
  EXPECT_GE(room.movedCount(), 500);
  EXPECT_GE(shareRight(
                room, boundary, [](double) { return true; }, 0.06),
            0.9);
}

// JPEG colours the floor beside an edge. That looks like a narrow board, but the edge stands on the floor.
TEST(Skirting, ChangesNothingWhereTheImageHasStripsBesideEdges) {
  Boards boards = farBoards();
  boards.height_m = 0.0;
  boards.strip_px = 4.0;
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  const Boundary boundary = room.run(skirting, 14, 0.1);
  EXPECT_EQ(skirting.height_m(), 0.0);
  EXPECT_EQ(room.movedCount(), 0);
  EXPECT_EQ(room.count(Skirting::End::kUndecided), 0);
  EXPECT_GE(shareRight(room, boundary), 0.98);
}

// Too little floor is visible before a near wall. It is no reason to doubt where it stands.
TEST(Skirting, LeavesWallsThatAreTooNearToBeJudged) {
  Boards boards;
  boards.distance_m = {1.2, 1.7, 0.4, 2.0};
  SkirtedRoom room(boards);
  Skirting skirting = room.skirting();
  room.run(skirting);
  ASSERT_GT(skirting.height_m(), 0.0);
  int near = 0;
  for (std::size_t i = 0; i < room.ends().size(); ++i) {
    if (room.range(i) > 0.42) continue;
    ++near;
    EXPECT_NE(room.ends()[i], Skirting::End::kUndecided) << i;
  }
  EXPECT_GT(near, 20);
}

}  // namespace
}  // namespace omnifleet::ground
