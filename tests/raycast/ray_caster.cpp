#include "tests/raycast/ray_caster.h"

#include <cmath>
#include <cstdint>
#include <opencv2/core/utility.hpp>
#include <random>

#include "tests/raycast/ray_scene.h"
#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {

using Vector = Eigen::Vector3d;

cv::Mat3b render(const Room& room, const lens::CameraModel& camera, const Pose2& map_from_camera,
                 const std::vector<Solid>& robots, unsigned frame) {
  constexpr int kSamples = 2;  // per axis
  const std::vector<Placed> solids = placedIn(room, robots);
  cv::Mat3b image(camera.image_height_px, camera.image_width_px, cv::Vec3b(0, 0, 0));
  const Vector from(map_from_camera.x_m, map_from_camera.y_m, camera.position_m.z());
  cv::parallel_for_({0, image.rows}, [&](const cv::Range& rows) {
    for (int v = rows.start; v < rows.end; ++v) {
      std::mt19937 random(mixed(room.seed) ^ mixed(frame * 4099U + static_cast<unsigned>(v)));
      std::normal_distribution<double> noise(0.0, room.noise);
      for (int u = 0; u < image.cols; ++u) {
        Vector sum = Vector::Zero();
        bool seen = true;
        for (int k = 0; k < kSamples * kSamples && seen; ++k) {
          const Eigen::Vector2d off = Eigen::Vector2d(u + (k % kSamples + 0.5) / kSamples - 0.5,
                                                      v + (k / kSamples + 0.5) / kSamples - 0.5) -
                                      camera.principal_point_px;
          const double angle = angleAt(camera, off.norm());
          seen = angle >= 0.0;
          if (!seen) break;
          const Eigen::Vector2d ahead = Eigen::Vector2d(-off.y(), -off.x()) / std::max(1e-9, off.norm());
          const Eigen::Vector2d turned = map_from_camera.rotation() * ahead;
          const double off_axis = angle / (0.5 * M_PI), reaches = 1.0 - room.vignette * off_axis * off_axis;
          const unsigned chance = mixed(static_cast<unsigned>(u) * 4U + static_cast<unsigned>(k)) ^
                                  mixed(frame * 8191U + static_cast<unsigned>(v));
          const Vector along(std::sin(angle) * turned.x(), std::sin(angle) * turned.y(), -std::cos(angle));
          sum += reaches * radianceOf(room, solids, firstHit(solids, from, along), from, along, chance);
        }
        if (!seen) continue;
        for (int c = 0; c < 3; ++c)
          image(v, u)[2 - c] = cv::saturate_cast<std::uint8_t>(
              toneOf(room, room.light * sum[c] / (kSamples * kSamples)) + noise(random));
      }
    }
  });
  return image;
}

dataset::MapObject truthOf(const Solid& solid, std::uint64_t id) {
  constexpr int kCorners = 48;
  dataset::MapObject object;
  object.id = id;
  object.height_m = solid.height_m;
  for (int k = 0; k < (solid.round ? kCorners : 4); ++k) {
    const double angle = 2.0 * M_PI * (k + (solid.round ? 0.0 : 0.5)) / (solid.round ? kCorners : 4);
    const Eigen::Vector2d corner =
        solid.round
            ? Eigen::Vector2d(0.5 * solid.size_m.x() * Eigen::Vector2d(std::cos(angle), std::sin(angle)))
            : Eigen::Vector2d(std::copysign(0.5 * solid.size_m.x(), std::cos(angle)),
                              std::copysign(0.5 * solid.size_m.y(), std::sin(angle)));
    object.outline_m.push_back(solid.map_from_solid * corner);
  }
  object.centroid_m = solid.map_from_solid.translation();
  return object;
}

}  // namespace omnifleet::raycast
