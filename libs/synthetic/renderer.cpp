#include "synthetic/renderer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "synthetic/floor_map.h"
#include "synthetic/own_body.h"
#include "synthetic/pixel_table.h"
#include "synthetic/sensor.h"
#include "synthetic/shadows.h"
#include "synthetic/stage_set.h"
#include "synthetic/value_noise.h"

namespace omnifleet::synthetic {
namespace {

const Eigen::Array4f kSkyBgr(72.0f, 67.0f, 62.0f, 0.0f);

std::uint32_t hashOf(const std::string& text) {
  std::uint32_t value = 2166136261U;
  for (const char c : text) value = (value ^ static_cast<unsigned char>(c)) * 16777619U;
  return value;
}

}  // namespace

struct Renderer::Impl {
  Impl(const Arena& the_arena, const std::string& camera_id, std::uint32_t the_seed);

  void drawBackdrop(const Pose2& map_from_parent);
  Eigen::Array4f floorAt(std::size_t pixel, const Eigen::Vector2f& place_m) const;
  Eigen::Array4f backdropAt(std::size_t pixel, const Pose2& map_from_parent) const;
  void put(std::size_t pixel, const Eigen::Array4f& bgr);
  void findTiles();
  void traceTile(int tile_u, int tile_v);
  void smoothTile(int tile_u, int tile_v, const Pose2& map_from_parent);
  bool onContour(int u, int v) const;
  Eigen::Array4f average(int u, int v, const Pose2& map_from_parent) const;
  void drawOwnBody(const Pose2& map_from_parent);
  void makeBrightness();

