#include "distance_vector/floor_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::distance_vector {
namespace {

constexpr float kSqrt3 = 1.7320508f;                    // level (length of a BGR vector) of one grey level
constexpr float kHueRate = 0.02f;                       // per row
constexpr float kLevelRate = 0.2f, kSlopeRate = 0.02f;  // per row: an alpha–beta filter, critically damped
constexpr float kLagRows = 1.0f / kLevelRate;
constexpr float kMaxSlope = 0.03f;     // of the level, per row
constexpr float kDrift = 2.0f;         // hue limits from the seed's hue: more is no floor, however slow
constexpr int kBlur_px = 4;            // an edge is at most this wide (filter, JPEG's coarse chroma)
constexpr int kReturn_px = 2;          // floor pixels that end a band
constexpr int kHorizonSlack_px = 3;    // error of the horizon that calibration and filter may cause
constexpr float kSaturated = 250.0f;   // grey levels
constexpr float kSaturatedHue = 4.0f;  // hue limits of such pixels, in the usual ones
constexpr int kBottomRows = 3;
constexpr float kBottomRate = 0.1f;                  // per column
constexpr float kDarkest = 0.5f, kBrightest = 1.7f;  // level of the floor in one image, of the seed's level

}  // namespace

FloorWalk::FloorWalk(const ColumnView& view, const WalkOptions& options) : view_(&view), options_(options) {
  const cv::Size size = view.size();
  walkers_.resize(static_cast<std::size_t>(size.width));
  ends_.resize(walkers_.size());
  bottom_.resize(walkers_.size());
  step_m_.resize(walkers_.size() * static_cast<std::size_t>(size.height));
  for (int u = 0; u < size.width; ++u)
    for (int v = 0; v < size.height; ++v)
      step_m_[static_cast<std::size_t>(v * size.width + u)] = depth(u, v + 1, v);
}

float FloorWalk::depth(int u, int below, int above) const {
  constexpr float kFar_m = 1e3f;
  if (above <= view_->horizonRow(u)) return kFar_m;
  const float far = view_->inverseRange(u, static_cast<float>(above));
  const float near = view_->inverseRange(u, static_cast<float>(below));
  return far > 0.0f ? std::min(kFar_m, 1.0f / far - 1.0f / near) : kFar_m;
}

float FloorWalk::heightBound(int u, int below, int above) const {
  const float height = view_->cameraHeight();
  if (above <= view_->horizonRow(u)) return height;
  // The line of sight to the floor behind passes at this height above the near edge.
  return height * (1.0f - view_->inverseRange(u, static_cast<float>(above)) /
                              view_->inverseRange(u, static_cast<float>(below)));
}

float FloorWalk::levelTolerance(int u, int v, float level) const {
  const float row_m = step_m_[static_cast<std::size_t>(v * view_->size().width + u)];
  const float falloff = std::min(0.15f, static_cast<float>(options_.falloff_per_m) * kLagRows * row_m);
  return std::max(level_limit_, static_cast<float>(options_.contrast_share) * level) + falloff * level;
}

FloorWalk::Deviation FloorWalk::compare(const Walker& w, const float* colour, float expected,
                                        float tolerance) const {
  const float along = colour[0] * w.hue[0] + colour[1] * w.hue[1] + colour[2] * w.hue[2];
  const float x = colour[0] - along * w.hue[0], y = colour[1] - along * w.hue[1],
              z = colour[2] - along * w.hue[2];
  const float first = colour[0] * seed_[0] + colour[1] * seed_[1] + colour[2] * seed_[2];
  const float a = colour[0] - first * seed_[0], b = colour[1] - first * seed_[1],
              c = colour[2] - first * seed_[2];
  // A saturated channel is darker than it should be: hue means little, and level may be higher.
  const float brightest = std::max(colour[0], std::max(colour[1], colour[2]));
  const float hue_limit = brightest < kSaturated ? hue_limit_ : kSaturatedHue * hue_limit_;
  const float limit = hue_limit * hue_limit;
  return {x * x + y * y + z * z > limit || a * a + b * b + c * c > kDrift * kDrift * limit,
          std::abs(along - expected) > tolerance, along};
}

