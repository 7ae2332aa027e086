#include "tests/unit/services/local_mapper/fisheye_scene.h"

#include <cmath>
#include <random>

#include "tests/unit/services/local_mapper/silhouette_truth.h"

namespace omnifleet::local_mapper::testing {

lens::CameraModel fisheyeModel() {
  lens::CameraModel model;
  model.image_width_px = 640;
  model.image_height_px = 480;
  model.focal_px = {148.66, 148.66};
  model.principal_point_px = {319.5, 239.5};
  model.fov_deg = 185.0;
  model.position_m = {0.0, 0.0, 0.5};
  model.self_mask_radius_px = 99.0;
  return model;
}

Polygon box(double x, double y, double width, double depth, double angle_rad) {
  const Pose2 pose{x, y, angle_rad};
  return {pose * Eigen::Vector2d(-width / 2, -depth / 2), pose * Eigen::Vector2d(width / 2, -depth / 2),
          pose * Eigen::Vector2d(width / 2, depth / 2), pose * Eigen::Vector2d(-width / 2, depth / 2)};
}

Frame frameOf(const cv::Mat& image, std::uint32_t sequence) {
  Frame frame;
  frame.acquired_ns = 1000000000LL + 200000000LL * sequence;
  frame.sequence = sequence;
  frame.image = image;
  return frame;
}

namespace {

/// A prism in base_link with everything needed to render it.
struct Seen {
  Polygon top_m, silhouette_m;
  Eigen::Vector2d low, high;  ///< bounds of the silhouette
  const Prism* prism;
};

/// A texture fixed to the object, so that it has corners for the optical flow.
double texture(const Eigen::Vector2d& p) {
  return 0.85 + 0.15 * std::sin(90.0 * p.x()) * std::sin(80.0 * p.y() + 40.0 * p.x());
}

}  // namespace

cv::Mat3b renderScene(const Scene& scene, const lens::Camera& camera, const Pose2& world_from_base,
                      int samples) {
  std::vector<Seen> seen;
  for (const auto& prism : scene.prisms) {
    Seen s{{}, {}, {1e9, 1e9}, {-1e9, -1e9}, &prism};
    for (const auto& p : prism.footprint_m) s.top_m.push_back(world_from_base.inverse() * p);
    s.silhouette_m = prismSilhouette(s.top_m, prism.height_m, camera.foot(), camera.height());
    for (const auto& p : s.silhouette_m) {
      s.low = s.low.cwiseMin(p);
      s.high = s.high.cwiseMax(p);
    }
    seen.push_back(s);
  }
  const auto colourAt = [&](const Eigen::Vector2d& pixel) -> cv::Vec3d {
    const auto floor = camera.floorFromPixel(pixel);
    if (!floor) return {20, 20, 20};
    for (const auto& s : seen) {
      if ((floor->array() < s.low.array()).any() || (floor->array() > s.high.array()).any()) continue;
      if (!contains(s.silhouette_m, *floor)) continue;
      const auto top = camera.planeFromPixel(pixel, s.prism->height_m);
      const bool on_top = top && contains(s.top_m, *top);
      const double light = on_top ? texture(world_from_base * *top) : 0.7;
      return cv::Vec3d(s.prism->colour[0], s.prism->colour[1], s.prism->colour[2]) * light;
    }
    return {double(scene.floor[0]), double(scene.floor[1]), double(scene.floor[2])};
  };
  std::mt19937 random(scene.seed);
  std::normal_distribution<double> gauss(0.0, 1.0);
  cv::Mat3b image(camera.model().image_height_px, camera.model().image_width_px);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      cv::Vec3d sum(0, 0, 0);
      for (int k = 0; k < samples * samples; ++k)
        sum += colourAt({u - 0.5 + (k % samples + 0.5) / samples, v - 0.5 + (k / samples + 0.5) / samples});
      for (int c = 0; c < 3; ++c)
        image(v, u)[c] =
            cv::saturate_cast<std::uint8_t>(sum[c] / (samples * samples) + scene.noise * gauss(random));
    }
  }
  return image;
}

}  // namespace omnifleet::local_mapper::testing
