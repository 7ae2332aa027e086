#include "tests/unit/distance_vector/ray_caster.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace omnifleet::test {
namespace {

/// Brightness of the sides of a block.
constexpr float kFaces[4] = {1.0f, 0.75f, 0.88f, 0.65f};
constexpr double kNever = std::numeric_limits<double>::infinity();

/// Entry and exit of a horizontal line into a block, and which side it enters.
struct Crossing {
  double in = kNever, out = -kNever;
  int side = 0;  ///< 0–3
};

Crossing cross(const Block& block, const Eigen::Vector2d& from, const Eigen::Vector2d& along) {
  const double c = std::cos(block.yaw_rad), s = std::sin(block.yaw_rad);
  const Eigen::Vector2d d = from - block.centre_m;
  const Eigen::Vector2d p(c * d.x() + s * d.y(), -s * d.x() + c * d.y());
  const Eigen::Vector2d a(c * along.x() + s * along.y(), -s * along.x() + c * along.y());
  double in = -kNever, out = kNever;
  int side = 0;
  for (int k = 0; k < 2; ++k) {
    if (std::abs(a[k]) < 1e-12) {
      if (std::abs(p[k]) > block.half_m[k]) return {};
      continue;
    }
    double first = (-block.half_m[k] - p[k]) / a[k], second = (block.half_m[k] - p[k]) / a[k];
    const int entered = 2 * k + (first < second ? 0 : 1);
    if (first > second) std::swap(first, second);
    if (first > in) {
      in = first;
      side = entered;
    }
    out = std::min(out, second);
  }
  if (in >= out || in <= 0.0) return {};
  return {in, out, side};
}

/// Distance to the walls of the room and which one.
std::pair<double, int> crossWalls(const World& world, const Eigen::Vector2d& from,
                                  const Eigen::Vector2d& along) {
  std::pair<double, int> nearest{kNever, 0};
  if (world.room_half_m.x() <= 0.0) return nearest;
  for (int k = 0; k < 2; ++k) {
    if (std::abs(along[k]) < 1e-12) continue;
    const double t = ((along[k] > 0 ? 1 : -1) * world.room_half_m[k] - from[k]) / along[k];
    if (t > 0.0 && t < nearest.first) nearest = {t, 2 * k + (along[k] > 0 ? 0 : 1)};
  }
  return nearest;
}

double lattice(std::uint32_t seed, int x, int y) {
  std::uint32_t h = seed * 2654435761u ^ static_cast<std::uint32_t>(x) * 2246822519u ^
                    static_cast<std::uint32_t>(y) * 3266489917u;
  h ^= h >> 15;
  h *= 2246822519u;
  h ^= h >> 13;
  h *= 3266489917u;
  h ^= h >> 16;
  return h / 4294967295.0 * 2.0 - 1.0;
}

double smoothNoise(std::uint32_t seed, double x, double y) {
  const double fx = std::floor(x), fy = std::floor(y);
  double a = x - fx, b = y - fy;
  a = a * a * (3 - 2 * a);
  b = b * b * (3 - 2 * b);
  const int i = static_cast<int>(fx), j = static_cast<int>(fy);
  return (1 - b) * ((1 - a) * lattice(seed, i, j) + a * lattice(seed, i + 1, j)) +
         b * ((1 - a) * lattice(seed, i, j + 1) + a * lattice(seed, i + 1, j + 1));
}

cv::Vec3f floorColour(const World& world, const Eigen::Vector2d& p) {
  double factor = 1.0;
  for (const double cell_m : {0.25, 0.06, 0.012, 0.004})
    factor += world.texture * smoothNoise(world.seed + static_cast<std::uint32_t>(1e4 * cell_m),
                                          p.x() / cell_m, p.y() / cell_m);
  if (world.grid_m > 0.0) {
    for (int k = 0; k < 2; ++k) {
      const double off = p[k] - world.grid_m * std::round(p[k] / world.grid_m);
      if (std::abs(off) < 0.5 * world.grid_line_m)
        factor *= k == 0 || factor > world.grid_factor ? world.grid_factor : 1.0;
    }
  }
  cv::Vec3f colour = world.floor_bgr * static_cast<float>(factor);
  for (const Spot& spot : world.spots)
    if ((p - spot.centre_m).norm() < spot.radius_m) colour = colour.mul(spot.factor);
  return colour;
}

float light(const World& world, const Eigen::Vector2d& p) {
  return static_cast<float>(std::clamp(1.0 + world.light_per_m.dot(p), 0.3, 1.8));
}

}  // namespace

