#include "markers/marker_pixels.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "geometry/wide.h"

namespace omnifleet::markers {
namespace {

constexpr float kRing_px = 6.0F;    // surroundings are sampled up to this distance from the outline
constexpr float kEnd_px = 2.5F;     // distance from the outline at which the blur of the marker ends
constexpr float kBeside_px = 0.8F;  // nearer pixels contain the marker and give no colour of the surroundings
constexpr float kInside_px = 0.7F;  // pixels this far inside a region give the first estimate of its colour
constexpr float kLeastWeight = 3.0F;  // pixels; with less the surroundings are averaged over a larger square
constexpr float kMisfit = 40.0F;  // grey levels between a pixel and its region beyond which it is occluded

OMNIFLEET_WIDE void toLumaChroma(const float* blue, const float* green, const float* red, int count,
                                 float* luma, float* cb, float* cr) {
#pragma GCC ivdep
  for (int k = 0; k < count; ++k) {
    luma[k] = 0.299F * red[k] + 0.587F * green[k] + 0.114F * blue[k];
    cb[k] = 0.564F * (blue[k] - luma[k]);
    cr[k] = 0.713F * (red[k] - luma[k]);
  }
}

/// Distances of pixels from a rectangle.
struct Box {
  float x, y, half_x, half_y;
};
OMNIFLEET_WIDE void measureBox(Box box, float index, float px_per_m, const float* u, const float* v,
                               int count, float* outside_px, float* edge_px, float* region) {
#pragma GCC ivdep
  for (int k = 0; k < count; ++k) {
    const float dx = std::abs(u[k] - box.x) - box.half_x, dy = std::abs(v[k] - box.y) - box.half_y;
    const float outside = px_per_m * std::max(dx, dy);
    outside_px[k] = std::min(outside_px[k], outside);
    edge_px[k] = std::min(edge_px[k], std::abs(outside));
    region[k] = outside <= 0.0F ? index : region[k];
  }
}

}  // namespace

Eigen::Vector3d bgrFrom(const Eigen::Vector3d& c) {
  const double blue = c[0] + c[1] / 0.564, red = c[0] + c[2] / 0.713;
  return {blue, (c[0] - 0.299 * red - 0.114 * blue) / 0.587, red};
}

MarkerPixels::MarkerPixels(const lens::Camera& camera, double height_m, const Layout& layout,
                           const ColourTable& table)
    : camera_(camera), height_m_(height_m), layout_(layout), table_(table) {}

/// Bounding box of the marker in the image with the ring around it.
cv::Rect MarkerPixels::windowAround(const Pose2& map_from_base, cv::Size image) const {
  const Rectangle& bounds = layout_.bounds();
  Eigen::Array2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const Eigen::Vector2d& u : {Eigen::Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
    const Eigen::Vector2d p =
        map_from_base * Eigen::Vector2d(bounds.centre_m + u.cwiseProduct(bounds.half_m));
    const auto pixel = camera_.pixelFromPoint({p.x(), p.y(), height_m_});
    if (!pixel) return {};
    low = low.min(pixel->array());
    high = high.max(pixel->array());
  }
  const int margin = static_cast<int>(kRing_px);
  low = low.max(-1e6), high = high.min(1e6);
  const cv::Rect window(cvFloor(low.x()) - margin, cvFloor(low.y()) - margin,
                        cvCeil(high.x()) - cvFloor(low.x()) + 2 * margin + 1,
                        cvCeil(high.y()) - cvFloor(low.y()) + 2 * margin + 1);
  return window & cv::Rect({0, 0}, image);
}

void MarkerPixels::Planes::resize(const cv::Rect& window) {
  const auto most = static_cast<std::size_t>(window.area()), row = static_cast<std::size_t>(window.width);
  for (auto* plane : {&u, &v, &outside_px, &edge_px, &region, &luma, &cb, &cr})
    if (plane->size() < most) plane->resize(most);
  for (auto* plane : {&blue, &green, &red})
    if (plane->size() < row) plane->resize(row);
}

bool MarkerPixels::collect(const cv::Mat& bgr, const Pattern& pattern, const Pose2& map_from_base,
                           double blur_px, const Tone* tone) {
  const cv::Rect window = windowAround(map_from_base, bgr.size());
  if (window.width < 4 || window.height < 4 || !plane_.set(camera_, height_m_, window, map_from_base))
    return false;
  metres_per_px_ = std::sqrt(std::abs(plane_.scale().determinant()));
  if (!(metres_per_px_ > 0.0)) return false;
  // The kernel ends at 3 σ. The pose may move by half a pixel and more.
  deep_px_ = static_cast<float>(3.0 * blur_px + 0.7);
  reach_px_ = std::min(kEnd_px, static_cast<float>(2.0 * blur_px + 0.7));
  fillPlanes(bgr, window, tone);
  const auto inside = std::count_if(planes_.region.begin(), planes_.region.begin() + window.area(),
                                    [](float region) { return region >= 0.0F; });
  visible_share_ = static_cast<double>(inside) * metres_per_px_ * metres_per_px_ / layout_.area();
  if (visible_share_ < 0.25) return false;
  measureRegions(bgr, window, pattern);
  sumSurroundings(window);
  addPixels(window);
  return true;
}

void MarkerPixels::fillPlanes(const cv::Mat& bgr, const cv::Rect& window, const Tone* tone) {
  width_ = window.width, height_ = window.height;
  Planes& p = planes_;
  p.resize(window);
  const auto area = static_cast<std::ptrdiff_t>(window.area());
  for (auto* plane : {&p.outside_px, &p.edge_px}) std::fill(plane->begin(), plane->begin() + area, 1e6F);
  std::fill(p.region.begin(), p.region.begin() + area, -1.0F);
  for (int y = 0; y < height_; ++y) {
    const auto at = static_cast<std::size_t>(y * width_);
    plane_.row(window.y + y, p.u.data() + at, p.v.data() + at);
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(window.y + y) + 3 * window.x;
    for (int x = 0; x < width_; ++x) {
      const auto to = static_cast<std::size_t>(x);
      p.blue[to] = row[3 * x], p.green[to] = row[3 * x + 1], p.red[to] = row[3 * x + 2];
    }
    if (tone != nullptr)
      for (auto* channel : {&p.blue, &p.green, &p.red})
        for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x)
          (*channel)[x] = tone->light(static_cast<std::size_t>((*channel)[x]));
    toLumaChroma(p.blue.data(), p.green.data(), p.red.data(), width_, p.luma.data() + at, p.cb.data() + at,
                 p.cr.data() + at);
  }
  const float px_per_m = static_cast<float>(1.0 / metres_per_px_);
  float index = 0.0F;
  for (const Rectangle& r : layout_.rectangles()) {
    const Eigen::Vector2f centre = r.centre_m.cast<float>(), half = r.half_m.cast<float>();
    measureBox({centre.x(), centre.y(), half.x(), half.y()}, index, px_per_m, p.u.data(), p.v.data(),
               window.area(), p.outside_px.data(), p.edge_px.data(), p.region.data());
    index += 1.0F;
  }
}

