#include "ground/floor_reference.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr int kJump = 4;  // cells: a floor marking (grid line, joint) up to this wide is stepped over
// Gains of the filter that follows the floor's brightness from cell to cell: a steady slope is followed
// without lag (an α–β filter along the way of growth), the noise of a cell's mean is halved.
constexpr float kLevelGain = 0.5f, kSlopeGain = 0.1f;
constexpr float kTextureSigmas =
    2.0f;                           // of the floor's own texture, added to the step that counts as an edge
constexpr float kMaxSlope = 0.15f;  // of the brightness, per cell
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
      colour_(view.cells(), cv::Vec3f(0, 0, 0)),
      slope_(view.cells(), cv::Vec2f(0, 0)),
      grown_(view.cells(), std::uint8_t{0}),
      sums_((view.cells().height + 1) / 2, (view.cells().width + 1) / 2, CV_32FC4),
      fine_(sums_.size(), CV_32FC4) {
  queue_.reserve(static_cast<std::size_t>(view.cells().area()));
}

FloorReference::Test FloorReference::testFor(const cv::Vec3f& r, double noise) const {
  const double brightness = std::max(1.0, std::sqrt(static_cast<double>(r.dot(r))));
  const double added = options_.noise_sigmas * noise / brightness;
  const double along = options_.tolerance_along + added, across = options_.tolerance_across + added;
  return {static_cast<float>(along * along), static_cast<float>(across * across)};
}

bool FloorReference::learn(const cv::Mat3f& cell_means, double noise) {
  if (!seed(cell_means)) return false;
  grow(cell_means, noise / FloorView::kCell);
  smooth(cell_means);
  return true;
}

bool FloorReference::seed(const cv::Mat3f& cell_means) {
  const auto& seeds = view_->seeds();
  const auto binAt = [](const cv::Vec3f& c) {
    return GroundHistogram::binOf(cv::saturate_cast<std::uint8_t>(c[0]),
                                  cv::saturate_cast<std::uint8_t>(c[1]),
                                  cv::saturate_cast<std::uint8_t>(c[2]));
  };
  histogram_.clear();
  for (int y = 0; y < seeds.rows; ++y)
    for (int x = 0; x < seeds.cols; ++x)
      if (seeds(y, x) != 0) histogram_.add(binAt(cell_means(y, x)));
  if (histogram_.settle(options_.min_share, 0, false) <= 0.0) return false;
  grown_.setTo(0);
  queue_.clear();
  for (int y = 0; y < seeds.rows; ++y) {
    for (int x = 0; x < seeds.cols; ++x) {
      if (seeds(y, x) == 0 || histogram_.table()[binAt(cell_means(y, x))] == 0) continue;
      grown_(y, x) = 255;
      colour_(y, x) = cell_means(y, x);
      slope_(y, x) = cv::Vec2f(0, 0);
      queue_.push_back(y * seeds.cols + x);
    }
  }
  texture_ = seedTexture(cell_means);
  return true;
}

float FloorReference::seedTexture(const cv::Mat3f& cell_means) {
  steps_.clear();
  for (const int cell : queue_) {
    const int y = cell / grown_.cols, x = cell % grown_.cols;
    if (x + 2 >= grown_.cols || grown_(y, x + 2) == 0) continue;
    const cv::Vec3f step = cell_means(y, x + 2) - cell_means(y, x);
    steps_.push_back(std::sqrt(step.dot(step) / std::max(1.0f, cell_means(y, x).dot(cell_means(y, x)))));
  }
  if (steps_.empty()) return 0.0f;
  const auto middle = steps_.begin() + static_cast<std::ptrdiff_t>(steps_.size() / 2);
  std::nth_element(steps_.begin(), middle, steps_.end());
  return *middle;
}

void FloorReference::grow(const cv::Mat3f& cell_means, double noise) {
  static constexpr int kSteps[8][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  const auto& coverage = view_->coverage();
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const int y = queue_[next] / coverage.cols, x = queue_[next] % coverage.cols;
    const cv::Vec3f reference = colour_(y, x);
    const cv::Vec2f slope = slope_(y, x);
    const Test test = testFor(reference, noise);
    const float flatness = std::sqrt(test.along2) + kTextureSigmas * texture_;
    for (const auto& step : kSteps) {
      for (int jump = 1; jump <= kJump; ++jump) {
        const int dx = step[0] * jump, dy = step[1] * jump, ny = y + dy, nx = x + dx;
        if (ny < 0 || nx < 0 || ny >= coverage.rows || nx >= coverage.cols || coverage(ny, nx) != 2) break;
        if (grown_(ny, nx) != 0) break;
        const cv::Vec3f expected = expect(reference, slope, dx, dy);
        const cv::Vec3f& mean = cell_means(ny, nx);
        if (!isLike(mean, expected, test) || !isFlat(cell_means, nx, ny, expected, slope, flatness)) continue;
        grown_(ny, nx) = 255;
        colour_(ny, nx) = (1.0f - kLevelGain) * expected + kLevelGain * mean;
        const float surprise = mean.dot(expected) / expected.dot(expected) - 1.0f;
        const auto along = cv::Vec2f(static_cast<float>(dx), static_cast<float>(dy)) *
                           (1.0f / static_cast<float>(dx * dx + dy * dy));
        slope_(ny, nx) = slope + kSlopeGain * surprise * along;
        queue_.push_back(ny * coverage.cols + nx);
        break;
      }
    }
  }
}

