#include "synthetic/floor_map.h"

#include <algorithm>
#include <cmath>

#include "synthetic/value_noise.h"

namespace omnifleet::synthetic {
namespace {

constexpr float kCellM = 0.025f;  // cell of the coarse grid
constexpr float kBeyondM =
    3.0f;  // margin of the coarse grid around the floor; beyond it, the border values continue
constexpr float kTileM = 3.0f;  // approximate period of the fine tile

/// Share of [low, high] within half a width of a multiple of `period`.
float lineShare(float low, float high, float period, float width) {
  const float nearest = std::round(0.5f * (low + high) / period) * period;
  const float overlap = std::min(high, nearest + 0.5f * width) - std::max(low, nearest - 0.5f * width);
  return std::clamp(overlap / (high - low), 0.0f, 1.0f);
}

std::vector<Pose2> solidPoses(const Arena& arena, double time_s) {
  std::vector<Pose2> poses;
  for (std::size_t i = 0; i < arena.solids.size(); ++i)
    poses.push_back(arena.solidAt(static_cast<int>(i), time_s));
  return poses;
}

}  // namespace

FloorMap::FloorMap(const Arena& arena, std::uint32_t seed) : seed_(hash32(seed, 0xf100)) {
  const Eigen::Vector2f size = arena.floor.size_m.cast<float>().array() + 2.0f * kBeyondM;
  columns_ = static_cast<int>(std::ceil(size.x() / kCellM)) + 1;
  rows_ = static_cast<int>(std::ceil(size.y() / kCellM)) + 1;
  origin_m_ = -0.5f * size;
  coarse_.resize(static_cast<std::size_t>(columns_) * rows_);
  makeTile(arena.floor);
  makeLevels(arena);
  if (arena.light.contact_shadow > 0.0) {
    solids_ = solidPoses(arena, 0.0);
    contact_shadows_.resize(solids_.size());
    for (std::size_t i = 0; i < solids_.size(); ++i) addContactShadow(arena, i);
  }
  makeCoarse(arena.floor);
}

void FloorMap::update(const Arena& arena, double time_s) {
  if (arena.light.contact_shadow <= 0.0 || arena.moves.empty()) return;
  const std::vector<Pose2> now = solidPoses(arena, time_s);
  bool any = false;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (now[i].vector() == solids_[i].vector()) continue;
    solids_[i] = now[i];
    addContactShadow(arena, i);
    any = true;
  }
  if (any) makeCoarse(arena.floor);
}

void FloorMap::makeTile(const Floor& floor) {
  has_grid_ = floor.grid_m > 0.0;
  const float grid_m = static_cast<float>(floor.grid_m);
  grid_m_ = grid_m;
  tile_variation_ = static_cast<float>(floor.tile_variation);
  const float period_m = has_grid_ ? std::ceil(kTileM / grid_m) * grid_m : kTileM;
  texel_m_ = period_m / static_cast<float>(tile_texels_);
  for (int c = 0; c < 3; ++c) {
    grid_ratio_[c] =
        static_cast<float>(floor.grid_rgb[2 - c]) / std::max(1.0f, static_cast<float>(floor.rgb[2 - c]));
  }
  const float cells = std::max(1.0f, std::round(period_m / static_cast<float>(floor.texture_size_m)));
  const auto texture = static_cast<float>(floor.texture);
  tile_[0].resize(static_cast<std::size_t>(tile_texels_) * tile_texels_);
  for (int y = 0; y < tile_texels_; ++y) {
    for (int x = 0; x < tile_texels_; ++x) {
      const float scale = cells / static_cast<float>(tile_texels_);
      Texel& texel = tile_[0][static_cast<std::size_t>(y) * tile_texels_ + x];
      texel.texture = 1.0f + 1.7f * texture * valueNoise(x * scale, y * scale, seed_);
      const float x_m = static_cast<float>(x) * texel_m_, y_m = static_cast<float>(y) * texel_m_;
      const auto width_m = static_cast<float>(floor.grid_width_m);
      texel.grid = has_grid_ ? std::max(lineShare(x_m, x_m + texel_m_, grid_m, width_m),
                                        lineShare(y_m, y_m + texel_m_, grid_m, width_m))
                             : 0.0f;
    }
  }
  for (int level = 1; level < kLevels; ++level) {
    const int n = tile_texels_ >> level;
    tile_[level].resize(static_cast<std::size_t>(n) * n);
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        const Texel* a = &tile_[level - 1][static_cast<std::size_t>(4) * y * n + 2 * x];
        const Texel* b = a + 2 * n;
        tile_[level][static_cast<std::size_t>(y) * n + x] = {
            0.25f * (a[0].texture + a[1].texture + b[0].texture + b[1].texture),
            0.25f * (a[0].grid + a[1].grid + b[0].grid + b[1].grid)};
      }
    }
  }
}

Eigen::Vector2f FloorMap::placeOf(int row, int column) const {
  return origin_m_ + kCellM * Eigen::Vector2f(static_cast<float>(column), static_cast<float>(row));
}

