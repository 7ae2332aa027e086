#include "ground/floor_noise.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kPixels = kCell * kCell;
constexpr int kEvery = 5;  // cells; a fifth of them is enough for a median

double sigmaOf(std::vector<float>& variances) {
  const auto middle = variances.begin() + static_cast<std::ptrdiff_t>(variances.size() / 2);
  std::nth_element(variances.begin(), middle, variances.end());
  return std::sqrt(static_cast<double>(*middle));
}

}  // namespace

NoiseMeter::NoiseMeter(const FloorView& view) {
  for (int y = 0; y < view.seeds().rows; ++y)
    for (int x = y % kEvery; x < view.seeds().cols; x += kEvery)
      if (view.seeds()(y, x) != 0) cells_.emplace_back(x, y);
}

/// Medians over the cells, so that edges in the seed ring do not count.
FloorNoise NoiseMeter::measure(const cv::Mat& image, const cv::Mat3f& cell_means) {
  variances_.clear();
  hue_variances_.clear();
  for (const cv::Point& cell : cells_) {
    const Variances of = varianceOf(image, cell, cell_means(cell));
    variances_.push_back(of.channel);
    hue_variances_.push_back(of.hue);
  }
  if (variances_.empty()) return {};
  return {sigmaOf(variances_), sigmaOf(hue_variances_)};
}

/// Variances of the cell's pixels around its mean.
NoiseMeter::Variances NoiseMeter::varianceOf(const cv::Mat& image, const cv::Point& cell,
                                             const cv::Vec3f& mean) {
  const int channels = image.channels();
  const cv::Vec3f brightness = mean / std::sqrt(std::max(1.0f, mean.dot(mean)));
  int sum[3] = {}, squares[3] = {};
  float along = 0.0f;
  for (int y = cell.y * kCell; y < (cell.y + 1) * kCell; ++y) {
    const auto* row = image.ptr<std::uint8_t>(y) + cell.x * kCell * channels;
    for (int x = 0; x < kCell; ++x, row += channels) {
      float brighter = 0.0f;
      for (int c = 0; c < channels; ++c) {
        sum[c] += row[c];
        squares[c] += row[c] * row[c];
        brighter += brightness[c] * (static_cast<float>(row[c]) - mean[c]);
      }
      along += brighter * brighter;
    }
  }
  int spread = 0;  // multiplied by kPixels
  for (int c = 0; c < channels; ++c) spread += kPixels * squares[c] - sum[c] * sum[c];
  const float all = static_cast<float>(spread) / static_cast<float>(kPixels);
  const auto over = [](float sum_of_squares, int n) {
    return sum_of_squares / static_cast<float>(n * (kPixels - 1));
  };
  return {over(all, channels), channels == 1 ? 0.0f : over(std::max(0.0f, all - along), channels - 1)};
}

}  // namespace omnifleet::ground