cv::Vec3f FloorReference::expect(const cv::Vec3f& reference, const cv::Vec2f& slope, int dx, int dy) {
  const float change = slope[0] * static_cast<float>(dx) + slope[1] * static_cast<float>(dy);
  return reference * (1.0f + std::clamp(change, -kMaxSlope, kMaxSlope));
}

void FloorReference::sumCells(const cv::Mat3f& cell_means) {
  sums_.setTo(cv::Scalar::all(0));
  for (const int cell : queue_) {
    const int y = cell / grown_.cols, x = cell % grown_.cols;
    const cv::Vec3f& c = cell_means(y, x);
    sums_.ptr<cv::Vec4f>(y / 2)[x / 2] += cv::Vec4f(c[0], c[1], c[2], 1.0f);
  }
}

void FloorReference::smooth(const cv::Mat3f& cell_means) {
  // Normalised convolution of the grown cells, 2×2 of them at a time; then the same of what it left over.
  sumCells(cell_means);
  const int side = 2 * std::max(1, options_.smoothing_cells / 2) + 1;
  fine_.setTo(cv::Scalar::all(0));
  for (int round = 0; round < kSmoothingRounds; ++round) {
    sums_.copyTo(residual_);
    for (int y = 0; y < sums_.rows && round > 0; ++y) {
      auto* rest = residual_.ptr<cv::Vec4f>(y);
      const auto* have = fine_.ptr<cv::Vec4f>(y);
      for (int x = 0; x < sums_.cols; ++x)
        for (int c = 0; c < 3; ++c) rest[x][c] -= have[x][c] * rest[x][3];
    }
    cv::blur(residual_, blurred_, {side, side}, {-1, -1}, cv::BORDER_CONSTANT);
    cv::blur(blurred_, residual_, {side, side}, {-1, -1}, cv::BORDER_CONSTANT);
    divideByWeight(residual_);
    fine_ += residual_;
  }
  cv::resize(fine_, blurred_, {fine_.cols * 2, fine_.rows * 2}, 0, 0, cv::INTER_LINEAR);
  for (int y = 0; y < colour_.rows; ++y) {
    const auto* row = blurred_.ptr<cv::Vec4f>(y);
    for (int x = 0; x < colour_.cols; ++x) colour_(y, x) = cv::Vec3f(row[x][0], row[x][1], row[x][2]);
  }
}

void FloorReference::divideByWeight(cv::Mat& sums) {
  // Where the window holds hardly any floor, a coarser one fills in, level by level.
  pyramid_.resize(8);
  for (std::size_t k = 0; k < pyramid_.size(); ++k) {
    const cv::Mat& finer = k == 0 ? sums : pyramid_[k - 1];
    cv::resize(finer, pyramid_[k], {(finer.cols + 1) / 2, (finer.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
  }
  const auto divide = [](cv::Mat& level, const cv::Mat* filler) {
    for (int y = 0; y < level.rows; ++y) {
      auto* row = level.ptr<cv::Vec4f>(y);
      const auto* fill = filler != nullptr ? filler->ptr<cv::Vec4f>(y) : nullptr;
      for (int x = 0; x < level.cols; ++x) {
        if (fill != nullptr) row[x] += kFillWeight * fill[x];
        row[x] = row[x][3] > 1e-9f ? row[x] * (1.0f / row[x][3]) : cv::Vec4f(0, 0, 0, 0);
      }
    }
  };
  divide(pyramid_.back(), nullptr);
  for (std::size_t k = pyramid_.size(); k-- > 0;) {
    cv::Mat& finer = k == 0 ? sums : pyramid_[k - 1];
    cv::resize(pyramid_[k], filler_, finer.size(), 0, 0, cv::INTER_LINEAR);
    divide(finer, &filler_);
  }
}

}  // namespace omnifleet::ground
