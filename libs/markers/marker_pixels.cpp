#include "markers/marker_pixels.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace omnifleet::markers {
namespace {

constexpr float kRing_px = 6.0F;    // surroundings are sampled up to this distance from the outline
constexpr float kReach_px = 2.5F;   // pixels up to this distance from the outline take part in the fit
constexpr float kDeep_px = 4.0F;    // no blur reaches farther
constexpr float kBeside_px = 0.8F;  // nearer pixels contain the marker and give no colour of the surroundings
constexpr float kInside_px = 0.7F;  // pixels this far inside a region give the first estimate of its colour
constexpr float kLeastWeight = 3.0F;  // pixels; with less the surroundings are averaged over a larger square
constexpr float kMisfit = 40.0F;  // grey levels between a pixel and its region beyond which it is occluded

}  // namespace

Eigen::Vector3f lumaChroma(float blue, float green, float red) {
  const float luma = 0.299F * red + 0.587F * green + 0.114F * blue;
  return {luma, 0.564F * (blue - luma), 0.713F * (red - luma)};
}

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

bool MarkerPixels::collect(const cv::Mat& bgr, const Pattern& pattern, const Pose2& map_from_base) {
  const cv::Rect window = windowAround(map_from_base, bgr.size());
  if (window.width < 4 || window.height < 4 || !plane_.set(camera_, height_m_, window)) return false;
  metres_per_px_ = std::sqrt(std::abs(plane_.scale().determinant()));
  if (!(metres_per_px_ > 0.0)) return false;
  width_ = window.width, height_ = window.height;
  pixels_.resize(static_cast<std::size_t>(width_ * height_));
  const Eigen::Matrix2d turn = map_from_base.rotation().transpose();
  const Eigen::Vector2d from = map_from_base.translation();
  const float px_per_m = static_cast<float>(1.0 / metres_per_px_);
  const auto& rectangles = layout_.rectangles();
  Pixel* pixel = pixels_.data();
  int inside = 0;
  double union_m2 = 0.0;
  for (const Component& c : pattern.components) union_m2 += c.area_m2;
  for (int y = window.y; y < window.y + window.height; ++y) {
    plane_.setRow(y);
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
    for (int x = window.x; x < window.x + window.width; ++x, ++pixel) {
      const Eigen::Vector2d in_base = turn * (plane_.at(x) - from);
      pixel->u = static_cast<float>(in_base.x()), pixel->v = static_cast<float>(in_base.y());
      pixel->outside_px = pixel->edge_px = 1e6F;
      pixel->region = -1;
      for (std::size_t i = 0; i < rectangles.size(); ++i) {
        const Eigen::Vector2d d = (in_base - rectangles[i].centre_m).cwiseAbs() - rectangles[i].half_m;
        const float outside = px_per_m * static_cast<float>(d.maxCoeff());
        pixel->outside_px = std::min(pixel->outside_px, outside);
        pixel->edge_px = std::min(pixel->edge_px, std::abs(outside));
        if (outside <= 0.0F) pixel->region = static_cast<int>(i);
      }
      inside += pixel->region >= 0 ? 1 : 0;
      pixel->colour = lumaChroma(row[3 * x], row[3 * x + 1], row[3 * x + 2]);
    }
  }
  visible_share_ = inside * metres_per_px_ * metres_per_px_ / union_m2;
  if (visible_share_ < 0.25) return false;
  measureRegions(bgr, window, pattern);
  sumSurroundings(window);
  addPixels(window);
  return true;
}

/// Estimates the colour of each region from the pixels well inside that have its class, so that an occluder
/// does not disturb it. Without such pixels from all pixels inside.
void MarkerPixels::measureRegions(const cv::Mat& bgr, const cv::Rect& window, const Pattern& pattern) {
  struct Sum {
    Eigen::Vector3d colour{0.0, 0.0, 0.0};
    double count = 0.0;
  };
  std::array<std::array<Sum, 2>, 3> sums{};  // of all pixels, of the pixels of the class
  const Pixel* pixel = pixels_.data();
  for (int y = window.y; y < window.y + window.height; ++y) {
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
    for (int x = window.x; x < window.x + window.width; ++x, ++pixel) {
      if (pixel->region < 0 || pixel->edge_px < kInside_px) continue;
      const auto region = static_cast<std::size_t>(pixel->region);
      const bool same = table_.classOf(row + 3 * x) == pattern.colours[region];
      for (std::size_t k = 0; k < (same ? 2U : 1U); ++k) {
        sums[region][k].colour += pixel->colour.cast<double>();
        sums[region][k].count += 1.0;
      }
    }
  }
  region_colours_.assign(layout_.rectangles().size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 0; i < region_colours_.size(); ++i) {
    const Sum& sum = sums[i][sums[i][1].count >= 2.0 ? 1 : 0];
    if (sum.count > 0.0) region_colours_[i] = sum.colour / sum.count;
  }
}

/// Integral image of the surroundings' colours. The weight rises from 0 beside the outline to 1 where the
/// blur of the marker ends.
void MarkerPixels::sumSurroundings(const cv::Rect& window) {
  const std::size_t step = static_cast<std::size_t>(window.width) + 1;
  sums_.assign(step * (static_cast<std::size_t>(window.height) + 1), {0.0F, 0.0F, 0.0F, 0.0F});
  const Pixel* pixel = pixels_.data();
  for (int y = 0; y < window.height; ++y) {
    std::array<float, 4> row{};
    std::array<float, 4>* to = sums_.data() + (static_cast<std::size_t>(y) + 1) * step + 1;
    for (int x = 0; x < window.width; ++x, ++pixel, ++to) {
      const float share =
          std::clamp((pixel->outside_px - kBeside_px) / (kReach_px - kBeside_px), 0.0F, 1.0F);
      const float weight = pixel->outside_px > kRing_px ? 0.0F : share * share;
      row[0] += weight;
      for (std::size_t c = 0; c < 3; ++c)
        row[c + 1] += weight * pixel->colour[static_cast<Eigen::Index>(c)];
      for (std::size_t c = 0; c < 4; ++c) (*to)[c] = (to - step)->at(c) + row[c];
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
    const auto &a = sums_[top * step + left], &b = sums_[top * step + right], &c = sums_[bottom * step + left],
               &d = sums_[bottom * step + right];
    const float weight = d[0] - c[0] - b[0] + a[0];
    if (weight < kLeastWeight) continue;
    return Eigen::Vector3f(d[1] - c[1] - b[1] + a[1], d[2] - c[2] - b[2] + a[2], d[3] - c[3] - b[3] + a[3]) /
           weight;
  }
  return mean_surround_;
}

void MarkerPixels::addPixels(const cv::Rect& window) {
  const auto most = static_cast<Eigen::Index>(pixels_.size());
  if (u_.size() < most) {
    u_.resize(most), v_.resize(most);
    colour_.resize(most, 3), surround_.resize(most, 3);
  }
  deep_.assign(layout_.rectangles().size(), Deep());
  count_ = 0;
  const Pixel* pixel = pixels_.data();
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x, ++pixel) {
      if (pixel->outside_px > kReach_px) continue;
      if (pixel->region >= 0 && pixel->edge_px > kDeep_px) {
        addDeep(static_cast<std::size_t>(pixel->region), pixel->colour);
        continue;
      }
      u_[count_] = pixel->u, v_[count_] = pixel->v;
      colour_.row(count_) = pixel->colour.transpose().array();
      surround_.row(count_) =
          (pixel->outside_px > -kDeep_px ? surroundAt(x, y) : mean_surround_).transpose().array();
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
