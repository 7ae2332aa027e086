#include "ground/contour.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

namespace {

/// Bilinear samples of w·(channels) of an 8-bit image.
class Sampler {
 public:
  explicit Sampler(const cv::Mat& image) : image_(image), channels_(image.channels()) {}

  cv::Vec3f colour(float u, float v) const {
    cv::Vec3f c;
    if (!locate(u, v)) return {NAN, NAN, NAN};
    for (int k = 0; k < 3; ++k) c[k] = at(channels_ == 3 ? k : 0);
    return c;
  }
  float value(float u, float v, const cv::Vec3f& w) const {
    const cv::Vec3f c = colour(u, v);
    return c.dot(w);
  }

 private:
  bool locate(float u, float v) const {
    const int x = static_cast<int>(std::floor(u)), y = static_cast<int>(std::floor(v));
    if (x < 0 || y < 0 || x + 1 >= image_.cols || y + 1 >= image_.rows) return false;
    top_ = image_.ptr<std::uint8_t>(y) + x * channels_;
    bottom_ = image_.ptr<std::uint8_t>(y + 1) + x * channels_;
    fu_ = u - static_cast<float>(x);
    fv_ = v - static_cast<float>(y);
    return true;
  }
  float at(int c) const {
    const float top = static_cast<float>(top_[c]) * (1 - fu_) + static_cast<float>(top_[c + channels_]) * fu_;
    const float bottom =
        static_cast<float>(bottom_[c]) * (1 - fu_) + static_cast<float>(bottom_[c + channels_]) * fu_;
    return top * (1 - fv_) + bottom * fv_;
  }

  const cv::Mat& image_;
  int channels_;
  mutable const std::uint8_t *top_ = nullptr, *bottom_ = nullptr;
  mutable float fu_ = 0, fv_ = 0;
};

const cv::Vec3f kLuma(0.114f, 0.587f, 0.299f);  // B, G, R (BT.601, as JPEG keeps it at full resolution)
constexpr float kStep = 0.5f;                   // pixels between the samples along the normal
constexpr int kTangent = 3;                     // points to each side that give the tangent

}  // namespace

ContourOptions ContourOptions::read(const options::Section& section) {
  ContourOptions o;
  section.read("refine", o.refine);
  section.read("search_px", o.search_px, {0.5, 4.0});
  section.read("min_contrast", o.min_contrast, {0.5, 255.0});
  section.finish();
  return o;
}

ContourTracer::ContourTracer(const FloorView& view, const ContourOptions& options)
    : view_(&view), options_(options), visited_(view.imageSize(), std::uint8_t{0}) {}

void ContourTracer::trace(const cv::Mat& image, const cv::Mat1b& objects, const cv::Mat3f& floor,
                          const Blob& blob, Contour& contour) {
  contour.points_px.clear();
  contour.loop_begin.clear();
  for (const Run& run : blob.runs) {
    if (visited_(run.row, run.begin) != 0) continue;
    bool has_above = false;  // a piece of the region starts with a run that has nothing above it
    if (run.row > 0)
      for (int x = std::max(run.begin - 1, 0); x < std::min(run.end + 1, objects.cols) && !has_above; ++x)
        has_above = objects(run.row - 1, x) != 0;
    if (!has_above) followLoop(objects, {run.begin, run.row}, contour);
  }
  for (const auto& p : marked_) visited_(p) = 0;
  marked_.clear();
  if (!options_.refine) return;
  for (std::size_t k = 0; k < contour.loop_begin.size(); ++k) {
    const std::size_t end =
        k + 1 < contour.loop_begin.size() ? contour.loop_begin[k + 1] : contour.points_px.size();
    refine(image, floor, contour.loop_begin[k], end, contour);
  }
}

