#include "flow/lucas_kanade.h"

#include <algorithm>
#include <cmath>

#include "geometry/lanes.h"

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

using lanes::Floats;

constexpr int roundedUp(int n) {
  return (n + lanes::kLanes - 1) / lanes::kLanes * lanes::kLanes;
}

/// A window of side × side pixels at a sub-pixel position. Rows are rounded up to whole vectors; the extra
/// columns are undefined.
struct Window {
  const std::uint8_t* first;  ///< first of the four pixels around the top left position
  std::ptrdiff_t step;
  float w00, w01, w10, w11;  ///< bilinear weights
};

/// Eight pixels of a window.
OMNIFLEET_INLINE Floats sample(const Window& window, int x, int y) {
  const std::uint8_t *a = window.first + y * window.step + x, *b = a + window.step;
  return window.w00 * lanes::floatsFromBytes(a) + window.w01 * lanes::floatsFromBytes(a + 1) +
         window.w10 * lanes::floatsFromBytes(b) + window.w11 * lanes::floatsFromBytes(b + 1);
}

OMNIFLEET_WIDE void copyWindow(const Window& window, int side, float* out) {
  const int columns = roundedUp(side);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < columns; x += lanes::kLanes, out += lanes::kLanes)
      lanes::store(sample(window, x, y), out);
}

/// Weighted gradients of `wide` (which has a margin of one pixel), its inner pixels, and the sums of AᵀWA.
OMNIFLEET_WIDE void differentiate(const float* wide, int side, const float* weight, float* pixels, float* gx,
                                  float* gy, float (&sums)[3]) {
  const int columns = roundedUp(side), step = roundedUp(side + 2);
  Floats xx{}, xy{}, yy{};
  for (int y = 0; y < side; ++y) {
    const float* row = wide + (y + 1) * step + 1;
    for (int x = 0; x < columns; x += lanes::kLanes) {
      const int i = y * columns + x;
      const auto at = [row, x](int offset) { return lanes::load<Floats>(row + x + offset); };
      const Floats dx = 0.5f * (at(1) - at(-1)), dy = 0.5f * (at(step) - at(-step));
      const auto w = lanes::load<Floats>(weight + i);  // 0 outside the window
      const Floats wx = dx * w, wy = dy * w;
      lanes::store(at(0), pixels + i);
      lanes::store(wx, gx + i);
      lanes::store(wy, gy + i);
      xx += wx * dx;
      xy += wx * dy;
      yy += wy * dy;
    }
  }
  sums[0] = lanes::sum(xx);
  sums[1] = lanes::sum(xy);
  sums[2] = lanes::sum(yy);
}

/// Σ a·(pixels − window), Σ b·(pixels − window).
OMNIFLEET_WIDE Eigen::Vector2f correlate(const Window& window, int side, const float* pixels, const float* a,
                                         const float* b) {
  const int columns = roundedUp(side);
  Floats sum_a{}, sum_b{};
  for (int y = 0, i = 0; y < side; ++y) {
    for (int x = 0; x < columns; x += lanes::kLanes, i += lanes::kLanes) {
      const Floats d = lanes::load<Floats>(pixels + i) - sample(window, x, y);
      sum_a += lanes::load<Floats>(a + i) * d;
      sum_b += lanes::load<Floats>(b + i) * d;
    }
  }
  return {lanes::sum(sum_a), lanes::sum(sum_b)};
}

/// Weighted standard deviation of the differences. It ignores a change of brightness between the frames.
OMNIFLEET_WIDE float spread(const Window& window, int side, const float* pixels, const float* weight) {
  const int columns = roundedUp(side);
  Floats mean{}, square{};
  for (int y = 0, i = 0; y < side; ++y) {
    for (int x = 0; x < columns; x += lanes::kLanes, i += lanes::kLanes) {
      const Floats d = lanes::load<Floats>(pixels + i) - sample(window, x, y);
      const Floats weighted = lanes::load<Floats>(weight + i) * d;
      mean += weighted;
      square += weighted * d;
    }
  }
  const float m = lanes::sum(mean);
  return std::sqrt(std::max(0.0f, lanes::sum(square) - m * m));
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
  for (int y = -r; y <= r; ++y, i += static_cast<std::size_t>(roundedUp(side_) - side_))
    for (int x = -r; x <= r; ++x) weight_[i++] = static_cast<float>(weight(x, y) / sum);
}

/// Calls use(window) for the window around a centre. False if the window leaves the image.
template <typename Use>
bool LucasKanade::withWindow(const cv::Mat1b& image, const Eigen::Vector2f& centre, int side, Use use) {
  const float left = centre.x() - 0.5f * static_cast<float>(side - 1);
  const float top = centre.y() - 0.5f * static_cast<float>(side - 1);
  if (!(left >= 0.0f && top >= 0.0f)) return false;
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  if (x0 + side >= image.cols || y0 + side >= image.rows) return false;
  const float fx = left - static_cast<float>(x0), fy = top - static_cast<float>(y0);
  Window window{image.ptr(y0) + x0,  static_cast<std::ptrdiff_t>(image.step1()),
                (1 - fx) * (1 - fy), fx * (1 - fy),
                (1 - fx) * fy,       fx * fy};
  if (x0 + roundedUp(side) >= image.cols) {  // the vectors would read beyond the last row of the image
    for (int y = 0; y <= side; ++y)
      std::copy_n(image.ptr(y0 + y) + x0, side + 1, edge_.data() + y * kEdgeStep);
    window.first = edge_.data();
    window.step = kEdgeStep;
  }
  use(window);
  return true;
}

bool LucasKanade::prepare(const cv::Mat1b& image, const Eigen::Vector2f& centre) {
  const int wide = side_ + 2;
  const auto copy = [&](const Window& window) { copyWindow(window, wide, wide_.data()); };
  if (!withWindow(image, centre, wide, copy)) return false;
  float sums[3];
  differentiate(wide_.data(), side_, weight_.data(), template_.data(), gx_.data(), gy_.data(), sums);
  const auto [xx, xy, yy] = sums;
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
  Eigen::Vector2f b;
  const auto compare = [&](const Window& window) {
    b = correlate(window, side_, template_.data(), gx_.data(), gy_.data());
  };
  for (int k = 0; k < options_.iterations; ++k) {
    if (!withWindow(image, centre, side_, compare)) return false;
    const Eigen::Vector2f step(inverse_[0] * b.x() + inverse_[1] * b.y(),
                               inverse_[1] * b.x() + inverse_[2] * b.y());
    centre += step;
    if (step.squaredNorm() < epsilon2) break;
  }
  return withWindow(image, centre, side_, [&](const Window& window) {
    residual = spread(window, side_, template_.data(), weight_.data());
  });
}

bool LucasKanade::follow(const Pyramid& from_image, const Pyramid& to_image, const Eigen::Vector2f& from,
                         Eigen::Vector2f& to, int top_level) {
  float residual = 0.0f;
  const int top = std::min({from_image.size() - 1, to_image.size() - 1, top_level});
  bool found = false;
  for (int level = top; level >= 0; --level) {
    const float scale = 1.0f / static_cast<float>(1 << level);
    // A coarse level may be too close to the border or without texture. Then the finer level starts from the
    // guess.
    const Eigen::Array2f offset = Eigen::Array2f::Constant(to_image.offset_px(level));
    const Eigen::Vector2f begin = (from.array() - from_image.offset_px(level)) * scale;
    Eigen::Vector2f guess = (to.array() - offset) * scale;
    found = prepare(from_image.level(level), begin) && iterate(to_image.level(level), guess, residual);
    if (found) to = guess.array() / scale + offset;
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
