#include "ground/hue_smoother.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr double kHides = 0.15;     // share of the hue tolerance; more noise (σ) hides hues
constexpr float kAlike2 = 12.0f;    // χ² limit of two equal hues (2 degrees of freedom, 0.25 %)
constexpr double kSmoothing = 2.4;  // noise reduction at an edge, where six of nine cells are alike

}  // namespace

HueSmoother::HueSmoother(const FloorView& view) : view_(&view), smoothed_(view.cells(), cv::Vec3f(0, 0, 0)) {}

CellColours HueSmoother::smooth(const cv::Mat3f& means, const FloorNoise& pixel, double tolerated) {
  const FloorNoise cell = pixel / FloorView::kCell;
  if (!isNoisy(means, cell, tolerated)) return {means, cell, false};
  const auto most_off2 = kAlike2 * static_cast<float>(cell.hue * cell.hue);
  means.copyTo(smoothed_);
  for (int y = 1; y + 1 < means.rows; ++y) smoothRow(means, y, most_off2);
  return {smoothed_, {cell.channel, cell.hue / kSmoothing}, true};
}

/// Compares the noise with the brightness of the seeds.
bool HueSmoother::isNoisy(const cv::Mat3f& means, const FloorNoise& cell, double tolerated) const {
  cv::Vec3d sum;
  for (const cv::Point& seed : view_->seedCells()) sum += cv::Vec3d(means(seed));
  return cell.hue * static_cast<double>(view_->seedCells().size()) > kHides * tolerated * cv::norm(sum);
}

void HueSmoother::smoothRow(const cv::Mat3f& means, int y, float most_off2) {
  const cv::Mat1b& coverage = view_->coverage();
  const cv::Range range = view_->rows()[static_cast<std::size_t>(y)];
  for (int x = std::max(range.start, 1); x < std::min(range.end, means.cols - 1); ++x) {
    if (coverage(y, x) != 2) continue;
    const cv::Vec3f& mean = means(y, x);
    const float mm = mean.dot(mean);
    cv::Vec3f sum;
    for (int row = y - 1; row <= y + 1; ++row) {
      for (int column = x - 1; column <= x + 1; ++column) {
        if (coverage(row, column) != 2) continue;
        const cv::Vec3f& beside = means(row, column);
        const float bb = beside.dot(beside), along = mean.dot(beside);
        // sin² of the angle between both colours, compared with the noise of both.
        if (mm * bb - along * along <= most_off2 * (mm + bb)) sum += beside;
      }
    }
    smoothed_(y, x) = mean.dot(sum) / std::max(1e-6f, sum.dot(sum)) * sum;
  }
}

}  // namespace omnifleet::ground
