#include "ground/floor_reference.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

constexpr int kLargeImage_px = 900;  // from this width on the model is made of blocks of 2×2 cells
constexpr int kJump = 4;  // blocks: a floor marking (grid line, joint) up to this wide is stepped over
// Gains of the filter that follows the floor's brightness from cell to cell: a steady slope is followed
// without lag (an α–β filter along the way of growth), the noise of a cell's mean is halved.
constexpr float kLevelGain = 0.5f, kSlopeGain = 0.1f;
constexpr float kTextureSigmas =
    2.0f;                             // of the floor's own texture, added to the step that counts as an edge
constexpr float kSeedLevel = 160.0f;  // grey level that darker floors are brightened to for their histogram
constexpr float kMaxSlope = 0.15f;    // of the brightness, per cell
constexpr int kSmoothingRounds =
    3;  // each takes most of the bias away that slopes and one-sided windows leave
constexpr float kFillWeight =
    0.02f;  // weight of the coarser level: only counts where the finer one knows little

bool isLike(const cv::Vec3f& p, const cv::Vec3f& r, const FloorReference::Test& test) {
  const float rr = r.dot(r);
  const float gain = p.dot(r) / rr;
  const float across2 = p.dot(p) / rr - gain * gain;
  return (gain - 1.0f) * (gain - 1.0f) <= test.along2 && across2 <= test.across2;
}

/// No edge runs through the cell: its neighbours on both sides differ by no more than the slope explains.
/// Without this the growth would climb onto objects over the cells that their edges cut by and by.
bool isFlat(const cv::Mat3f& means, int x, int y, const cv::Vec3f& reference, const cv::Vec2f& slope,
            float allowed_share) {
  if (x < 1 || y < 1 || x + 1 >= means.cols || y + 1 >= means.rows) return false;
  const cv::Vec3f across = means(y, x + 1) - means(y, x - 1) - 2.0f * slope[0] * reference;
  const cv::Vec3f down = means(y + 1, x) - means(y - 1, x) - 2.0f * slope[1] * reference;
  const float allowed = allowed_share * allowed_share * reference.dot(reference);
  return across.dot(across) <= allowed && down.dot(down) <= allowed;
}

/// All eight neighbours are set; `row_step` bytes between rows.
bool isEnclosed(const std::uint8_t* at, std::ptrdiff_t row_step) {
  const auto three = [](const std::uint8_t* p) { return p[0] & p[1] & p[2]; };
  return (three(at - row_step - 1) & at[-1] & at[1] & three(at + row_step - 1)) != 0;
}

/// out[i] = scale · Σ in[i + k · step], k < count.
OMNIFLEET_WIDE void sumAlong(const float* in, std::ptrdiff_t step, int count, float scale, int n,
                             float* out) {
  for (int i = 0; i < n; ++i) out[i] = in[i];
  for (int k = 1; k < count; ++k) {
    const float* next = in + k * step;
#pragma GCC ivdep
    for (int i = 0; i < n; ++i) out[i] += next[i];
  }
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) out[i] *= scale;
}

OMNIFLEET_WIDE void mix(const float* a, const float* b, float share, int n, float* out) {
  const float rest = 1.0f - share;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) out[i] = rest * a[i] + share * b[i];
}

/// Sums → means; `filler` (means) counts where the sums know little. Without anything: 0.
void divide(cv::Mat& sums, const cv::Mat* filler) {
  for (int y = 0; y < sums.rows; ++y) {
    auto* row = sums.ptr<cv::Vec4f>(y);
    const auto* fill = filler != nullptr ? filler->ptr<cv::Vec4f>(y) : nullptr;
    for (int x = 0; x < sums.cols; ++x) {
      if (fill != nullptr) row[x] += kFillWeight * fill[x];
      row[x] = row[x][3] > 1e-3f ? row[x] * (1.0f / row[x][3]) : cv::Vec4f(0, 0, 0, 0);
    }
  }
}

}  // namespace

ReferenceOptions ReferenceOptions::read(const options::Section& section) {
  ReferenceOptions o;
  section.read("tolerance_along", o.tolerance_along, {0.005, 0.9});
  section.read("tolerance_across", o.tolerance_across, {0.002, 0.9});
  section.read("noise_sigmas", o.noise_sigmas, {0.0, 20.0});
  section.read("min_share", o.min_share, {0.0, 0.5});
  section.read("smoothing_cells", o.smoothing_cells, {1, 40});
  section.finish();
  return o;
}