/// Estimates the colour of each region from the pixels well inside that have its class, so that an occluder
/// does not disturb it. Without such pixels from all pixels inside.
void MarkerPixels::measureRegions(const cv::Mat& bgr, const cv::Rect& window, const Pattern& pattern) {
  struct Sum {
    Eigen::Vector3d colour{0.0, 0.0, 0.0};
    double count = 0.0;
  };
  std::array<std::array<Sum, 2>, 3> sums{};  // of all pixels, of the pixels of the class
  std::size_t i = 0;
  for (int y = window.y; y < window.y + window.height; ++y) {
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
    for (int x = window.x; x < window.x + window.width; ++x, ++i) {
      if (planes_.region[i] < 0.0F || planes_.edge_px[i] < kInside_px) continue;
      const auto region = static_cast<std::size_t>(planes_.region[i]);
      const bool same = table_.classOf(row + 3 * x) == pattern.colours[region];
      for (std::size_t k = 0; k < (same ? 2U : 1U); ++k) {
        sums[region][k].colour += planes_.colour(i).cast<double>();
        sums[region][k].count += 1.0;
      }
    }
  }
  region_colours_.assign(layout_.rectangles().size(), Eigen::Vector3d::Zero());
  for (std::size_t r = 0; r < region_colours_.size(); ++r) {
    const Sum& sum = sums[r][sums[r][1].count >= 2.0 ? 1 : 0];
    if (sum.count > 0.0) region_colours_[r] = sum.colour / sum.count;
  }
}

