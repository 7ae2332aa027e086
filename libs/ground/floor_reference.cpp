#include "ground/floor_reference.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr float kAdaptation =
    0.15f;                // share of a new cell in the reference handed on: follows light over ~7 cells
constexpr int kJump = 4;  // cells: a floor marking (grid line, joint) up to this wide is stepped over
constexpr float kFillWeight =
    0.02f;  // weight of the coarser level: only counts where the finer one knows little

bool isLike(const cv::Vec3f& p, const cv::Vec3f& r, const FloorReference::Test& test) {
  const float rr = r.dot(r);
  const float gain = p.dot(r) / rr;
  const float across2 = p.dot(p) / rr - gain * gain;
  return (gain - 1.0f) * (gain - 1.0f) <= test.along2 && across2 <= test.across2;
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
      carried_(view.cells(), cv::Vec3f(0, 0, 0)),
      grown_(view.cells(), std::uint8_t{0}) {
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
      carried_(y, x) = cell_means(y, x);
      queue_.push_back(y * seeds.cols + x);
    }
  }
  return true;
}

void FloorReference::grow(const cv::Mat3f& cell_means, double noise) {
  static constexpr int kSteps[8][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  const auto& coverage = view_->coverage();
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const int y = queue_[next] / coverage.cols, x = queue_[next] % coverage.cols;
    const cv::Vec3f reference = carried_(y, x);
    const Test test = testFor(reference, noise);
    for (const auto& step : kSteps) {
      for (int jump = 1; jump <= kJump; ++jump) {
        const int ny = y + step[1] * jump, nx = x + step[0] * jump;
        if (ny < 0 || nx < 0 || ny >= coverage.rows || nx >= coverage.cols || coverage(ny, nx) != 2) break;
        if (grown_(ny, nx) != 0) break;
        const cv::Vec3f& mean = cell_means(ny, nx);
        if (!isLike(mean, reference, test)) continue;
        grown_(ny, nx) = 255;
        carried_(ny, nx) = (1.0f - kAdaptation) * reference + kAdaptation * mean;
        queue_.push_back(ny * coverage.cols + nx);
        break;
      }
    }
  }
}

void FloorReference::smooth(const cv::Mat3f& cell_means) {
  const cv::Size half((grown_.cols + 1) / 2, (grown_.rows + 1) / 2);
  sums_.create(half, CV_32FC4);
  sums_.setTo(cv::Scalar::all(0));
  for (int y = 0; y < grown_.rows; ++y) {
    auto* row = sums_.ptr<cv::Vec4f>(y / 2);
    for (int x = 0; x < grown_.cols; ++x) {
      if (grown_(y, x) == 0) continue;
      const cv::Vec3f& c = cell_means(y, x);
      row[x / 2] += cv::Vec4f(c[0], c[1], c[2], 1.0f);
    }
  }
  const int side = 2 * std::max(1, options_.smoothing_cells / 2) + 1;
  cv::blur(sums_, fine_, {side, side}, {-1, -1}, cv::BORDER_CONSTANT);
  cv::blur(fine_, sums_, {side, side}, {-1, -1}, cv::BORDER_CONSTANT);
  pyramid_.resize(8);
  cv::resize(sums_, pyramid_[0], {(half.width + 1) / 2, (half.height + 1) / 2}, 0, 0, cv::INTER_AREA);
  for (std::size_t k = 1; k < pyramid_.size(); ++k)
    cv::resize(pyramid_[k - 1], pyramid_[k], {(pyramid_[k - 1].cols + 1) / 2, (pyramid_[k - 1].rows + 1) / 2},
               0, 0, cv::INTER_AREA);
  const auto normalise = [](cv::Mat& sums, const cv::Mat* filler) {
    for (int y = 0; y < sums.rows; ++y) {
      auto* row = sums.ptr<cv::Vec4f>(y);
      const auto* fill = filler != nullptr ? filler->ptr<cv::Vec4f>(y) : nullptr;
      for (int x = 0; x < sums.cols; ++x) {
        if (fill != nullptr) row[x] += kFillWeight * fill[x];
        row[x] = row[x][3] > 1e-9f ? row[x] * (1.0f / row[x][3]) : cv::Vec4f(0, 0, 0, 0);
      }
    }
  };
  normalise(pyramid_.back(), nullptr);
  for (std::size_t k = pyramid_.size() - 1; k-- > 0;) {
    cv::resize(pyramid_[k + 1], blurred_, pyramid_[k].size(), 0, 0, cv::INTER_LINEAR);
    normalise(pyramid_[k], &blurred_);
  }
  cv::resize(pyramid_[0], blurred_, half, 0, 0, cv::INTER_LINEAR);
  normalise(sums_, &blurred_);
  cv::resize(sums_, blurred_, {half.width * 2, half.height * 2}, 0, 0, cv::INTER_LINEAR);
  for (int y = 0; y < colour_.rows; ++y) {
    const auto* row = blurred_.ptr<cv::Vec4f>(y);
    for (int x = 0; x < colour_.cols; ++x) colour_(y, x) = cv::Vec3f(row[x][0], row[x][1], row[x][2]);
  }
}

}  // namespace omnifleet::ground