FloorReference::FloorReference(const FloorView& view, const ReferenceOptions& options)
    : view_(&view),
      options_(options),
      block_(view.imageSize().width >= kLargeImage_px ? 2 : 1),
      colour_(view.cells(), cv::Vec3f(0, 0, 0)) {
  const cv::Size blocks(view.cells().width / block_, view.cells().height / block_);
  coverage_ = cv::Mat1b(blocks, std::uint8_t{2});
  seeds_ = cv::Mat1b(blocks, std::uint8_t{255});
  for (int y = 0; y < blocks.height * block_; ++y) {
    for (int x = 0; x < blocks.width * block_; ++x) {
      auto& covered = coverage_(y / block_, x / block_);
      covered = std::min(covered, view.coverage()(y, x));
      seeds_(y / block_, x / block_) &= view.seeds()(y, x);
    }
  }
  means_ = cv::Mat3f(blocks, cv::Vec3f(0, 0, 0));
  carried_ = cv::Mat3f(blocks, cv::Vec3f(0, 0, 0));
  slope_ = cv::Mat2f(blocks, cv::Vec2f(0, 0));
  grown_ = cv::Mat1b(blocks, std::uint8_t{0});
  sums_.create((blocks.height + 1) / 2, (blocks.width + 1) / 2, CV_32FC4);
  fine_.create(sums_.size(), CV_32FC4);
  pyramid_.resize(8);
  queue_.reserve(static_cast<std::size_t>(blocks.area()));
  for (int y = 0; y < blocks.height; ++y)
    for (int x = 0; x < blocks.width; ++x)
      if (seeds_(y, x) != 0) seed_blocks_.push_back(y * blocks.width + x);
  closed_ = cv::Mat1b(blocks.height + 2 * kJump, blocks.width + 2 * kJump, std::uint8_t{1});
  for (int y = 0; y < blocks.height; ++y)
    for (int x = 0; x < blocks.width; ++x) closed_(y + kJump, x + kJump) = coverage_(y, x) != 2 ? 1 : 0;
  radius_ = std::max(1, options_.smoothing_cells / 2);
  framed_ = cv::Mat1f(sums_.rows + 2 * radius_, 4 * (sums_.cols + 2 * radius_), 0.0f);
  summed_.create(framed_.rows, 4 * sums_.cols);
}

FloorReference::Test FloorReference::testFor(const cv::Vec3f& r, double noise) const {
  const float brightness = std::sqrt(std::max(1.0f, r.dot(r)));
  const float added = static_cast<float>(options_.noise_sigmas * noise) / brightness;
  const float along = static_cast<float>(options_.tolerance_along) + added;
  const float across = static_cast<float>(options_.tolerance_across) + added;
  return {along * along, across * across};
}

bool FloorReference::learn(const cv::Mat3f& cell_means, double noise) {
  averageBlocks(cell_means);
  if (!seed()) return false;
  grow(noise / (FloorView::kCell * block_));
  smooth();
  return true;
}

void FloorReference::averageBlocks(const cv::Mat3f& cell_means) {
  if (block_ == 1) {
    means_ = cell_means;  // the same pixels
    return;
  }
  for (int y = 0; y < means_.rows; ++y) {
    const auto *above = cell_means.ptr<float>(2 * y), *below = cell_means.ptr<float>(2 * y + 1);
    auto* out = means_.ptr<float>(y);
    for (int i = 0; i < 3 * means_.cols; i += 3, above += 6, below += 6)
      for (int c = 0; c < 3; ++c) out[i + c] = 0.25f * (above[c] + above[c + 3] + below[c] + below[c + 3]);
  }
}

bool FloorReference::seed() {
  const auto* means = means_.ptr<cv::Vec3f>();
  // The bins are as wide in the dark as the differences of brightness there are small: without this, things
  // in the ring and the floor would fill bins that touch.
  const float gain = brighten();
  const auto binAt = [gain](const cv::Vec3f& c) {
    return GroundHistogram::binOf(cv::saturate_cast<std::uint8_t>(gain * c[0]),
                                  cv::saturate_cast<std::uint8_t>(gain * c[1]),
                                  cv::saturate_cast<std::uint8_t>(gain * c[2]));
  };
  histogram_.clear();
  for (const int block : seed_blocks_) histogram_.add(binAt(means[block]));
  if (histogram_.settle(options_.min_share, 0, false) <= 0.0) return false;
  grown_.setTo(0);
  closed_.copyTo(stop_);
  queue_.clear();
  for (const int block : seed_blocks_) {
    if (histogram_.table()[binAt(means[block])] == 0) continue;
    const int y = block / grown_.cols, x = block % grown_.cols;
    grown_(y, x) = 255;
    stop_(y + kJump, x + kJump) = 1;
    carried_(y, x) = means[block];
    slope_(y, x) = cv::Vec2f(0, 0);
    queue_.push_back(block);
  }
  texture_ = seedTexture();
  return true;
}

