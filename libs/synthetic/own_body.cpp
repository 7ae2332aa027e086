#include "synthetic/own_body.h"

#include <algorithm>
#include <array>

#include "synthetic/stage_set.h"

namespace omnifleet::synthetic {
namespace {

constexpr int kContourSamples = 6;  // rays per axis of a contour pixel; computed once per camera

/// An arena that contains only this robot, at the origin.
Arena aloneAtOrigin(const Arena& arena, int robot) {
  Arena alone;
  alone.light = arena.light;
  alone.light.gradient_per_m.setZero();
  alone.light.spot = 0.0;
  alone.light.flicker = 0.0;
  alone.light.level = 1.0;
  alone.markers = arena.markers;
  alone.robots.push_back(arena.robots[static_cast<std::size_t>(robot)]);
  return alone;
}

struct Sample {
  int face = -1;
  Eigen::Array4f bgr = Eigen::Array4f::Zero();
};

Sample sampleAt(const StageSet& body, const Eigen::Vector3f& origin_m, const Eigen::Vector3f& ray) {
  RayPacket packet;
  std::fill_n(packet.x, RayPacket::kSize, ray.x());
  std::fill_n(packet.y, RayPacket::kSize, ray.y());
  std::fill_n(packet.z, RayPacket::kSize, ray.z());
  packet.wanted = 1;
  body.tracer().trace(origin_m, packet);
  if (packet.solid[0] < 0) return {};
  return {body.faceId(packet.solid[0], packet.triangle[0]),
          body.colour(packet.solid[0], packet.triangle[0], origin_m + packet.distance[0] * ray)};
}

OwnPixel average(const StageSet& body, const Eigen::Vector3f& origin_m, const PixelTable& pixels, int u,
                 int v) {
  OwnPixel pixel;
  pixel.index = static_cast<std::uint32_t>(pixels.index(u, v));
  int hits = 0;
  for (int a = 0; a < kContourSamples; ++a) {
    for (int b = 0; b < kContourSamples; ++b) {
      const float du = (static_cast<float>(a) + 0.5f) / kContourSamples - 0.5f;
      const float dv = (static_cast<float>(b) + 0.5f) / kContourSamples - 0.5f;
      const Sample sample = sampleAt(body, origin_m, pixels.rayBeside(u, v, du, dv));
      if (sample.face < 0) continue;
      pixel.bgr += sample.bgr;
      ++hits;
    }
  }
  pixel.share = static_cast<float>(hits) / (kContourSamples * kContourSamples);
  if (hits > 0) pixel.bgr /= static_cast<float>(hits);
  return pixel;
}

}  // namespace

std::vector<OwnPixel> ownBodyPixels(const Arena& arena, int robot, const lens::Camera& camera,
                                    const PixelTable& pixels, std::uint32_t seed) {
  if (robot < 0) return {};
  const Arena alone = aloneAtOrigin(arena, robot);
  const RobotBody& body = alone.robots.front().body;
  if (camera.height() <= body.height_m && contains(body.outline(), camera.foot())) return {};
  StageSet stage(alone, -1, seed);
  stage.place(alone, 0.0, {Pose2{}}, Pose2{});
  const Eigen::Vector3f origin_m = camera.model().position_m.cast<float>();
  stage.aim(origin_m);

  std::vector<Sample> samples(pixels.backdrop.size());
  for (int v = 0; v < pixels.height(); ++v) {
    for (int u = 0; u < pixels.width(); ++u) {
      const std::size_t i = pixels.index(u, v);
      const PixelTable::Cone cone{pixels.ray(u, v), 0.0f};
      if (pixels.backdrop[i] != Backdrop::kNothing && stage.mayShow(cone)) {
        samples[i] = sampleAt(stage, origin_m, cone.axis);
      }
    }
  }
  std::vector<OwnPixel> own;
  const auto faceAt = [&](int u, int v) {
    return u < 0 || v < 0 || u >= pixels.width() || v >= pixels.height() ? -1
                                                                         : samples[pixels.index(u, v)].face;
  };
  for (int v = 0; v < pixels.height(); ++v) {
    for (int u = 0; u < pixels.width(); ++u) {
      const std::size_t i = pixels.index(u, v);
      if (pixels.backdrop[i] == Backdrop::kNothing) continue;
      const int face = samples[i].face;
      const bool contour = face != faceAt(u + 1, v) || face != faceAt(u - 1, v) || face != faceAt(u, v + 1) ||
                           face != faceAt(u, v - 1);
      if (contour) {
        const OwnPixel pixel = average(stage, origin_m, pixels, u, v);
        if (pixel.share > 0.0f) own.push_back(pixel);
      } else if (face >= 0) {
        own.push_back({static_cast<std::uint32_t>(i), 1.0f, samples[i].bgr});
      }
    }
  }
  return own;
}

}  // namespace omnifleet::synthetic
