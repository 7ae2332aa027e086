#include "ground/floor_comparison.h"

#include <algorithm>

#include "geometry/lanes.h"
#include "geometry/wide.h"

namespace omnifleet::ground {
namespace {

using lanes::Floats;
using lanes::Ints;

constexpr int kLanes = FloorBlock::kLanes, kRows = FloorBlock::kRows;
constexpr int kTotals = FloorComparison::kTotals, kShift = FloorComparison::kShift,
              kShiftSide = FloorComparison::kShiftSide;
constexpr Floats kEven = {0, 2, 4, 6, 8, 10, 12, 14};

OMNIFLEET_INLINE Floats clampTo(const Floats& value, float first, float last) {
  return lanes::smaller(lanes::larger(value, lanes::all(first)), lanes::all(last));
}

OMNIFLEET_WIDE void compareBlocks(const FloorWarp& w, const FloorRaster& raster, const FloorBlock* blocks,
                                  std::size_t count, int subsets, float gain, float robust,
                                  FloorBlockScore* scores, float* totals) {
  const int side = raster.side();
  const float last = static_cast<float>(side) - 2.01f;
  const auto* pairs = raster.pairs().ptr<std::int32_t>();
  const auto base_x = static_cast<float>(raster.base().x()), base_y = static_cast<float>(raster.base().y());
  Floats sums[kTotals] = {};
  for (std::size_t b = 0; b < count; ++b) {
    const FloorBlock& block = blocks[b];
    Floats score[4] = {};
    for (int i = 0; i < subsets * kRows; ++i) {
      if ((block.rows >> i & 1) == 0) continue;
      const int odd = i / kRows, row = block.y + 2 * (i % kRows) + odd;
      const Floats x = kEven + static_cast<float>(block.x + odd);
      const auto y = static_cast<float>(row);
      const Floats u = clampTo(w.c * x + (w.s * y + w.u), 0.0f, last),
                   v = clampTo((w.c * y + w.v) - w.s * x, 0.0f, last);
      const Ints column = lanes::truncated(u), line = lanes::truncated(v);
      const Floats a = u - lanes::floats(column), d = v - lanes::floats(line);
      const Ints index = line * side + column;
      std::int32_t at[kLanes];
      lanes::store(index, at);
      std::int64_t four[kLanes];
      for (int k = 0; k < kLanes; ++k) four[k] = lanes::load<std::int64_t>(pairs + at[k]);
      const Ints one = lanes::load<Ints>(four), two = lanes::load<Ints>(four + 4);
      const Ints left = __builtin_shufflevector(one, two, 0, 2, 4, 6, 8, 10, 12, 14),
                 right = __builtin_shufflevector(one, two, 1, 3, 5, 7, 9, 11, 13, 15);
      const Floats p = lanes::floats(left << 16 >> 16), q = lanes::floats(right << 16 >> 16),
                   r = lanes::floats(left >> 16), s = lanes::floats(right >> 16);
      const Floats reference = lanes::load<Floats>(block.value + kLanes * i);
      const Floats least =
          lanes::smaller(lanes::smaller(p, q), lanes::smaller(lanes::smaller(r, s), reference));
      const Floats used =
          least > static_cast<float>(FloorRaster::kNone) ? lanes::all(1.0f) : lanes::all(0.0f);
      const Floats top = q - p, bottom = s - r, along = top + d * (bottom - top), above = p + a * top,
                   below = r + a * bottom, across = below - above;
      const Floats current = above + d * across, residual = current - gain * reference;
      // Cauchy's influence function ψ(r) = r / (1 + r²/k²): weight ψ/r and slope ψ'.
      const Floats square = robust * residual * residual, ratio = 1.0f / (1.0f + square),
                   weight = used * ratio, slope = weight * ratio * (1.0f - square);
      // Gradients in the axes of the reference; the third component belongs to θ.
      const Floats gx = lanes::load<Floats>(block.gx + kLanes * i),
                   gy = lanes::load<Floats>(block.gy + kLanes * i), cx = w.c * along - w.s * across,
                   cy = w.s * along + w.c * across;
      const Floats px = x - base_x;
      const float py = y - base_y;
      const Floats gt = px * gy - py * gx, ct = px * cy - py * cx;
      const Floats wr = weight * reference, force = weight * residual, sx = slope * gx, sy = slope * gy,
                   st = slope * gt;
      score[0] += force * gx;
      score[1] += force * gy;
      score[2] += force * gt;
      score[3] += wr * current;
      sums[0] += sx * cx;
      sums[1] += sx * cy + sy * cx;
      sums[2] += sx * ct + st * cx;
      sums[3] += sy * cy;
      sums[4] += sy * ct + st * cy;
      sums[5] += st * ct;
      sums[6] += weight * current * current;
      sums[7] += wr * reference;
      sums[8] += weight;
      sums[9] += used;
      sums[10] += used * lanes::magnitude(residual);
    }
    for (int k = 0; k < 3; ++k) scores[b].gradient[k] = lanes::sum(score[k]);
    scores[b].correlation = lanes::sum(score[3]);
    sums[11] += score[3];
  }
  for (int k = 0; k < kTotals; ++k) totals[k] = lanes::sum(sums[k]);
}

OMNIFLEET_WIDE void correlateBlocks(const FloorWarp& w, const FloorRaster& raster, const FloorBlock* blocks,
                                    std::size_t count, const FloorLimits& limits, float* sums) {
  const int side = raster.side();
  const float last = static_cast<float>(side) - 1.0f;
  const auto* values = raster.values().ptr<std::int16_t>();
  for (std::size_t b = 0; b < count; ++b) {
    const FloorBlock& block = blocks[b];
    Floats sum = {};
    for (int i = 0; i < kRows; ++i) {
      if ((block.rows >> i & 1) == 0) continue;
      const Floats x = kEven + static_cast<float>(block.x);
      const auto y = static_cast<float>(block.y + 2 * i);
      const Floats u = clampTo(w.c * x + (w.s * y + w.u + 0.5f), 0.0f, last),
                   v = clampTo((w.c * y + w.v + 0.5f) - w.s * x, 0.0f, last);
      const Ints index = lanes::truncated(v) * side + lanes::truncated(u);
      std::int32_t at[kLanes], found[kLanes];
      lanes::store(index, at);
      for (int k = 0; k < kLanes; ++k) found[k] = values[at[k]];
      const Floats current = lanes::floats(lanes::load<Ints>(found)),
                   reference = lanes::load<Floats>(block.value + kLanes * i);
      const Floats product = clampTo(current, -limits.current, limits.current) *
                             clampTo(reference, -limits.reference, limits.reference);
      sum += lanes::smaller(current, reference) > static_cast<float>(FloorRaster::kNone) ? product
                                                                                         : lanes::all(0.0f);
    }
    sums[b] = lanes::sum(sum);
  }
}

OMNIFLEET_WIDE void scoreAllShifts(const cv::Mat1f& reference, const cv::Mat1f& current, float* scores) {
  constexpr int kBorder = FloorRaster::kCoarseBorder;
  static_assert(kBorder >= kLanes && kShift <= kBorder);
  const int n = reference.rows - 2 * kBorder;
  for (int dy = -kShift; dy <= kShift; ++dy) {
    Floats sums[kShiftSide] = {};
    for (int y = std::max(0, dy); y < std::min(n, n + dy); ++y) {
      const float *p = reference.ptr<float>(y + kBorder) + kBorder,
                  *q = current.ptr<float>(y + kBorder - dy) + kBorder + kShift;
      for (int x = 0; x < n; x += kLanes) {
        const Floats here = lanes::load<Floats>(p + x);
        for (int k = 0; k < kShiftSide; ++k) sums[k] += here * lanes::load<Floats>(q + x - k);
      }
    }
    for (int k = 0; k < kShiftSide; ++k) *scores++ = lanes::sum(sums[k]);
  }
}

}  // namespace

void FloorComparison::compare(const FloorBlock* blocks, std::size_t count, int subsets, float gain,
                              float robust, FloorBlockScore* scores, float* totals) const {
  compareBlocks(warp_, raster_, blocks, count, subsets, gain, robust, scores, totals);
}

void FloorComparison::correlate(const FloorBlock* blocks, std::size_t count, const FloorLimits& limits,
                                float* sums) const {
  correlateBlocks(warp_, raster_, blocks, count, limits, sums);
}

void FloorComparison::scoreShifts(const cv::Mat1f& reference, const cv::Mat1f& current, float* scores) {
  scoreAllShifts(reference, current, scores);
}

}  // namespace omnifleet::ground