/// Integral image of the surroundings' colours. The weight rises from 0 beside the outline to 1 where the
/// blur of the marker ends.
void MarkerPixels::sumSurroundings(const cv::Rect& window) {
  const std::size_t step = static_cast<std::size_t>(window.width) + 1;
  sums_.assign(step * (static_cast<std::size_t>(window.height) + 1), {0.0F, 0.0F, 0.0F, 0.0F});
  std::size_t i = 0;
  for (int y = 0; y < window.height; ++y) {
    std::array<float, 4> row{};
    std::array<float, 4>* to = sums_.data() + (static_cast<std::size_t>(y) + 1) * step + 1;
    for (int x = 0; x < window.width; ++x, ++i, ++to) {
      const float outside = planes_.outside_px[i];
      const float share = std::clamp((outside - kBeside_px) / (kEnd_px - kBeside_px), 0.0F, 1.0F);
      const float weight = outside > kRing_px ? 0.0F : share * share;
      row[0] += weight;
      row[1] += weight * planes_.luma[i];
      row[2] += weight * planes_.cb[i];
      row[3] += weight * planes_.cr[i];
      const std::array<float, 4>& above = *(to - step);
      for (std::size_t c = 0; c < 4; ++c) (*to)[c] = above[c] + row[c];
    }
  }
  const auto& total = sums_.back();
  mean_surround_ = Eigen::Vector3f(total[1], total[2], total[3]) / std::max(total[0], 1e-3F);
}

/// Mean colour of the surroundings in the smallest square around a pixel that contains enough of them.
Eigen::Vector3f MarkerPixels::surroundAt(int x, int y) const {
  const std::size_t step = static_cast<std::size_t>(width_) + 1;
  for (const int half : {3, 5, 8}) {
    const auto left = static_cast<std::size_t>(std::max(0, x - half)),
               right = static_cast<std::size_t>(std::min(width_, x + half + 1)),
               top = static_cast<std::size_t>(std::max(0, y - half)),
               bottom = static_cast<std::size_t>(std::min(height_, y + half + 1));
    const auto &a = sums_[top * step + left], &b = sums_[top * step + right],
               &c = sums_[bottom * step + left], &d = sums_[bottom * step + right];
    const float weight = d[0] - c[0] - b[0] + a[0];
    if (weight < kLeastWeight) continue;
    return Eigen::Vector3f(d[1] - c[1] - b[1] + a[1], d[2] - c[2] - b[2] + a[2], d[3] - c[3] - b[3] + a[3]) /
           weight;
  }
  return mean_surround_;
}

void MarkerPixels::addPixels(const cv::Rect& window) {
  const Eigen::Index most = window.area();
  if (u_.size() < most) {
    u_.resize(most), v_.resize(most);
    colour_.resize(most, 3), surround_.resize(most, 3);
  }
  deep_.assign(layout_.rectangles().size(), Deep());
  count_ = 0;
  std::size_t i = 0;
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x, ++i) {
      const float outside = planes_.outside_px[i];
      if (outside > reach_px_) continue;
      if (planes_.region[i] >= 0.0F && planes_.edge_px[i] > deep_px_) {
        addDeep(static_cast<std::size_t>(planes_.region[i]), planes_.colour(i));
        continue;
      }
      u_[count_] = planes_.u[i], v_[count_] = planes_.v[i];
      colour_(count_, 0) = planes_.luma[i], colour_(count_, 1) = planes_.cb[i],
                      colour_(count_, 2) = planes_.cr[i];
      const Eigen::Vector3f around = outside > -deep_px_ ? surroundAt(x, y) : mean_surround_;
      surround_(count_, 0) = around[0], surround_(count_, 1) = around[1], surround_(count_, 2) = around[2];
      ++count_;
    }
  }
}

void MarkerPixels::addDeep(std::size_t region, const Eigen::Vector3f& colour) {
  Deep& deep = deep_[region];
  const Eigen::Vector3d value = colour.cast<double>();
  if ((value - region_colours_[region]).norm() > kMisfit) {
    ++deep.misfits;
    return;
  }
  ++deep.count;
  deep.sum += value;
  deep.squares += value.squaredNorm();
}

}  // namespace omnifleet::markers