/// What makes the middle one of the seeds as bright as kSeedLevel; never darker than it is.
float FloorReference::brighten() {
  steps_.clear();
  const auto* means = means_.ptr<cv::Vec3f>();
  for (const int block : seed_blocks_)
    steps_.push_back(std::max({means[block][0], means[block][1], means[block][2]}));
  const auto middle = steps_.begin() + static_cast<std::ptrdiff_t>(steps_.size() / 2);
  std::nth_element(steps_.begin(), middle, steps_.end());
  return std::max(1.0f, kSeedLevel / std::max(1.0f, *middle));
}

float FloorReference::seedTexture() {
  steps_.clear();
  for (const int cell : queue_) {
    const int y = cell / grown_.cols, x = cell % grown_.cols;
    if (x + 2 >= grown_.cols || grown_(y, x + 2) == 0) continue;
    const cv::Vec3f step = means_(y, x + 2) - means_(y, x);
    steps_.push_back(std::sqrt(step.dot(step) / std::max(1.0f, means_(y, x).dot(means_(y, x)))));
  }
  if (steps_.empty()) return 0.0f;
  const auto middle = steps_.begin() + static_cast<std::ptrdiff_t>(steps_.size() / 2);
  std::nth_element(steps_.begin(), middle, steps_.end());
  return *middle;
}

void FloorReference::grow(double noise) {
  static constexpr int kSteps[8][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const int y = queue_[next] / coverage_.cols, x = queue_[next] % coverage_.cols;
    if (isEnclosed(stop_.ptr(y + kJump) + x + kJump, static_cast<std::ptrdiff_t>(stop_.step1()))) continue;
    const cv::Vec3f reference = carried_(y, x);
    const cv::Vec2f slope = slope_(y, x);
    const Test test = testFor(reference, noise);
    // The texture measured holds the noise.
    const float flatness = std::max(std::sqrt(test.along2),
                                    static_cast<float>(options_.tolerance_along) + kTextureSigmas * texture_);
    for (const auto& step : kSteps) {
      for (int jump = 1; jump <= kJump; ++jump) {
        const int dx = step[0] * jump, dy = step[1] * jump, ny = y + dy, nx = x + dx;
        if (stop_(ny + kJump, nx + kJump) != 0) break;
        const cv::Vec3f expected = expect(reference, slope, dx, dy);
        const cv::Vec3f& mean = means_(ny, nx);
        if (!isLike(mean, expected, test) || !isFlat(means_, nx, ny, expected, slope, flatness)) continue;
        grown_(ny, nx) = 255;
        stop_(ny + kJump, nx + kJump) = 1;
        carried_(ny, nx) = (1.0f - kLevelGain) * expected + kLevelGain * mean;
        const float surprise = mean.dot(expected) / expected.dot(expected) - 1.0f;
        const auto along = cv::Vec2f(static_cast<float>(dx), static_cast<float>(dy)) *
                           (1.0f / static_cast<float>(dx * dx + dy * dy));
        slope_(ny, nx) = slope + kSlopeGain * surprise * along;
        queue_.push_back(ny * coverage_.cols + nx);
        break;
      }
    }
  }
}

cv::Vec3f FloorReference::expect(const cv::Vec3f& reference, const cv::Vec2f& slope, int dx, int dy) {
  const float change = slope[0] * static_cast<float>(dx) + slope[1] * static_cast<float>(dy);
  return reference * (1.0f + std::clamp(change, -kMaxSlope, kMaxSlope));
}

void FloorReference::sumBlocks() {
  sums_.setTo(cv::Scalar::all(0));
  for (const int cell : queue_) {
    const int y = cell / grown_.cols, x = cell % grown_.cols;
    const cv::Vec3f& c = means_(y, x);
    sums_.ptr<cv::Vec4f>(y / 2)[x / 2] += cv::Vec4f(c[0], c[1], c[2], 1.0f);
  }
}

