#pragma once

#include <vector>

#include "tests/raycast/arena_camera.h"
#include "tests/raycast/arena_scene.h"

namespace omnifleet::raycast {

/// The boxes that one image of a camera may show, sorted into its tiles.
class ArenaView {
 public:
  /// @param map_from_parent pose of base_link; identity for a fixed camera
  /// @param moving moving robots; `own` is the index of the robot that carries the camera and does not see
  ///   itself, −1: none
  ArenaView(const ArenaScene& scene, const ArenaCamera& camera, const Pose2& map_from_parent,
            const std::vector<ArenaBox>& moving, int own);

  /// Ray of a sample in map; its length is not 1.
  Eigen::Vector3f along(const Eigen::Vector2f& ray) const {
    return rotation_ * Eigen::Vector3f(ray.x(), ray.y(), 1.0F);
  }
  Surface3 surfaceAlong(std::size_t tile, const Eigen::Vector3f& along) const;
  /// Light along a ray that meets a known surface, or its plane beyond the edge.
  Eigen::Vector3f radiance(const Surface3& surface, const Eigen::Vector3f& along) const;
  /// Tiles that show moving robots or their shadows.
  std::vector<char> tilesAroundMoving() const;

 private:
  struct Placed {
    const ArenaBox* box;
    Eigen::Matrix2f box_from_map;
    Eigen::Vector3f from;  ///< the camera in the frame of the box
    Eigen::Vector3f along(const Eigen::Vector3f& in_map) const {
      const Eigen::Vector2f turned = box_from_map * in_map.head<2>();
      return {turned.x(), turned.y(), in_map.z()};
    }
  };
  template <typename Visit>
  void forTiles(const ArenaBox& box, double wider_m, const Visit& visit) const;
  Eigen::Vector2d floorAlong(const Eigen::Vector3f& along) const {
    return (from_ + along * (-from_.z() / along.z())).head<2>().cast<double>();
  }

  const ArenaScene* scene_;
  const ArenaCamera* camera_;
  const std::vector<ArenaBox>* moving_;
  Eigen::Isometry3d map_from_camera_;
  Eigen::Matrix3f rotation_;
  Eigen::Vector3f from_;
  std::vector<Placed> placed_;
  std::vector<std::vector<int>> candidates_;  ///< per tile
};

}  // namespace omnifleet::raycast
