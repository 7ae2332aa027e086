#include "flow/lucas_kanade.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::flow {

LucasKanadeOptions LucasKanadeOptions::read(const options::Section& section) {
  LucasKanadeOptions o;
  section.read("radius_px", o.radius_px, {2, LucasKanade::kMaxRadius});
  section.read("sigma_px", o.sigma_px, {0.0, 20.0});
  section.read("levels", o.levels, {1, 6});
  section.read("iterations", o.iterations, {1, 100});
  section.read("epsilon_px", o.epsilon_px, {1e-4, 1.0});
  section.read("min_eigenvalue", o.min_eigenvalue, {0.0, 1e6});
  section.read("max_residual", o.max_residual, {0.1, 255.0});
  section.read("max_return_px", o.max_return_px, {0.01, 100.0});
  section.finish();
  return o;
}

namespace {

/// Bilinear window of side × side pixels around a centre; false where it leaves the image.
bool sampleWindow(const cv::Mat1b& image, const Eigen::Vector2f& centre, int side, float* out) {
  const float left = centre.x() - 0.5f * static_cast<float>(side - 1);
  const float top = centre.y() - 0.5f * static_cast<float>(side - 1);
  if (!(left >= 0.0f && top >= 0.0f)) return false;
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  if (x0 + side >= image.cols || y0 + side >= image.rows) return false;
  const float fx = left - static_cast<float>(x0), fy = top - static_cast<float>(y0);
  const float w00 = (1 - fx) * (1 - fy), w01 = fx * (1 - fy), w10 = (1 - fx) * fy, w11 = fx * fy;
  for (int y = 0; y < side; ++y, out += side) {
    const std::uint8_t *a = image.ptr(y0 + y) + x0, *b = image.ptr(y0 + y + 1) + x0;
    for (int x = 0; x < side; ++x)
      out[x] = w00 * static_cast<float>(a[x]) + w01 * static_cast<float>(a[x + 1]) +
               w10 * static_cast<float>(b[x]) + w11 * static_cast<float>(b[x + 1]);
  }
  return true;
}

}  // namespace

LucasKanade::LucasKanade(const LucasKanadeOptions& options)
    : options_(options), side_(2 * options.radius_px + 1) {
  double sum = 0.0;
  const double s2 = options.sigma_px * options.sigma_px;
  const auto weight = [&](int x, int y) { return s2 > 0 ? std::exp(-0.5 * (x * x + y * y) / s2) : 1.0; };
  const int r = options.radius_px;
  for (int y = -r; y <= r; ++y)
    for (int x = -r; x <= r; ++x) sum += weight(x, y);
  std::size_t i = 0;
  for (int y = -r; y <= r; ++y)
    for (int x = -r; x <= r; ++x) weight_[i++] = static_cast<float>(weight(x, y) / sum);
}

bool LucasKanade::prepare(const cv::Mat1b& image, const Eigen::Vector2f& centre) {
  const int wide = side_ + 2;
  if (!sampleWindow(image, centre, wide, wide_.data())) return false;
  float xx = 0, xy = 0, yy = 0;
  for (int y = 0; y < side_; ++y) {
    const float* c = wide_.data() + (y + 1) * wide + 1;
    for (int x = 0; x < side_; ++x) {
      const int i = y * side_ + x;
      const auto k = static_cast<std::size_t>(i);
      const float dx = 0.5f * (c[x + 1] - c[x - 1]), dy = 0.5f * (c[x + wide] - c[x - wide]);
      template_[k] = c[x];
      gx_[k] = dx * weight_[k];
      gy_[k] = dy * weight_[k];
      xx += gx_[k] * dx;
      xy += gx_[k] * dy;
      yy += gy_[k] * dy;
    }
  }
  const float determinant = xx * yy - xy * xy;
  const float smaller = 0.5f * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4.0f * xy * xy));
  if (smaller < static_cast<float>(options_.min_eigenvalue) || determinant <= 0.0f) return false;
  inverse_[0] = yy / determinant;
  inverse_[1] = -xy / determinant;
  inverse_[2] = xx / determinant;
  return true;
}

bool LucasKanade::iterate(const cv::Mat1b& image, Eigen::Vector2f& centre, float& residual) {
  const auto epsilon2 = static_cast<float>(options_.epsilon_px * options_.epsilon_px);
  const auto n = static_cast<std::size_t>(side_ * side_);
  for (int k = 0; k < options_.iterations; ++k) {
    if (!sampleWindow(image, centre, side_, patch_.data())) return false;
    float bx = 0, by = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const float d = template_[i] - patch_[i];
      bx += gx_[i] * d;
      by += gy_[i] * d;
    }
    const Eigen::Vector2f step(inverse_[0] * bx + inverse_[1] * by, inverse_[1] * bx + inverse_[2] * by);
    centre += step;
    if (step.squaredNorm() < epsilon2) break;
  }
  float sum = 0, mean = 0;
  if (!sampleWindow(image, centre, side_, patch_.data())) return false;
  for (std::size_t i = 0; i < n; ++i) mean += weight_[i] * (template_[i] - patch_[i]);
  for (std::size_t i = 0; i < n; ++i) {
    const float d = template_[i] - patch_[i] - mean;  // light may change between frames
    sum += weight_[i] * d * d;
  }
  residual = std::sqrt(sum);
  return true;
}

bool LucasKanade::follow(const Pyramid& from_image, const Pyramid& to_image, const Eigen::Vector2f& from,
                         Eigen::Vector2f& to, int top_level) {
  float residual = 0.0f;
  const int top = std::min({from_image.size() - 1, to_image.size() - 1, top_level});
  bool found = false;
  for (int level = top; level >= 0; --level) {
    const float scale = 1.0f / static_cast<float>(1 << level);
    // A coarse level may lie too near the border or have no texture; then the finer one starts from the
    // guess.
    Eigen::Vector2f guess = to * scale;
    found = prepare(from_image.level(level), from * scale) && iterate(to_image.level(level), guess, residual);
    if (found) to = guess / scale;
  }
  return found && residual <= static_cast<float>(options_.max_residual) && to.allFinite();
}

bool LucasKanade::followBothWays(const Pyramid& from_image, const Pyramid& to_image,
                                 const Eigen::Vector2f& from, Eigen::Vector2f& to) {
  if (!follow(from_image, to_image, from, to)) return false;
  Eigen::Vector2f back = from;
  if (!follow(to_image, from_image, to, back, 0)) return false;
  return (back - from).norm() <= static_cast<float>(options_.max_return_px);
}

}  // namespace omnifleet::flow
