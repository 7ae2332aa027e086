#include "local_mapper/view_blocks.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::local_mapper {

namespace {

constexpr int kInARow = 40, kSamples = 3;  // per axis of a block

}  // namespace

ViewBlocks::ViewBlocks(const lens::Camera& camera, const ground::FloorView& view)
    : camera_(camera),
      image_(view.imageSize()),
      side_px_(std::max(kSamples, (image_.width + kInARow - 1) / kInARow)) {
  grid_ = {image_.width / side_px_, image_.height / side_px_};
  means_.resize(count());
  before_.resize(count());
  is_in_view_.assign(count(), 0);
  for (int i = 0; i < grid_.area(); ++i) {
    const cv::Rect block(i % grid_.width * side_px_, i / grid_.width * side_px_, side_px_, side_px_);
    if (cv::countNonZero(view.mask()(block)) != block.area()) continue;
    is_in_view_[static_cast<std::size_t>(i)] = 1;
    in_view_.push_back(i);
  }
  findRim();
}

/// Finds the blocks beside everything that can be reached from outside of the image without crossing the
/// view.
void ViewBlocks::findRim() {
  enum : std::uint8_t { kFree = 0, kView = 1, kReached = 2, kRim = 3 };
  cv::Mat1b area(grid_.height + 2, grid_.width + 2, std::uint8_t{kFree});
  for (const int i : in_view_) area(i / grid_.width + 1, i % grid_.width + 1) = kView;
  std::vector<cv::Point> open{{0, 0}};
  area(0, 0) = kReached;
  while (!open.empty()) {
    const cv::Point at = open.back();
    open.pop_back();
    for (const cv::Point step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point to = at + step;
      if (!cv::Rect({0, 0}, area.size()).contains(to)) continue;
      if (area(to) == kView) {
        area(to) = kRim;
        rim_.push_back((to.y - 1) * grid_.width + to.x - 1);
      } else if (area(to) == kFree) {
        area(to) = kReached;
        open.push_back(to);
      }
    }
  }
  std::sort(rim_.begin(), rim_.end());
}

void ViewBlocks::read(const cv::Mat& image) {
  means_.swap(before_);
  frames_ = std::min(frames_ + 1, 2);
  const int step = side_px_ / kSamples, channels = image.channels();
  for (const int i : in_view_) {
    const int x0 = i % grid_.width * side_px_ + step / 2, y0 = i / grid_.width * side_px_ + step / 2;
    int sum[3] = {};
    for (int y = 0; y < kSamples; ++y) {
      const std::uint8_t* row = image.ptr(y0 + y * step);
      for (int x = 0; x < kSamples; ++x)
        for (int c = 0; c < 3; ++c) sum[c] += row[(x0 + x * step) * channels + (channels == 3 ? c : 0)];
    }
    constexpr float kShare = 1.0f / (kSamples * kSamples);
    means_[static_cast<std::size_t>(i)] = {kShare * static_cast<float>(sum[0]),
                                           kShare * static_cast<float>(sum[1]),
                                           kShare * static_cast<float>(sum[2])};
  }
}

float ViewBlocks::difference(const cv::Vec3f& a, const cv::Vec3f& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

float ViewBlocks::hueDifference(const cv::Vec3f& a, const cv::Vec3f& b) {
  constexpr double kDark = 15.0;  // norm; below it noise determines the hue
  const double length_a = cv::norm(a), length_b = cv::norm(b);
  if (length_a < kDark || length_b < kDark) return 0.0f;
  return static_cast<float>(
      cv::norm(a * static_cast<float>(1.0 / length_a) - b * static_cast<float>(1.0 / length_b)));
}

bool ViewBlocks::differs(int block, const Means& then, float levels) const {
  constexpr int kAround = 2;
  const cv::Vec3f& now = means_[static_cast<std::size_t>(block)];
  cv::Vec3f low = then[static_cast<std::size_t>(block)], high = low;
  if (difference(now, low) <= levels) return false;  // true for most of an image, most of the time
  const int x = block % grid_.width, y = block / grid_.width;
  float hue = 1.0f;  // smallest difference so far
  for (int v = std::max(0, y - kAround); v <= std::min(grid_.height - 1, y + kAround); ++v) {
    for (int u = std::max(0, x - kAround); u <= std::min(grid_.width - 1, x + kAround); ++u) {
      const int at = v * grid_.width + u;
      if (!isInView(at)) continue;
      const cv::Vec3f& colour = then[static_cast<std::size_t>(at)];
      hue = std::min(hue, hueDifference(now, colour));
      for (int c = 0; c < 3; ++c) {
        low[c] = std::min(low[c], colour[c]);
        high[c] = std::max(high[c], colour[c]);
      }
    }
  }
  if (hue > kAnotherHue) return true;  // next to bright and dark blocks any brightness is possible
  for (int c = 0; c < 3; ++c)
    if (now[c] < low[c] - levels || now[c] > high[c] + levels) return true;
  return false;
}

/// Block that showed the content of this block before the robot turned; −1 outside of the view.
int ViewBlocks::turned(int block, double angle_rad) const {
  if (angle_rad == 0.0) return block;
  const double half = 0.5 * (side_px_ - 1);
  const auto ray =
      camera_.rayFromPixel({block % grid_.width * side_px_ + half, block / grid_.width * side_px_ + half});
  if (!ray) return -1;
  const Eigen::Vector3d then = Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()) * *ray;
  const auto pixel = camera_.lens().pixelFromRay(camera_.parentFromCamera().linear().transpose() * then);
  if (!pixel) return -1;
  const cv::Point at(static_cast<int>(std::floor(pixel->x() / side_px_)),
                     static_cast<int>(std::floor(pixel->y() / side_px_)));
  if (!cv::Rect({0, 0}, grid_).contains(at) || !isInView(at.y * grid_.width + at.x)) return -1;
  return at.y * grid_.width + at.x;
}

std::optional<double> ViewBlocks::correlation(const std::vector<int>& blocks, const Means& then,
                                              double turned_rad) const {
  constexpr double kStructure = 0.05;  // σ of the logarithm
  const auto brightness = [](const cv::Vec3f& c) { return std::log(1.0 + c[0] + c[1] + c[2]); };
  double n = 0.0, a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
  for (const int i : blocks) {
    const int from = turned(i, turned_rad);
    if (from < 0) continue;
    const double now = brightness(means_[static_cast<std::size_t>(i)]),
                 old = brightness(then[static_cast<std::size_t>(from)]);
    n += 1.0;
    a += now;
    b += old;
    aa += now * now;
    bb += old * old;
    ab += now * old;
  }
  if (n < 2.0) return std::nullopt;
  const double now2 = aa / n - a * a / (n * n), old2 = bb / n - b * b / (n * n);
  if (old2 < kStructure * kStructure) return std::nullopt;
  return (ab / n - a * b / (n * n)) / std::sqrt(std::max(now2, 1e-6) * old2);
}

}  // namespace omnifleet::local_mapper