void ContourTracer::followLoop(const cv::Mat1b& objects, cv::Point start, Contour& contour) {
  // Walks along the pixel edges, the region on the right hand: direction 0 east, 1 south, 2 west, 3 north;
  // `pixel` is the region's pixel beside the edge.
  static constexpr int kAhead[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  const auto isObject = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < objects.cols && y < objects.rows && objects(y, x) != 0;
  };
  const std::size_t begin = contour.points_px.size();
  cv::Point pixel = start;
  int direction = 0;
  double twice_area = 0.0;
  do {
    const int* ahead = kAhead[direction];
    const int left_x = ahead[1], left_y = -ahead[0];  // unit step to the left of the walk
    contour.points_px.emplace_back(static_cast<float>(pixel.x) + 0.5f * static_cast<float>(left_x),
                                   static_cast<float>(pixel.y) + 0.5f * static_cast<float>(left_y));
    if (direction == 0) twice_area -= 2.0 * (pixel.y - 0.5);
    if (direction == 2) twice_area += 2.0 * (pixel.y + 0.5);
    if (direction == 3) {
      visited_(pixel) = 1;
      marked_.push_back(pixel);
    }
    const cv::Point ahead_right(pixel.x + ahead[0], pixel.y + ahead[1]);
    const cv::Point ahead_left(ahead_right.x + left_x, ahead_right.y + left_y);
    if (isObject(ahead_left.x, ahead_left.y)) {  // 8-connected: the diagonal neighbour belongs to the region
      pixel = ahead_left;
      direction = (direction + 3) % 4;
    } else if (isObject(ahead_right.x, ahead_right.y)) {
      pixel = ahead_right;
    } else {
      direction = (direction + 1) % 4;
    }
  } while (pixel != start || direction != 0);
  if (twice_area <= 0.0)
    contour.points_px.resize(begin);  // the border of a hole
  else
    contour.loop_begin.push_back(begin);
}

void ContourTracer::refine(const cv::Mat& image, const cv::Mat3f& floor, std::size_t begin, std::size_t end,
                           Contour& contour) {
  const Sampler sample(image);
  const std::size_t n = end - begin;
  const auto search = static_cast<float>(options_.search_px);
  moved_.assign(contour.points_px.begin() + static_cast<std::ptrdiff_t>(begin),
                contour.points_px.begin() + static_cast<std::ptrdiff_t>(end));
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2f p = contour.points_px[begin + i];
    const Eigen::Vector2f along =
        contour.points_px[begin + (i + kTangent) % n] - contour.points_px[begin + (i + n - kTangent % n) % n];
    const float length = along.norm();
    if (length < 1e-3f || view_->nearBorder(p.x(), p.y())) continue;
    const Eigen::Vector2f inward(-along.y() / length, along.x() / length);
    const int cx = std::clamp(static_cast<int>(p.x() + 0.5f) / FloorView::kCell, 0, floor.cols - 1);
    const int cy = std::clamp(static_cast<int>(p.y() + 0.5f) / FloorView::kCell, 0, floor.rows - 1);
    const cv::Vec3f outside = floor(cy, cx);
    const Eigen::Vector2f deep = p + (search + 0.5f) * inward;
    const cv::Vec3f contrast = sample.colour(deep.x(), deep.y()) - outside;
    if (!(contrast.dot(contrast) > 0.0f)) continue;
    cv::Vec3f weight = kLuma;
    if (std::abs(contrast.dot(kLuma)) < 0.4f * static_cast<float>(cv::norm(contrast)))
      weight = contrast * (1.0f / std::sqrt(contrast.dot(contrast)));
    const float total = contrast.dot(weight);
    if (std::abs(total) < static_cast<float>(options_.min_contrast)) continue;
    const float zero = outside.dot(weight);
    float before = 0.0f, s = -search;
    for (; s <= search + 0.01f; s += kStep) {
      const float share =
          (sample.value(p.x() + s * inward.x(), p.y() + s * inward.y(), weight) - zero) / total;
      if (share >= 0.5f) {
        if (s > -search) {
          const float back = (share - 0.5f) / std::max(share - before, 1e-6f) * kStep;
          moved_[i] = p + (s - back) * inward;
        }
        break;
      }
      before = share;
    }
  }
  std::copy(moved_.begin(), moved_.end(), contour.points_px.begin() + static_cast<std::ptrdiff_t>(begin));
}

}  // namespace omnifleet::ground