void FloorMap::makeLevels(const Arena& arena) {
  const auto cloud_m = static_cast<float>(arena.floor.cloud_size_m);
  const auto clouds = static_cast<float>(arena.floor.clouds);
  levels_.clear();
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2f place = placeOf(row, column);
      const float x = place.x() / cloud_m, y = place.y() / cloud_m;
      const float cloud = valueNoise(x, y, seed_ + 1) + 0.5f * valueNoise(2.3f * x, 2.3f * y, seed_ + 2);
      const Eigen::Vector2d lit_m =
          place.cast<double>().cwiseMax(-0.5 * arena.floor.size_m).cwiseMin(0.5 * arena.floor.size_m);
      levels_.push_back(arena.light.at(lit_m, 0.0) * (1.0f + clouds * cloud));
    }
  }
}

void FloorMap::addContactShadow(const Arena& arena, std::size_t i) {
  const Pose2 solid_from_map = solids_[i].inverse();
  const Eigen::Matrix2d axes = solid_from_map.rotation();
  contact_shadows_[i].clear();
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2d place_m =
          axes * placeOf(row, column).cast<double>() + solid_from_map.translation();
      const double gap_m = std::max(0.0, arena.solids[i].distance(place_m));
      contact_shadows_[i].push_back(1.0 - arena.light.contact_shadow *
                                              std::exp(-gap_m / arena.light.contact_shadow_m));
    }
  }
}

void FloorMap::makeCoarse(const Floor& floor) {
  for (std::size_t i = 0; i < coarse_.size(); ++i) {
    double shadow = 1.0;
    for (const std::vector<double>& of_solid : contact_shadows_) shadow *= of_solid[i];
    const double level = levels_[i] * shadow;
    for (int c = 0; c < 3; ++c) coarse_[i][c] = static_cast<float>(floor.rgb[2 - c] * level);
    coarse_[i][3] = 0.0f;
  }
}

std::uint8_t FloorMap::levelFor(float footprint_m) const {
  const float level = std::log2(std::max(1.0f, footprint_m / texel_m_));
  return static_cast<std::uint8_t>(std::clamp(static_cast<int>(std::lround(level)), 0, kLevels - 1));
}

Eigen::Array4f FloorMap::coarseAt(float x_m, float y_m) const {
  const float x = std::clamp((x_m - origin_m_.x()) / kCellM, 0.0f, static_cast<float>(columns_) - 1.001f);
  const float y = std::clamp((y_m - origin_m_.y()) / kCellM, 0.0f, static_cast<float>(rows_) - 1.001f);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float tx = x - static_cast<float>(ix), ty = y - static_cast<float>(iy);
  const Eigen::Array4f* low = &coarse_[static_cast<std::size_t>(iy) * columns_ + ix];
  const Eigen::Array4f* high = low + columns_;
  return (low[0] * (1.0f - tx) + low[1] * tx) * (1.0f - ty) + (high[0] * (1.0f - tx) + high[1] * tx) * ty;
}

FloorMap::Texel FloorMap::tileAt(float x_m, float y_m, std::uint8_t level) const {
  const int n = tile_texels_ >> level, mask = n - 1;
  const float scale = 1.0f / (texel_m_ * static_cast<float>(1 << level));
  // The centre of texel i is at (i + ½) texels.
  const float x = x_m * scale - 0.5f, y = y_m * scale - 0.5f;
  const int ix = static_cast<int>(x) - (x < 0.0f ? 1 : 0), iy = static_cast<int>(y) - (y < 0.0f ? 1 : 0);
  const float tx = x - static_cast<float>(ix), ty = y - static_cast<float>(iy);
  const Texel* low = &tile_[level][static_cast<std::size_t>(iy & mask) * n];
  const Texel* high = &tile_[level][static_cast<std::size_t>((iy + 1) & mask) * n];
  const int left = ix & mask, right = (ix + 1) & mask;
  Texel texel;
  texel.texture = mix(mix(low[left].texture, low[right].texture, tx),
                      mix(high[left].texture, high[right].texture, tx), ty);
  texel.grid = has_grid_ ? mix(mix(low[left].grid, low[right].grid, tx),
                               mix(high[left].grid, high[right].grid, tx), ty)
                         : 0.0f;
  return texel;
}

Eigen::Array4f FloorMap::at(float x_m, float y_m, std::uint8_t level) const {
  const Texel texel = tileAt(x_m, y_m, level);
  const Eigen::Array4f colour = coarseAt(x_m, y_m);
  if (!has_grid_) return colour * texel.texture;
  const float field = tile_variation_ > 0.0f ? fieldAt(x_m, y_m) : 1.0f;
  return colour * (field * texel.texture * (1.0f - texel.grid) + texel.grid * grid_ratio_);
}

float FloorMap::fieldAt(float x_m, float y_m) const {
  const auto column = static_cast<std::int32_t>(std::floor(x_m / grid_m_));
  const auto row = static_cast<std::int32_t>(std::floor(y_m / grid_m_));
  return 1.0f + tile_variation_ * latticeValue(column, row, 0, seed_ + 3);
}

}  // namespace omnifleet::synthetic