lens::CameraModel forwardCamera() {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 320;
  model.image_height_px = 240;
  model.focal_px = {160.0, 160.0};
  model.principal_point_px = {159.5, 119.5};
  model.distortion = {-0.03, 0.004, 0.0005, -0.0003, 0.0};
  model.position_m = {0.04, 0.0, 0.085};
  model.rotation_rpy_deg = {0.0, -78.0, 0.0};
  return model;
}

RayCaster::RayCaster(const lens::Camera& camera, int samples) : camera_(camera), samples_(samples) {
  const lens::CameraModel& model = camera.model();
  for (int v = 0; v < model.image_height_px; ++v) {
    for (int u = 0; u < model.image_width_px; ++u) {
      for (int k = 0; k < samples * samples; ++k) {
        const Eigen::Vector2d pixel(u - 0.5 + (k % samples + 0.5) / samples,
                                    v - 0.5 + (k / samples + 0.5) / samples);
        const auto ray = camera.rayFromPixel(pixel);
        const Eigen::Vector3d r = ray ? *ray : Eigen::Vector3d(1, 0, 0.2);
        rays_.push_back({static_cast<float>(r.x()), static_cast<float>(r.y()), static_cast<float>(r.z())});
      }
    }
  }
}

cv::Vec3f RayCaster::trace(const World& world, const Eigen::Vector3d& from,
                           const Eigen::Vector3d& along) const {
  const Eigen::Vector2d from2 = from.head<2>(), along2 = along.head<2>();
  double nearest = along.z() < 0.0 ? -from.z() / along.z() : kNever;
  cv::Vec3f colour = world.sky_bgr;
  if (nearest < 50.0) {
    const Eigen::Vector2d p = from2 + nearest * along2;
    colour = floorColour(world, p) * light(world, p);
  }
  const auto [wall_t, wall] = crossWalls(world, from2, along2);
  if (wall_t < nearest && from.z() + wall_t * along.z() < world.wall_height_m) {
    nearest = wall_t;
    colour = world.wall_bgr[wall] * light(world, from2 + wall_t * along2);
  }
  for (const Block& block : world.blocks) {
    const Crossing at = cross(block, from2, along2);
    if (!(at.in < nearest)) continue;
    const double z = from.z() + at.in * along.z();
    if (z <= block.height_m && z >= 0.0) {
      nearest = at.in;
      colour = block.bgr * kFaces[at.side] * light(world, from2 + at.in * along2);
    } else if (z > block.height_m && from.z() + at.out * along.z() < block.height_m) {
      const double t = (block.height_m - from.z()) / along.z();
      if (t >= nearest) continue;
      nearest = t;
      colour = block.bgr * 1.15f * light(world, from2 + t * along2);
    }
  }
  return colour;
}