void FloorReference::smooth() {
  // Normalised convolution of the grown cells, 2×2 of them at a time; then the same of what it left over.
  sumBlocks();
  fine_.setTo(cv::Scalar::all(0));
  residual_.create(sums_.size(), CV_32FC4);
  for (int round = 0; round < kSmoothingRounds; ++round) {
    for (int y = 0; y < sums_.rows; ++y) {
      const auto *sum = sums_.ptr<cv::Vec4f>(y), *have = fine_.ptr<cv::Vec4f>(y);
      auto* rest = framed_.ptr<cv::Vec4f>(y + radius_) + radius_;
      for (int x = 0; x < sums_.cols; ++x) {
        const float weight = sum[x][3];
        rest[x] = cv::Vec4f(sum[x][0] - have[x][0] * weight, sum[x][1] - have[x][1] * weight,
                            sum[x][2] - have[x][2] * weight, weight);
      }
    }
    blurTwice();
    if (round == 0)
      fillAndDivide(residual_);
    else
      divide(residual_, nullptr);
    fine_ += residual_;
  }
  spread();
}

/// framed_ → residual_, each time the mean over a square of side 2·radius_ + 1, zeros beyond the edge.
void FloorReference::blurTwice() {
  const int side = 2 * radius_ + 1, n = 4 * sums_.cols;
  const float scale = 1.0f / static_cast<float>(side * side);
  for (int pass = 0; pass < 2; ++pass) {
    for (int y = 0; y < framed_.rows; ++y)
      sumAlong(framed_.ptr<float>(y), 4, side, 1.0f, n, summed_.ptr<float>(y));
    for (int y = 0; y < sums_.rows; ++y) {
      float* to = pass == 0 ? framed_.ptr<float>(y + radius_) + 4 * radius_ : residual_.ptr<float>(y);
      sumAlong(summed_.ptr<float>(y), static_cast<std::ptrdiff_t>(summed_.step1()), side, scale, n, to);
    }
  }
}

FloorReference::Between FloorReference::between(int fine, int scale, int coarse_size) {
  const float at = (static_cast<float>(fine) + 0.5f) / static_cast<float>(scale) - 0.5f;
  const int first = std::clamp(static_cast<int>(std::floor(at)), 0, coarse_size - 1);
  return {first, std::min(first + 1, coarse_size - 1),
          std::clamp(at - static_cast<float>(first), 0.0f, 1.0f)};
}

/// fine_ → colour_, bilinearly.
void FloorReference::spread() {
  const int scale = 2 * block_;
  wide_.create(fine_.rows, colour_.cols);
  if (columns_.empty())
    for (int x = 0; x < colour_.cols; ++x) columns_.push_back(between(x, scale, fine_.cols));
  for (int y = 0; y < fine_.rows; ++y) {
    const auto* row = fine_.ptr<cv::Vec4f>(y);
    auto* to = wide_.ptr<cv::Vec3f>(y);
    for (int x = 0; x < colour_.cols; ++x) {
      const Between& at = columns_[static_cast<std::size_t>(x)];
      const cv::Vec4f &a = row[at.first], &b = row[at.second];
      for (int c = 0; c < 3; ++c) to[x][c] = (1.0f - at.share) * a[c] + at.share * b[c];
    }
  }
  for (int y = 0; y < colour_.rows; ++y) {
    const Between rows = between(y, scale, fine_.rows);
    mix(wide_.ptr<float>(rows.first), wide_.ptr<float>(rows.second), rows.share, 3 * colour_.cols,
        colour_.ptr<float>(y));
  }
}

void FloorReference::fillAndDivide(cv::Mat& sums) {
  // Where the window holds hardly any floor, a coarser one fills in, level by level.
  for (std::size_t k = 0; k < pyramid_.size(); ++k) {
    const cv::Mat& finer = k == 0 ? sums : pyramid_[k - 1];
    cv::resize(finer, pyramid_[k], {(finer.cols + 1) / 2, (finer.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
  }
  divide(pyramid_.back(), nullptr);
  for (std::size_t k = pyramid_.size(); k-- > 0;) {
    cv::Mat& finer = k == 0 ? sums : pyramid_[k - 1];
    cv::resize(pyramid_[k], filler_, finer.size(), 0, 0, cv::INTER_LINEAR);
    divide(finer, &filler_);
  }
}

}  // namespace omnifleet::ground