const std::vector<ColumnEnd>& FloorWalk::walk(const SmoothedImage& image, const FloorSample& floor) {
  const cv::Size size = view_->size();
  begin(image, floor);
  int top = size.height;
  for (int u = 0; u < size.width; ++u) top = std::min(top, view_->checkRow(u));
  for (int v = size.height - 1; v >= top; --v) {
    const std::uint16_t *b = image.row(0, v), *g = image.row(1, v), *r = image.row(2, v);
    for (int u = 0; u < size.width; ++u) {
      const State state = walkers_[static_cast<std::size_t>(u)].state;
      if (state == State::kDone) continue;
      if (v < view_->checkRow(u)) {
        finishAtHorizon(u);
        continue;
      }
      const float colour[3] = {SmoothedImage::kScale * b[u], SmoothedImage::kScale * g[u],
                               SmoothedImage::kScale * r[u]};
      if (state == State::kFloor)
        stepFloor(u, v, colour);
      else
        stepBand(u, v, colour);
    }
  }
  for (int u = 0; u < size.width; ++u)
    if (walkers_[static_cast<std::size_t>(u)].state != State::kDone) finishAtHorizon(u);
  return ends_;
}

/// Level of the floor at the bottom of each column, from the seed's column to both sides.
void FloorWalk::begin(const SmoothedImage& image, const FloorSample& floor) {
  const cv::Size size = view_->size();
  seed_ = floor.direction;
  hue_limit_ =
      std::max(static_cast<float>(options_.min_chroma), static_cast<float>(options_.sigmas) * floor.across);
  level_limit_ = std::max(kSqrt3 * static_cast<float>(options_.min_contrast),
                          static_cast<float>(options_.sigmas) * floor.along);
  const auto follow = [&](int from, int to, int step) {
    float level = floor.level;
    for (int u = from; u != to; u += step) {
      cv::Vec3f colour(0, 0, 0);
      for (int k = 1; k <= kBottomRows; ++k)
        colour += image.colour(u, size.height - k) * (1.0f / kBottomRows);
      const float along = colour.dot(seed_);
      const bool is_floor = floor.distance(colour) < hue_limit_ && along > kDarkest * floor.level &&
                            along < kBrightest * floor.level &&
                            std::abs(along - level) < std::max(level_limit_, 0.15f * level);
      if (is_floor) level += kBottomRate * (along - level);
      beginColumn(u, is_floor ? 0.5f * (level + along) : level, floor);
    }
  };
  follow(floor.column, size.width, 1);
  follow(floor.column, -1, -1);
}

void FloorWalk::beginColumn(int u, float level, const FloorSample& floor) {
  Walker& w = walkers_[static_cast<std::size_t>(u)];
  w = Walker{};
  for (int c = 0; c < 3; ++c) w.hue[c] = floor.direction[c];
  w.level = level;
  w.slope = 0.0f;
  ColumnEnd& end = ends_[static_cast<std::size_t>(u)];
  end = ColumnEnd{};
  end.floor = view_->size().height;
  if (view_->limitRow(u) + options_.min_run_px >= view_->size().height) w.state = State::kDone;
}

void FloorWalk::stepFloor(int u, int v, const float* colour) {
  Walker& w = walkers_[static_cast<std::size_t>(u)];
  const float expected = w.level + w.slope;
  const Deviation d = compare(w, colour, expected, levelTolerance(u, v, w.level));
  if (d.hue || d.level) {
    beginBand(w, v);
    stepBand(u, v, colour);
    return;
  }
  const float error = d.along - expected;
  w.level = expected + kLevelRate * error;
  w.slope = std::clamp(w.slope + kSlopeRate * error, -kMaxSlope * w.level, kMaxSlope * w.level);
  const float rate = kHueRate / std::max(1.0f, d.along);
  float square = 0.0f;
  for (int c = 0; c < 3; ++c) {
    w.hue[c] += rate * (colour[c] - d.along * w.hue[c]);
    square += w.hue[c] * w.hue[c];
  }
  const float length = 1.5f - 0.5f * square;  // first order of 1/√square, which is near 1
  for (float& c : w.hue) c *= length;
}

void FloorWalk::beginBand(Walker& w, int v) {
  w.state = State::kBand;
  w.begin = v;
  w.edge = -1;
  w.count = w.object_run = w.object_count = w.shadow_run = w.floor_run = 0;
  w.band_sum = 0.0f;
}

/// Behind the object is what may be floor in the shadow of something else. If the object hides so little
/// floor that it may be flat, the band goes on behind it.
void FloorWalk::passFlat(int u, int v) {
  Walker& w = walkers_[static_cast<std::size_t>(u)];
  const int behind = v + w.shadow_run - 1;
  if (depth(u, w.begin, behind) > static_cast<float>(options_.largest_flat_m)) return;
  if (w.flat < 0) w.flat = w.edge;
  beginBand(w, behind);
}