cv::Mat RayCaster::render(const World& world, const RobotPose& pose, double noise_sigma,
                          int jpeg_quality) const {
  const int width = camera_.model().image_width_px, height = camera_.model().image_height_px;
  const double c = std::cos(pose.yaw_rad), s = std::sin(pose.yaw_rad);
  const Eigen::Vector2d foot = camera_.foot();
  const Eigen::Vector3d from(pose.position_m.x() + c * foot.x() - s * foot.y(),
                             pose.position_m.y() + s * foot.x() + c * foot.y(), camera_.height());
  std::mt19937 random(world.seed * 7919u + 13u);
  std::normal_distribution<float> noise(0.0f, 1.0f);
  cv::Mat3b image(height, width);
  const int n = samples_ * samples_;
  std::size_t next = 0;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      cv::Vec3f sum(0, 0, 0);
      for (int k = 0; k < n; ++k) {
        const Ray& r = rays_[next++];
        sum += trace(world, from, {c * r.x - s * r.y, s * r.x + c * r.y, static_cast<double>(r.z)});
      }
      for (int k = 0; k < 3; ++k)
        image(v, u)[k] = cv::saturate_cast<std::uint8_t>(sum[k] / static_cast<float>(n) +
                                                         static_cast<float>(noise_sigma) * noise(random));
    }
  }
  if (jpeg_quality <= 0) return image;
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
  return cv::imdecode(bytes, cv::IMREAD_COLOR);
}

std::optional<double> RayCaster::truth(const World& world, const RobotPose& pose, double bearing_rad) const {
  const double c = std::cos(pose.yaw_rad), s = std::sin(pose.yaw_rad);
  const Eigen::Vector2d foot = camera_.foot();
  const Eigen::Vector2d from(pose.position_m.x() + c * foot.x() - s * foot.y(),
                             pose.position_m.y() + s * foot.x() + c * foot.y());
  const Eigen::Vector2d along(std::cos(pose.yaw_rad + bearing_rad), std::sin(pose.yaw_rad + bearing_rad));
  double nearest = crossWalls(world, from, along).first;
  for (const Block& block : world.blocks) nearest = std::min(nearest, cross(block, from, along).in);
  if (!(nearest < kNever)) return std::nullopt;
  const auto pixel = camera_.pixelFromPoint(
      {foot.x() + nearest * std::cos(bearing_rad), foot.y() + nearest * std::sin(bearing_rad), 0.0});
  if (!pixel || pixel->x() < 0.0 || pixel->y() < 0.0 || pixel->x() > camera_.model().image_width_px - 1 ||
      pixel->y() > camera_.model().image_height_px - 1)
    return std::nullopt;
  return nearest;
}

World randomWorld(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto in = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const cv::Vec3f floors[] = {
      {118, 122, 126}, {150, 165, 180}, {90, 100, 95}, {105, 135, 165}, {185, 190, 195}};
  const cv::Vec3f colours[] = {{40, 45, 170}, {160, 90, 40}, {60, 150, 70},  {40, 170, 210}, {235, 235, 235},
                               {45, 45, 45},  {60, 85, 120}, {150, 60, 140}, {190, 170, 60}};
  World world;
  world.seed = seed;
  world.floor_bgr = floors[random() % 5];
  world.texture = in(0.01, 0.05);
  world.light_per_m = {in(-0.25, 0.25), in(-0.25, 0.25)};
  world.room_half_m = {in(0.7, 1.6), in(0.5, 1.4)};
  const auto colour = [&] {  // every face differs from the floor by 25 grey levels, or as much in hue
    for (;;) {
      const cv::Vec3f c = colours[random() % 9];
      double nearest = 1e3;
      for (const float face : kFaces) nearest = std::min(nearest, cv::norm(c * face - world.floor_bgr));
      if (nearest > 43.0) return c;
    }
  };
  for (cv::Vec3f& wall : world.wall_bgr) wall = colour();
  const int blocks = 3 + static_cast<int>(random() % 5);
  for (int i = 0; i < blocks; ++i) {
    Block block;
    const double range = in(0.2, 1.3), bearing = in(-0.9, 0.9);
    block.centre_m = {range * std::cos(bearing), range * std::sin(bearing)};
    block.half_m = {in(0.02, 0.12), in(0.02, 0.12)};
    block.yaw_rad = in(-1.57, 1.57);
    block.height_m = in(0.10, 0.25);
    block.bgr = colour();
    if ((block.centre_m - Eigen::Vector2d(0.04, 0)).norm() > block.half_m.norm() + 0.12)
      world.blocks.push_back(block);
  }
  return world;
}

}  // namespace omnifleet::test
