#include "markers/sub_pixel.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace omnifleet::markers {
namespace {

constexpr int kReach_px = 2;  // distance beyond the mask that the blurred edge of the patch reaches
constexpr int kRing_px = 4;   // distance up to which the surroundings are sampled

Eigen::Vector3d colourAt(const cv::Mat& bgr, int x, int y) {
  const std::uint8_t* p = bgr.ptr<std::uint8_t>(y) + 3 * x;
  return {1.0 * p[0], 1.0 * p[1], 1.0 * p[2]};
}

/// Histogram of colours for their median per channel.
class Colours {
 public:
  void add(const cv::Mat& bgr, int x, int y) {
    const std::uint8_t* p = bgr.ptr<std::uint8_t>(y) + 3 * x;
    for (std::size_t c = 0; c < 3; ++c) ++pixels_[c][p[c]];
    ++count_;
  }
  bool empty() const { return count_ == 0; }
  Eigen::Vector3d median() const {
    Eigen::Vector3d result;
    for (std::size_t c = 0; c < 3; ++c) {
      std::size_t level = 0;
      for (int below = pixels_[c][0]; below <= count_ / 2; below += pixels_[c][level]) ++level;
      result[static_cast<Eigen::Index>(c)] = static_cast<double>(level);
    }
    return result;
  }

 private:
  std::array<std::array<int, 256>, 3> pixels_{};
  int count_ = 0;
};

/// Bounding box of the blob with a margin, and the chessboard distance of every pixel to the class of the
/// blob, up to the margin.
struct Window {
  int left, top, width, height;
  std::vector<int> distance;  ///< with a border of one pixel

  int step() const { return width + 2; }
  std::size_t indexOf(int x, int y) const {
    return static_cast<std::size_t>((y - top + 1) * step() + x - left + 1);
  }
  int at(int x, int y) const { return distance[indexOf(x, y)]; }
};

Window windowOf(const cv::Mat& bgr, const ColourTable& table, const Blob& blob) {
  Window w;
  w.left = std::max(0, blob.left - kRing_px);
  w.top = std::max(0, blob.top - kRing_px);
  w.width = std::min(bgr.cols - 1, blob.right + kRing_px) - w.left + 1;
  w.height = std::min(bgr.rows - 1, blob.bottom + kRing_px) - w.top + 1;
  w.distance.assign(static_cast<std::size_t>(w.step() * (w.height + 2)), kRing_px + 1);
  for (int y = blob.top; y <= blob.bottom; ++y) {
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
    int* to = w.distance.data() + w.indexOf(blob.left, y);
    for (int x = blob.left; x <= blob.right; ++x, ++to)
      if (table.classOf(row + 3 * x) == blob.colour) *to = 0;
  }
  // One pass down and one up are exact for the chessboard distance.
  const int step = w.step();
  const auto spread = [](int* at, int row, int pixel) {  // offsets to the previous row and the previous pixel
    *at = std::min({*at, at[row - 1] + 1, at[row] + 1, at[row + 1] + 1, at[pixel] + 1});
  };
  for (int y = 0; y < w.height; ++y) {
    int* row = w.distance.data() + (y + 1) * step + 1;
    for (int x = 0; x < w.width; ++x) spread(row + x, -step, -1);
  }
  for (int y = w.height; y-- > 0;) {
    int* row = w.distance.data() + (y + 1) * step + 1;
    for (int x = w.width; x-- > 0;) spread(row + x, step, 1);
  }
  return w;
}

/// Points of the plane under a window, by bicubic interpolation between 4 × 4 pixels at which the lens is
/// evaluated. A patch is small compared with the focal length, so the error is some micrometres.
class PlaneUnder {
 public:
  /// Evaluates the lens for a window. False unless the plane is visible in all of it.
  bool setWindow(const lens::Camera& camera, double height_m, const Window& w) {
    for (int k = 0; k < kNodes; ++k) {
      u_[k] = w.left + (w.width - 0.5) * k / (kNodes - 1) - 0.25;
      v_[k] = w.top + (w.height - 0.5) * k / (kNodes - 1) - 0.25;
    }
    for (int j = 0; j < kNodes; ++j) {
      for (int i = 0; i < kNodes; ++i) {
        const auto point = camera.planeFromPixel({u_[i], v_[j]}, height_m);
        if (!point) return false;
        nodes_[j][i] = *point;
      }
    }
    left_ = w.left;
    columns_.clear();
    for (int x = 0; x < w.width; ++x) columns_.push_back(weights(u_, w.left + x));
    return true;
  }
  void setRow(double v) {
    const Weights at = weights(v_, v);
    for (int i = 0; i < kNodes; ++i) {
      row_[i].setZero();
      down_[i].setZero();
      for (int j = 0; j < kNodes; ++j) {
        row_[i] += at.value[j] * nodes_[j][i];
        down_[i] += at.slope[j] * nodes_[j][i];
      }
    }
  }
  /// For the row of the last setRow(): the point under column u, and the area of the pixel on the plane, m².
  void at(int u, Eigen::Vector2d& point, double& area) const {
    const Weights& w = columns_[static_cast<std::size_t>(u - left_)];
    Eigen::Vector2d right(0.0, 0.0), down(0.0, 0.0);
    point.setZero();
    for (int i = 0; i < kNodes; ++i) {
      point += w.value[i] * row_[i];
      right += w.slope[i] * row_[i];
      down += w.value[i] * down_[i];
    }
    area = std::abs(right.x() * down.y() - right.y() * down.x());
  }

