// Surface points in rendered rooms against the true surfaces. Their outline is compared with that of the same
// features projected to the floor, as in Choi et al. 2014 §III.5.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "evaluation/solid_metrics.h"
#include "local_mapper/local_mapper.h"
#include "outline/convex_hull.h"
#include "synthetic/renderer.h"

namespace omnifleet::local_mapper {
namespace {

const char* const kRoom = R"(
frames: {rate_hz: 5, duration_s: 12}
floor: {size_m: [7, 5]}
image: {noise: 1.5, shot_noise: 0.06}
obstacles:
  - {kind: box, pose: [0.0, 0.75, 0.3], size_m: [0.30, 0.22], height_m: 0.34, texture: 0.5, rgb: [190, 52, 40]}
  - {kind: cylinder, pose: [0.1, -0.8, 0], radius_m: 0.14, height_m: 0.20, texture: 0.5, rgb: [40, 78, 170]}
robots: {r1: {initial_pose: [0, 0, 0]}}
rigs:
  fisheye: {camera_model: fisheye, projection: equidistant, image_width: 640, image_height: 480, focal_px: 148.65932,
            principal_point_px: [319.5, 239.5], fov_deg: 185, position_m: [0, 0, 0.5], self_mask_radius_px: 99}
)";

struct Gathered {
  std::vector<double> away_m;               ///< signed distance of the points from the nearest true surface
  std::map<std::size_t, Polygon> on_floor;  ///< per solid, map: features projected to the floor
  std::map<std::size_t, Polygon> in_space;  ///< the same features at their positions in space
};

/// One robot drives past with true wheel odometry.
Gathered drivePast(const synthetic::Arena& arena) {
  const lens::Camera camera(arena.cameras.front().model);
  synthetic::Renderer renderer(arena, arena.cameras.front().id, 3);
  LocalMapper mapper(camera, {});
  Gathered gathered;
  cv::Mat image;
  Pose2 pose{-0.8, 0.05, 0.0};
  const Pose2 step{0.04, 0.0, -0.004};
  for (int k = 0; k < 40; ++k, pose = pose * step) {
    renderer.render(k, {pose}, image);
    Frame frame;
    frame.acquired_ns = arena.frameTimeNs(k);
    frame.sequence = static_cast<std::uint32_t>(k);
    frame.image = image;
    Motion motion;
    motion.valid = k > 0;
    motion.previous_from_current = step;
    motion.covariance = Eigen::Vector3d(1e-8, 1e-8, 1e-8).asDiagonal();
    motion.left_m = motion.right_m = step.x_m;
    for (const auto& object : mapper.process(frame, motion).objects) {
      for (const auto& vector : object.vectors) {
        if (!(vector.point.sigma_m > 0)) continue;
        const Eigen::Vector2d p = pose * Eigen::Vector2d(vector.point.point_m.head<2>().cast<double>());
        double least = 1e9;
        std::size_t nearest = 0;
        for (std::size_t i = 0; i < arena.solids.size(); ++i) {
          const double away =
              evaluation::surfaceDistance(arena.solids[i].footprint(), arena.solids[i].height_m,
                                          {p.x(), p.y(), vector.point.point_m.z()});
          if (std::abs(away) >= std::abs(least)) continue;
          least = away;
          nearest = i;
        }
        gathered.away_m.push_back(least);
        gathered.in_space[nearest].push_back(p);
        gathered.on_floor[nearest].push_back(pose * Eigen::Vector2d(vector.to_m.cast<double>()));
      }
    }
  }
  return gathered;
}

double areaOf(const Polygon& polygon) {
  double twice = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return 0.5 * twice;
}

/// Distance by which a hull extends beyond a footprint.
double smear(const Polygon& hull, const synthetic::Solid& solid) {
  double farthest = 0.0;
  for (const auto& p : hull) farthest = std::max(farthest, solid.distance(p, solid.map_from_solid));
  return farthest;
}

TEST(Points, LieOnSurfacesWithoutSmearingTheirHull) {
  const auto arena = synthetic::Arena::read(options::Section::parse(kRoom, "room"));
  Gathered gathered = drivePast(arena);
  auto& away = gathered.away_m;
  for (double& a : away) a = std::abs(a);
  std::sort(away.begin(), away.end());
  ASSERT_GT(away.size(), 60U);
  const double median = away[away.size() / 2], most = away[away.size() * 9 / 10];
  std::printf("%zu points, median %.4f m, 90 %% within %.4f m\n", away.size(), median, most);
  EXPECT_LT(median, 0.008);  // a third of a pixel of parallax over 20 cm at 0.8 m
  EXPECT_LT(most, 0.03);
  for (std::size_t i = 0; i < arena.solids.size(); ++i) {
    const Polygon floor = outline::convexHull(gathered.on_floor[i]),
                  space = outline::convexHull(gathered.in_space[i]);
    ASSERT_GE(space.size(), 3U);
    const auto& solid = arena.solids[i];
    std::printf(
        "solid %zu: reaches %.3f m beyond on the floor, %.3f m in space; area %.3f, %.3f of %.3f m2\n", i,
        smear(floor, solid), smear(space, solid), areaOf(floor), areaOf(space), areaOf(solid.footprint()));
    // The top is projected outward by h/(H − h) of its distance: 1.4 m for the box, 0.5 m for the cylinder.
    EXPECT_GT(smear(floor, solid), 0.5);
    // The worst point determines a hull: corners between an outline and its background move with the camera,
    // and a few of them are taken for static points.
    EXPECT_LT(smear(space, solid), 0.25 * smear(floor, solid));
    EXPECT_LT(areaOf(space), 2.0 * areaOf(solid.footprint()));
  }
}

}  // namespace
}  // namespace omnifleet::local_mapper