void FloorWalk::stepBand(int u, int v, const float* colour) {
  Walker& w = walkers_[static_cast<std::size_t>(u)];
  const Deviation d = compare(w, colour, w.level, 1.2f * levelTolerance(u, v, w.level));
  ++w.count;
  if (!d.hue && !d.level) {
    w.object_run = 0;
    if (++w.floor_run >= kReturn_px) endBand(u, v + kReturn_px);
    return;
  }
  w.floor_run = 0;
  const float least = static_cast<float>(options_.shadow_ratio) * w.level,
              most = static_cast<float>(options_.light_ratio) * w.level;
  if (!d.hue && d.along >= least && d.along <= most) {
    w.band_sum += d.along;
    w.object_run = 0;
    if (w.edge >= 0 && ++w.shadow_run >= options_.min_run_px) passFlat(u, v);
    return;
  }
  w.shadow_run = 0;
  if (w.object_run == 0) {
    w.object_begin = v;
    w.before_sum = w.band_sum;
    w.before = w.count - 1;
  }
  w.band_sum += d.along;
  ++w.object_run;
  ++w.object_count;
  if (w.edge >= 0 || w.object_run < options_.min_run_px) return;
  w.edge = isShadow(u, w) ? w.object_begin : w.begin;
}

/// Before the object, the level alone is lower than that of the floor.
bool FloorWalk::isShadow(int u, const Walker& w) const {
  return w.begin - w.object_begin > kBlur_px && w.object_count - w.object_run <= kBlur_px &&
         w.object_begin > view_->limitRow(u) && w.before_sum < w.level * static_cast<float>(w.before);
}

/// Floor follows on a band that ends below row v.
void FloorWalk::endBand(int u, int v) {
  Walker& w = walkers_[static_cast<std::size_t>(u)];
  const int rows = w.begin - v + 1;
  const float ratio = rows > 0 ? w.band_sum / (static_cast<float>(w.count - w.floor_run) * w.level) : 1.0f;
  if (rows <= 1 || heightBound(u, w.begin, v) <= static_cast<float>(options_.flat_m)) {
    w.state = State::kFloor;
  } else if (w.edge >= 0 || 3 * w.object_count >= rows || ratio > static_cast<float>(options_.light_ratio) ||
             ratio < static_cast<float>(options_.shadow_ratio)) {
    const int edge = w.edge >= 0 ? w.edge : w.begin;
    if (depth(u, w.begin, v) > static_cast<float>(options_.largest_flat_m)) {
      finish(u, End::kEdge, edge);
    } else {
      w.state = State::kFloor;
      if (w.flat < 0) w.flat = edge;
    }
  } else {
    finish(u, End::kUndecided, w.begin);
    ColumnEnd& end = ends_[static_cast<std::size_t>(u)];
    if (end.end == End::kUndecided) end.band_end = v - 1;
  }
}

void FloorWalk::finish(int u, End end, int row) {
  walkers_[static_cast<std::size_t>(u)].state = State::kDone;
  const int bottom = view_->size().height - 1;
  ColumnEnd& out = ends_[static_cast<std::size_t>(u)];
  out.end = end;
  out.row = row;
  out.floor = row + 1;
  if (end == End::kOutside) out.floor = bottom + 1;
  if (row >= bottom - 1) {  // not even two rows of floor
    out.end = End::kNear;
    out.floor = bottom + 1;
    return;
  }
  finishEdge(u, end, row);
  const Walker& w = walkers_[static_cast<std::size_t>(u)];
  if (w.flat < 0) return;
  out.beyond = out.end == End::kEdge;
  if (out.beyond) return;
  out.end = End::kEdge;
  out.low = true;
  out.row = w.flat;
  out.floor = w.flat + 1;
}

/// Neither above the horizon nor beyond the farthest row that is measured.
void FloorWalk::finishEdge(int u, End end, int row) {
  if (end != End::kEdge) return;
  ColumnEnd& out = ends_[static_cast<std::size_t>(u)];
  const int bottom = view_->size().height - 1;
  if (row < view_->horizonRow(u) - kHorizonSlack_px && view_->seesHorizon(u)) {
    out.end = End::kUndecided;
    out.floor = bottom + 1;
  } else if (row < view_->limitRow(u)) {
    out.end = End::kFloorEnd;
    out.row = view_->limitRow(u);
    out.floor = view_->limitRow(u);
  }
}

void FloorWalk::finishAtHorizon(int u) {
  const Walker& w = walkers_[static_cast<std::size_t>(u)];
  if (w.state == State::kBand) {
    finish(u, End::kEdge, w.edge >= 0 ? w.edge : w.begin);
  } else if (view_->seesHorizon(u)) {
    finish(u, End::kUndecided, view_->horizonRow(u) - kHorizonSlack_px - 1);
    ends_[static_cast<std::size_t>(u)].floor = view_->size().height;
  } else {
    finish(u, End::kEdge, view_->limitRow(u) - 1);  // the image ends before the floor does
  }
}

}  // namespace omnifleet::distance_vector