 private:
  static constexpr int kNodes = 4;
  struct Weights {
    double value[kNodes], slope[kNodes];
  };
  /// Lagrange polynomials and their derivatives for equidistant nodes.
  static Weights weights(const double (&nodes)[kNodes], double at) {
    const double scale = 1.0 / (nodes[1] - nodes[0]), t = (at - nodes[0]) * scale;
    const double a = t, b = t - 1.0, c = t - 2.0, d = t - 3.0;
    return {{-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0},
            {-scale * (c * d + b * d + b * c) / 6.0, scale * (c * d + a * d + a * c) / 2.0,
             -scale * (b * d + a * d + a * b) / 2.0, scale * (b * c + a * c + a * b) / 6.0}};
  }
  int left_ = 0;
  std::vector<Weights> columns_;
  double u_[kNodes], v_[kNodes];
  Eigen::Vector2d nodes_[kNodes][kNodes], row_[kNodes], down_[kNodes];
};

}  // namespace

std::optional<Patch> refine(const cv::Mat& bgr, const ColourTable& table, const Blob& blob,
                            const lens::Camera& camera, double plane_height_m) {
  const Window window = windowOf(bgr, table, blob);
  Colours inside, outside;
  for (int y = window.top; y < window.top + window.height; ++y) {
    for (int x = window.left; x < window.left + window.width; ++x) {
      const int d = window.at(x, y);
      const bool other = table.classOf(bgr.ptr<std::uint8_t>(y) + 3 * x) != 0;
      if (d == 0) inside.add(bgr, x, y);
      if (d > kReach_px && d <= kRing_px && !other) outside.add(bgr, x, y);
    }
  }
  if (inside.empty() || outside.empty()) return std::nullopt;
  const Eigen::Vector3d own = inside.median(), around = outside.median();
  const Eigen::Vector3d axis = own - around;
  if (axis.norm() < 20.0) return std::nullopt;

  const double contrast2 = axis.squaredNorm();
  PlaneUnder plane;
  if (!plane.setWindow(camera, plane_height_m, window)) return std::nullopt;
  Patch patch;
  patch.colour = blob.colour;
  patch.surround_bgr = around;
  patch.samples.reserve(window.distance.size());
  double coverage = 0.0;
  Eigen::Vector2d sum_px(0.0, 0.0), sum_m(0.0, 0.0);
  for (int y = window.top; y < window.top + window.height; ++y) {
    plane.setRow(y);
    for (int x = window.left; x < window.left + window.width; ++x) {
      if (window.at(x, y) > kReach_px) continue;
      const double share = (colourAt(bgr, x, y) - around).dot(axis) / contrast2;
      Eigen::Vector2d here;
      double area = 0.0;
      plane.at(x, here, area);
      patch.samples.push_back({here, std::clamp(share, 0.0, 1.0)});
      const double alpha = share < 0.08 ? 0.0 : std::min(share, 1.0);  // excludes noise of the surroundings
      coverage += alpha;
      sum_px += alpha * Eigen::Vector2d(x, y);
      patch.area_m2 += alpha * area;
      sum_m += alpha * area * here;
    }
  }
  patch.centre_px = sum_px / coverage;
  patch.centre_m = sum_m / patch.area_m2;
  patch.metres_per_px = std::sqrt(patch.area_m2 / coverage);
  return patch;
}

}  // namespace omnifleet::markers
