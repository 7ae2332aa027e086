#include "tests/raycast/arena_renderer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core/utility.hpp>

#include "tests/raycast/random.h"
#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

cv::Vec3f bgrOf(const Eigen::Vector3f& rgb) {
  return {rgb.z(), rgb.y(), rgb.x()};
}

/// True if a neighbour of the pixel shows another surface.
bool isEdge(const cv::Mat1i& keys, int u, int v) {
  const int key = keys(v, u);
  for (int y = std::max(0, v - 1); y <= std::min(keys.rows - 1, v + 1); ++y)
    for (int x = std::max(0, u - 1); x <= std::min(keys.cols - 1, u + 1); ++x)
      if (keys(y, x) != key) return true;
  return false;
}

/// Grey levels of linear light in steps of 1/(size − 1).
const std::vector<float>& toneCurve() {
  static const std::vector<float> kCurve = [] {
    std::vector<float> curve(8193);
    for (std::size_t k = 0; k < curve.size(); ++k) {
      const double linear = static_cast<double>(k) / static_cast<double>(curve.size() - 1);
      curve[k] = static_cast<float>(
          255.0 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055));
    }
    return curve;
  }();
  return kCurve;
}

/// Normally distributed numbers, drawn by the bits of a hash.
const std::vector<float>& normals() {
  static const std::vector<float> kNormals = [] {
    Random random(12345U);
    std::vector<float> values(1U << 16U);
    for (float& value : values) value = static_cast<float>(random.normal(1.0));
    return values;
  }();
  return kNormals;
}

}  // namespace

template <typename Visit>
void ArenaRenderer::forPixels(const Tiles* only, const Visit& visit) const {
  constexpr int kSide = ArenaCamera::kTile_px;
  cv::parallel_for_({0, camera_.tileRows()}, [&](const cv::Range& range) {
    for (int row = range.start; row < range.end; ++row) {
      for (int column = 0; column < camera_.tileColumns(); ++column) {
        const auto tile = static_cast<std::size_t>(row * camera_.tileColumns() + column);
        if (only != nullptr && (*only)[tile] == 0) continue;
        for (int v = row * kSide; v < std::min(camera_.rows(), (row + 1) * kSide); ++v)
          for (int u = column * kSide; u < std::min(camera_.columns(), (column + 1) * kSide); ++u)
            visit(tile, u, v);
      }
    }
  });
}

void ArenaRenderer::findSurfaces(const ArenaView& view, const Tiles* only, cv::Mat1i& keys) const {
  constexpr int kMiddle = ArenaCamera::kSamples / 2;
  forPixels(only, [&](std::size_t tile, int u, int v) {
    keys(v, u) = view.surfaceAlong(tile, view.along(camera_.ray(u, v, kMiddle, kMiddle))).key();
  });
}

void ArenaRenderer::shade(const ArenaView& view, const Tiles* only, const cv::Mat1i& keys,
                          cv::Mat3f& image) const {
  constexpr int kSamples = ArenaCamera::kSamples;
  forPixels(only, [&](std::size_t tile, int u, int v) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    int count = 0;
    if (isEdge(keys, u, v)) {
      for (int k = 0; k < kSamples * kSamples; ++k, ++count) {
        const Eigen::Vector3f along = view.along(camera_.ray(u, v, k % kSamples, k / kSamples));
        sum += view.radiance(view.surfaceAlong(tile, along), along);
      }
    } else {
      const Surface3 surface = Surface3::fromKey(keys(v, u));
      for (; count < 2; ++count)
        sum += view.radiance(surface, view.along(camera_.ray(u, v, 1 + count, 3 * count)));
    }
    image(v, u) = bgrOf(sum / static_cast<float>(count));
  });
}

cv::Mat3f ArenaRenderer::fromRobot(const Pose2& map_from_base, const std::vector<ArenaBox>& moving,
                                   int own) const {
  const ArenaView view(*scene_, camera_, map_from_base, moving, own);
  cv::Mat1i keys(camera_.rows(), camera_.columns());
  cv::Mat3f image(camera_.rows(), camera_.columns());
  findSurfaces(view, nullptr, keys);
  shade(view, nullptr, keys, image);
  return image;
}

cv::Mat3f ArenaRenderer::fixed(const std::vector<ArenaBox>& moving) {
  if (background_.empty()) {
    background_keys_.create(camera_.rows(), camera_.columns());
    background_.create(camera_.rows(), camera_.columns());
    const std::vector<ArenaBox> none;
    const ArenaView view(*scene_, camera_, {}, none, -1);
    findSurfaces(view, nullptr, background_keys_);
    shade(view, nullptr, background_keys_, background_);
  }
  const ArenaView view(*scene_, camera_, {}, moving, -1);
  const Tiles tiles = view.tilesAroundMoving();
  cv::Mat1i keys = background_keys_.clone();
  cv::Mat3f image = background_.clone();
  findSurfaces(view, &tiles, keys);
  shade(view, &tiles, keys, image);
  return image;
}

cv::Mat3b developed(const cv::Mat3f& linear, double light, double noise, unsigned seed, unsigned frame) {
  constexpr float kVignette = 0.15F;  // share of light lost in the corners
  const std::vector<float>&curve = toneCurve(), &drawn = normals();
  const auto steps = static_cast<float>(curve.size() - 1);
  cv::Mat3b image(linear.size());
  const float middle_u = 0.5F * static_cast<float>(linear.cols),
              middle_v = 0.5F * static_cast<float>(linear.rows),
              corner2 = middle_u * middle_u + middle_v * middle_v;
  for (int v = 0; v < linear.rows; ++v) {
    std::uint32_t state = mixed(mixed(seed) + frame * 4099U + static_cast<std::uint32_t>(v)) | 1U;
    for (int u = 0; u < linear.cols; ++u) {
      const float du = static_cast<float>(u) - middle_u, dv = static_cast<float>(v) - middle_v;
      const float factor = static_cast<float>(light) * (1.0F - kVignette * (du * du + dv * dv) / corner2);
      for (int c = 0; c < 3; ++c) {
        state ^= state << 13U;  // xorshift
        state ^= state >> 17U;
        state ^= state << 5U;
        const float at = std::clamp(factor * linear(v, u)[c], 0.0F, 1.0F) * steps;
        image(v, u)[c] = cv::saturate_cast<std::uint8_t>(curve[static_cast<std::size_t>(at)] +
                                                         static_cast<float>(noise) * drawn[state & 0xffffU]);
      }
    }
  }
  return image;
}

}  // namespace omnifleet::raycast