  Arena arena;
  ArenaCamera spec;
  int own_robot;
  std::uint32_t seed, camera_seed;
  lens::Camera camera;
  PixelTable pixels;
  FloorMap floor;
  Shadows shadows;
  StageSet stage;
  Sensor sensor;
  std::vector<OwnPixel> own;
  std::vector<std::uint8_t> hidden;  ///< completely behind the own body
  std::vector<std::uint8_t> level;   ///< level of the floor tile
  std::vector<float> brightness;     ///< gain and vignetting per pixel
  float flicker = 1.0f;
  Eigen::Vector3f eye_m;
  cv::Mat light, still_backdrop;
  std::vector<int> faces;                       ///< visible face per pixel; −1: none
  std::vector<std::pair<int, int>> tiles;       ///< tiles traced in this frame
  std::vector<std::pair<float, float>> beside;  ///< offsets of the rays within a contour pixel
};

Renderer::Impl::Impl(const Arena& the_arena, const std::string& camera_id, std::uint32_t the_seed)
    : arena(the_arena),
      spec(the_arena.camera(camera_id)),
      own_robot(the_arena.robotIndex(spec.robot)),
      seed(the_seed),
      camera_seed(hash32(the_seed, hashOf(camera_id))),
      camera(spec.model),
      pixels(camera),
      floor(the_arena, the_seed),
      shadows(arena),
      stage(the_arena, own_robot, the_seed),
      sensor(the_arena.image),
      own(ownBodyPixels(the_arena, own_robot, camera, pixels, the_seed)),
      eye_m(spec.model.position_m.cast<float>()) {
  hidden.assign(pixels.backdrop.size(), 0);
  for (const OwnPixel& pixel : own) hidden[pixel.index] = pixel.share >= 1.0f ? 1 : 0;
  for (const float footprint_m : pixels.footprint_m) level.push_back(floor.levelFor(footprint_m));
  faces.assign(pixels.backdrop.size(), -1);
  light = cv::Mat::zeros(pixels.height(), pixels.width(), CV_16UC3);
  makeBrightness();
  // Hammersley points: every line through the pixel divides them almost in proportion to its area.
  const int n = arena.image.edge_samples * arena.image.edge_samples;
  for (int i = 0; i < n; ++i) {
    double mirrored = 0.0, digit = 0.5;
    for (int bits = i; bits; bits >>= 1, digit *= 0.5) mirrored += (bits & 1) * digit;
    beside.emplace_back(static_cast<float>((i + 0.5) / n - 0.5),
                        static_cast<float>(mirrored + 0.5 / n - 0.5));
  }
}

void Renderer::Impl::makeBrightness() {
  const Eigen::Vector2d centre = spec.model.principal_point_px;
  const double rim_px = 0.5 * std::min(pixels.width(), pixels.height());
  for (int v = 0; v < pixels.height(); ++v) {
    for (int u = 0; u < pixels.width(); ++u) {
      const double r = (Eigen::Vector2d(u, v) - centre).norm() / rim_px;
      const double fall = std::max(0.05, 1.0 - arena.image.vignetting * r * r);
      brightness.push_back(static_cast<float>(arena.image.gain * fall * Sensor::kScale));
    }
  }
}

void Renderer::Impl::put(std::size_t pixel, const Eigen::Array4f& bgr) {
  const Eigen::Array4f scaled = (bgr * (brightness[pixel] * flicker) + 0.5f).min(65535.0f);
  auto* out = light.ptr<std::uint16_t>() + 3 * pixel;
  for (int c = 0; c < 3; ++c) out[c] = static_cast<std::uint16_t>(scaled[c]);
}

Eigen::Array4f Renderer::Impl::floorAt(std::size_t pixel, const Eigen::Vector2f& place_m) const {
  const Eigen::Array4f lit = floor.at(place_m.x(), place_m.y(), level[pixel]);
  return shadows.any() ? (lit * shadows.at(place_m)).eval() : lit;
}

Eigen::Array4f Renderer::Impl::backdropAt(std::size_t pixel, const Pose2& map_from_parent) const {
  if (pixels.backdrop[pixel] != Backdrop::kFloor) return kSkyBgr;
  const Eigen::Vector2d place_m = map_from_parent * pixels.floor_m[pixel].cast<double>();
  return floorAt(pixel, place_m.cast<float>());
}

void Renderer::Impl::drawBackdrop(const Pose2& map_from_parent) {
  const bool still = own_robot < 0 && arena.light.flicker == 0.0 && arena.moves.empty() && !shadows.any();
  if (still && !still_backdrop.empty()) {
    still_backdrop.copyTo(light);
    return;
  }
  const auto c = static_cast<float>(std::cos(map_from_parent.theta_rad));
  const auto s = static_cast<float>(std::sin(map_from_parent.theta_rad));
  const auto x_m = static_cast<float>(map_from_parent.x_m), y_m = static_cast<float>(map_from_parent.y_m);
  for (std::size_t i = 0; i < pixels.backdrop.size(); ++i) {
    if (pixels.backdrop[i] == Backdrop::kNothing || hidden[i]) continue;
    if (pixels.backdrop[i] == Backdrop::kSky) {
      put(i, kSkyBgr);
      continue;
    }
    const Eigen::Vector2f& p = pixels.floor_m[i];
    put(i, floorAt(i, {c * p.x() - s * p.y() + x_m, s * p.x() + c * p.y() + y_m}));
  }
  if (still) still_backdrop = light.clone();
}

void Renderer::Impl::findTiles() {
  tiles.clear();
  for (int block_v = 0; block_v < pixels.block_rows; ++block_v) {
    for (int block_u = 0; block_u < pixels.block_columns; ++block_u) {
      if (!stage.mayShow(pixels.blocks[static_cast<std::size_t>(block_v) * pixels.block_columns + block_u]))
        continue;
      const int end_v = std::min((block_v + 1) * PixelTable::kBlock, pixels.tile_rows);
      const int end_u = std::min((block_u + 1) * PixelTable::kBlock, pixels.tile_columns);
      for (int v = block_v * PixelTable::kBlock; v < end_v; ++v) {
        for (int u = block_u * PixelTable::kBlock; u < end_u; ++u) {
          if (stage.mayShow(pixels.tiles[static_cast<std::size_t>(v) * pixels.tile_columns + u]))
            tiles.emplace_back(u, v);
        }
      }
    }
  }
}

void Renderer::Impl::traceTile(int tile_u, int tile_v) {
  RayPacket rays;
  std::size_t index[RayPacket::kSize];
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const int u = tile_u * PixelTable::kTile + i % PixelTable::kTile;
    const int v = tile_v * PixelTable::kTile + i / PixelTable::kTile;
    const bool inside = u < pixels.width() && v < pixels.height();
    index[i] = inside ? pixels.index(u, v) : 0;
    rays.x[i] = pixels.x[index[i]];
    rays.y[i] = pixels.y[index[i]];
    rays.z[i] = pixels.z[index[i]];
    if (inside && pixels.backdrop[index[i]] != Backdrop::kNothing && !hidden[index[i]])
      rays.wanted |= 1U << i;
  }
  if (!rays.wanted) return;
  stage.tracer().trace(eye_m, rays);
  for (int i = 0; i < RayPacket::kSize; ++i) {
    if (rays.solid[i] < 0) continue;
    const Eigen::Vector3f point = eye_m + rays.distance[i] * Eigen::Vector3f(rays.x[i], rays.y[i], rays.z[i]);
    faces[index[i]] = stage.faceId(rays.solid[i], rays.triangle[i]);
    put(index[i], stage.colour(rays.solid[i], rays.triangle[i], point) / flicker);
  }
}

bool Renderer::Impl::onContour(int u, int v) const {
  const std::size_t i = pixels.index(u, v);
  if (pixels.backdrop[i] == Backdrop::kNothing || hidden[i]) return false;
  const int face = faces[i];
  return (u > 0 && faces[i - 1] != face) || (u + 1 < pixels.width() && faces[i + 1] != face) ||
         (v > 0 && faces[i - pixels.width()] != face) ||
         (v + 1 < pixels.height() && faces[i + pixels.width()] != face);
}

