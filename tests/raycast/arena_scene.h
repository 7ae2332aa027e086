#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "tests/raycast/arena_layout.h"

namespace omnifleet::raycast {

/// A box on the floor: a block, a wall or the body of a robot with markers painted on top.
struct ArenaBox {
  Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();  ///< of the footprint
  Eigen::Matrix2d map_from_box = Eigen::Matrix2d::Identity();
  Eigen::Vector2d half_m = Eigen::Vector2d::Zero();
  double height_m = 0.0;
  Eigen::Vector3f albedo = Eigen::Vector3f::Zero();
  int robot = -1;  ///< index of the robot, whose colours are painted on top; −1: no robot
  unsigned texture = 0;

  Eigen::Vector2d toBox(const Eigen::Vector2d& in_map) const {
    return map_from_box.transpose() * (in_map - middle_m);
  }
  Eigen::Vector2d toMap(const Eigen::Vector2d& in_box) const { return middle_m + map_from_box * in_box; }
};

/// What a ray meets. Samples of one pixel with different surfaces show an edge.
struct Surface3 {
  enum Face : int { kTop = 0, kBack, kFront, kRight, kLeft, kFloor, kSky };
  int box = -1;  ///< index among the boxes; floor: −1
  Face face = kSky;
  int paint = 0;  ///< top of a robot: 0 body, 1 cover, 2 tail, 3 head; floor: number of the card + 1
  int key() const { return ((box + 1) * 8 + face) * 16 + paint; }
  static Surface3 fromKey(int key) { return {key / 128 - 1, static_cast<Face>(key / 16 % 8), key % 16}; }
};

/// Surfaces and light of an arena. Light and colours are linear. Lengths are metres, in map.
class ArenaScene {
 public:
  static constexpr double kShadow_m = 0.18;  ///< farthest shadow of a robot beside it

  ArenaScene(const ArenaLayout& layout, const ArenaOptions& options);

  /// Walls, blocks and parked robots.
  const std::vector<ArenaBox>& boxes() const { return boxes_; }
  ArenaBox robotAt(int robot, const Pose2& map_from_base) const;

  /// Paint on top of a robot at a point of its box.
  int paintAt(const ArenaBox& box, const Eigen::Vector2d& in_box) const;
  /// Number of the card that lies on a place of the floor, plus 1; 0: none.
  int cardAt(const Eigen::Vector2d& at) const;

  /// Light from the floor towards a camera. `along` is the unit vector of the ray from the camera.
  Eigen::Vector3f floorAt(const Eigen::Vector2d& at, int card, const Eigen::Vector3f& along,
                          const std::vector<ArenaBox>& moving) const;
  Eigen::Vector3f boxAt(const ArenaBox& box, Surface3::Face face, int paint,
                        const Eigen::Vector3d& in_box) const;
  Eigen::Vector3f skyAlong(const Eigen::Vector3f& along) const;
  double light() const { return light_; }

 private:
  static constexpr int kLamps = 2;
  static constexpr double kTexel_m = 0.002, kLumel_m = 0.01, kOutside_m = 0.2;
  struct Lamp {
    Eigen::Vector3d at_m;
    double power = 1.0, radius_m = 0.15;
  };
  /// A map of the floor, sampled bilinearly.
  struct FloorMap {
    Eigen::Vector2d low;
    double cell_m = 0.01;
    int columns = 0, rows = 0;
    std::vector<Eigen::Vector3f> cells;
    Eigen::Vector3f at(const Eigen::Vector2d& place) const;
    Eigen::Vector2d middle(int x, int y) const { return low + cell_m * Eigen::Vector2d(x, y); }
  };

  FloorMap emptyMap(double cell_m) const;
  void paintFloor();
  void lightFloor();
  static float visibility(const Lamp& lamp, const Eigen::Vector2d& at, const ArenaBox* boxes,
                          std::size_t count);

  Extent room_;
  dataset::MarkerSet markers_;
  std::vector<FloorMarking> cards_;
  std::vector<ArenaBox> boxes_;
  std::array<Lamp, kLamps> lamps_;
  std::array<std::array<Eigen::Vector3f, 4>, kRobots> paints_;
  Eigen::Vector3f floor_albedo_;
  double ambient_ = 0.5, light_ = 1.0, glare_ = 0.0;
  unsigned seed_ = 0;
  FloorMap albedo_, irradiance_;  ///< irradiance: ambient, first and second lamp
};

}  // namespace omnifleet::raycast