Eigen::Array4f Renderer::Impl::average(int u, int v, const Pose2& map_from_parent) const {
  Eigen::Array4f sum = Eigen::Array4f::Zero();
  int missed = 0;
  RayPacket rays;
  for (std::size_t first = 0; first < beside.size(); first += RayPacket::kSize) {
    const std::size_t count = std::min<std::size_t>(RayPacket::kSize, beside.size() - first);
    for (std::size_t i = 0; i < RayPacket::kSize; ++i) {
      const auto& [du, dv] = beside[std::min(first + i, beside.size() - 1)];
      const Eigen::Vector3f ray = pixels.rayBeside(u, v, du, dv);
      rays.x[i] = ray.x();
      rays.y[i] = ray.y();
      rays.z[i] = ray.z();
    }
    rays.wanted = (1U << count) - 1U;
    stage.tracer().trace(eye_m, rays);
    for (std::size_t i = 0; i < count; ++i) {
      if (rays.solid[i] < 0) {
        ++missed;
        continue;
      }
      const Eigen::Vector3f point =
          eye_m + rays.distance[i] * Eigen::Vector3f(rays.x[i], rays.y[i], rays.z[i]);
      sum += stage.colour(rays.solid[i], rays.triangle[i], point) / flicker;
    }
  }
  if (missed > 0) sum += static_cast<float>(missed) * backdropAt(pixels.index(u, v), map_from_parent);
  return sum / static_cast<float>(beside.size());
}

void Renderer::Impl::smoothTile(int tile_u, int tile_v, const Pose2& map_from_parent) {
  const int end_u = std::min((tile_u + 1) * PixelTable::kTile, pixels.width());
  const int end_v = std::min((tile_v + 1) * PixelTable::kTile, pixels.height());
  for (int v = tile_v * PixelTable::kTile; v < end_v; ++v) {
    for (int u = tile_u * PixelTable::kTile; u < end_u; ++u) {
      if (onContour(u, v)) put(pixels.index(u, v), average(u, v, map_from_parent));
    }
  }
}

void Renderer::Impl::drawOwnBody(const Pose2& map_from_parent) {
  const auto here = static_cast<float>(arena.light.at(map_from_parent.translation(), 0.0));
  for (const OwnPixel& pixel : own) {
    if (pixel.share >= 1.0f) {
      put(pixel.index, pixel.bgr * here);
      continue;
    }
    const auto* seen = light.ptr<std::uint16_t>() + 3 * pixel.index;
    const Eigen::Array4f behind(seen[0], seen[1], seen[2], 0.0f);
    const Eigen::Array4f background = behind / (brightness[pixel.index] * flicker);
    put(pixel.index, pixel.share * here * pixel.bgr + (1.0f - pixel.share) * background);
  }
}

Renderer::Renderer(const Arena& arena, const std::string& camera_id, std::uint32_t seed)
    : impl_(std::make_unique<Impl>(arena, camera_id, seed)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

const lens::CameraModel& Renderer::model() const {
  return impl_->spec.model;
}

void Renderer::render(int frame, const std::vector<Pose2>& map_from_bases, cv::Mat& bgr) {
  Impl& im = *impl_;
  if (map_from_bases.size() != im.arena.robots.size())
    throw std::runtime_error("render: needs one pose per robot of the arena");
  if (bgr.empty()) bgr.create(im.pixels.height(), im.pixels.width(), CV_8UC3);
  if (bgr.type() != CV_8UC3 || bgr.cols != im.pixels.width() || bgr.rows != im.pixels.height()) {
    throw std::runtime_error("render: the image must be CV_8UC3 and have the size of the camera");
  }
  const double time_s = static_cast<double>(frame) / im.arena.rate_hz;
  const Pose2 map_from_parent =
      im.own_robot < 0 ? Pose2{} : map_from_bases[static_cast<std::size_t>(im.own_robot)];
  im.flicker = static_cast<float>(im.arena.light.at({0.0, 0.0}, time_s) / im.arena.light.at({0.0, 0.0}, 0.0));
  im.floor.update(im.arena, time_s);
  im.shadows.place(time_s, map_from_bases);
  im.stage.place(im.arena, time_s, map_from_bases, map_from_parent.inverse());
  im.stage.aim(im.eye_m);

  im.drawBackdrop(map_from_parent);
  im.findTiles();
  for (const auto& [u, v] : im.tiles) im.traceTile(u, v);
  for (const auto& [u, v] : im.tiles) im.smoothTile(u, v, map_from_parent);
  for (const auto& [u, v] : im.tiles) {
    const int end_u = std::min((u + 1) * PixelTable::kTile, im.pixels.width());
    const int end_v = std::min((v + 1) * PixelTable::kTile, im.pixels.height());
    for (int y = v * PixelTable::kTile; y < end_v; ++y) {
      for (int x = u * PixelTable::kTile; x < end_u; ++x) im.faces[im.pixels.index(x, y)] = -1;
    }
  }
  im.drawOwnBody(map_from_parent);
  im.sensor.develop(im.light, hash32(im.camera_seed, static_cast<std::uint32_t>(frame)), bgr);
}

}  // namespace omnifleet::synthetic
