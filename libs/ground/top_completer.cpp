#include "ground/top_completer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr float kLight = 1.08f;    // of the floor's light, from which a pixel may belong to a top
constexpr int kMinTop_px = 40;     // fewer pixels have no usable edge
constexpr double kMinSolid = 0.7;  // share of its hull that a top fills: the lens bends straight edges
constexpr int kMargin_px = 8;      // around the region
constexpr double kOther = 0.5;  // of the floor's light, below which it is another object; what is as light as
                                // the top is another top
constexpr int kBearings = 48;   // samples of the near edge, including
constexpr int kOuter = 5;       // those to each side that pass along the top and are skipped
constexpr double kLeastShare = 0.35;    // of the distance: objects higher than 0.65 of the camera height
constexpr std::size_t kMostRows = 192;  // are not considered
constexpr double kShareStep = 0.01;     // over which the pixel size is measured
constexpr double kMixed_px = 3.0;       // in front of the top's edge, where pixels are mixed of both
constexpr std::size_t kLeastSide_px = 5,
                      kLeastFloor_px = 4;  // minimum rows of a side, and of the floor in front of it
constexpr double kNone = -1.0;
constexpr std::size_t kBearingLag = 2;  // distance between bearings that are compared
constexpr std::size_t kLag = 2;         // rows over which an edge is blurred
constexpr double kLeastGain = 0.06;     // minimum gain of the log-likelihood, per sample
constexpr double kOfFloor =
    0.8;  // multiple of the tolerance of a floor pixel; rows that deviate more belong to a side
constexpr double kFaint = 0.06;  // minimum mean deviation of a side's rows, as a share of the brightness
constexpr double kSmoother =
    4.0;  // minimum ratio of the variances across bearings: the floor in front of a side to the side
constexpr double kMostMetres = 0.025;  // per pixel on the floor; with more the error of the foot is too large
constexpr double kFloorVariance = 1e-4;  // variance due to rounding
constexpr double kTopOnlyShare =
    0.85;  // share of a region's pixels in its top, from which it shows only the top

}  // namespace

TopCompleter::TopCompleter(const lens::Camera& camera, cv::Size image)
    : camera_(camera),
      size_(image.width / kCell * kCell, image.height / kCell * kCell),
      gains_(image, 0.0f),
      light_(image, std::uint8_t{0}),
      whole_(image, std::uint8_t{0}),
      convex_(image, 1) {
  rows_.reserve(kMostRows);
  shares_.reserve(kMostRows);
  until_.reserve(kMostRows + 1);
  near_m_.reserve(kBearings);
}

const std::vector<Run>& TopCompleter::complete(const FloorFrame& frame, const Blob& region) {
  runs_.clear();
  is_undecided_ = is_top_only_ = false;
  if (!findTop(frame, region)) return runs_;
  is_top_only_ = shareInHull(region) >= kTopOnlyShare;
  if (!findNearEdge()) return runs_;
  measureRows(frame);
  const auto foot = findFoot(frame);
  if (!foot) return runs_;
  // The rows pass through pixel centres, and the last ones before the edge are mixed of both. take() fills
  // every pixel that a line touches.
  const double share =
      *foot < shares_.size() ? 0.5 * (shares_[*foot - 1] + shares_[*foot - 2]) : shares_.back();
  is_undecided_ = metresPerPixel(share) > kMostMetres;
  if (!is_undecided_) take(frame, share);
  return runs_;
}

/// On the floor, at that share of the distance.
double TopCompleter::metresPerPixel(double share) const {
  const Eigen::Vector2d& middle = near_m_[near_m_.size() / 2];
  const auto at = pixelAt(middle, share), next = pixelAt(middle, share - kShareStep);
  return at && next ? kShareStep * middle.norm() / std::max(1e-3, (*next - *at).norm()) : kMostMetres;
}

/// Finds the top: pixels lighter than halfway between the floor and the median of the pixels that are lighter
/// than it, in means of 3×3 pixels.
bool TopCompleter::findTop(const FloorFrame& frame, const Blob& region) {
  const cv::Rect& r = region.rect;
  around_ =
      cv::Rect(r.x - kMargin_px, r.y - kMargin_px, r.width + 2 * kMargin_px, r.height + 2 * kMargin_px) &
      cv::Rect(1, 1, size_.width - 2, size_.height - 2);
  for (int y = around_.y - 1; y <= around_.br().y; ++y)
    for (int x = around_.x - 1; x <= around_.br().x; ++x) gains_(y, x) = gainAt(frame, x, y);
  const auto mean = [&](int x, int y) {
    const float *above = gains_.ptr<float>(y - 1) + x, *here = gains_.ptr<float>(y) + x,
                *below = gains_.ptr<float>(y + 1) + x;
    return (above[-1] + above[0] + above[1] + here[-1] + here[0] + here[1] + below[-1] + below[0] +
            below[1]) /
           9.0f;
  };
  lights_.clear();
  for (const Run& run : region.runs) {
    if (run.row < around_.y || run.row >= around_.br().y) continue;
    for (int x = std::max(run.begin, around_.x); x < std::min(run.end, around_.br().x); ++x)
      if (const float gain = mean(x, run.row); gain > kLight) lights_.push_back(gain);
  }
  if (lights_.size() < kMinTop_px) return false;
  const auto middle = lights_.begin() + static_cast<std::ptrdiff_t>(lights_.size() / 2);
  std::nth_element(lights_.begin(), middle, lights_.end());
  limit_ = 0.5f * (1.0f + *middle);
  for (int y = around_.y; y < around_.br().y; ++y)
    for (int x = around_.x; x < around_.br().x; ++x)
      light_(y, x) = frame.view(y, x) != 0 && mean(x, y) > limit_ ? 255 : 0;
  if (!convex_.find(light_, around_, kMinSolid)) return false;
  hull_ = convex_.hull();
  return cv::contourArea(hull_) >= kMinTop_px;
}

/// Finds the nearest crossing with the hull's edges on each sampled bearing.
bool TopCompleter::findNearEdge() {
  top_m_.clear();
  for (std::size_t i = 0; i < hull_.size(); ++i) {
    const cv::Point &from = hull_[i], &to = hull_[(i + 1) % hull_.size()];
    const int steps = std::max(1, std::max(std::abs(to.x - from.x), std::abs(to.y - from.y)) / 2);
    for (int k = 0; k < steps; ++k) {
      const double share = static_cast<double>(k) / steps;
      const auto at =
          camera_.floorFromPixel({from.x + share * (to.x - from.x), from.y + share * (to.y - from.y)});
      if (!at) return false;
      top_m_.push_back(*at - camera_.foot());
    }
  }
  Eigen::Vector2d ahead = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& at : top_m_) ahead += at.normalized();
  ahead.normalize();
  const auto bearing = [&](const Eigen::Vector2d& at) {
    return std::atan2(ahead.x() * at.y() - ahead.y() * at.x(), ahead.dot(at));
  };
  double first = 0.0, last = 0.0;
  for (const Eigen::Vector2d& at : top_m_) {
    first = std::min(first, bearing(at));
    last = std::max(last, bearing(at));
  }
  if (last - first > 2.0) return false;  // the camera is nearly above it
  near_m_.clear();
  for (int k = kOuter; k + kOuter < kBearings; ++k) {
    const double angle = first + (last - first) * k / (kBearings - 1.0);
    const Eigen::Vector2d along(ahead.x() * std::cos(angle) - ahead.y() * std::sin(angle),
                                ahead.x() * std::sin(angle) + ahead.y() * std::cos(angle)),
        normal(-along.y(), along.x());
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < top_m_.size(); ++i) {
      const Eigen::Vector2d &a = top_m_[i], &b = top_m_[(i + 1) % top_m_.size()];
      const double da = normal.dot(a), db = normal.dot(b);
      if ((da < 0.0) == (db < 0.0)) continue;
      nearest = std::min(nearest, along.dot(a + (b - a) * (da / (da - db))));
    }
    if (std::isfinite(nearest) && nearest > 0.0) near_m_.emplace_back(nearest * along);
  }
  return near_m_.size() >= kBearings / 2;
}

/// Pixel of the floor point at that share of the distance; none outside the image.
std::optional<Eigen::Vector2d> TopCompleter::pixelAt(const Eigen::Vector2d& floor_m, double share) const {
  const Eigen::Vector2d at = camera_.foot() + share * floor_m;
  const auto pixel = camera_.pixelFromPoint({at.x(), at.y(), 0.0});
  if (!pixel || !cv::Rect({0, 0}, size_).contains(cv::Point(cvRound(pixel->x()), cvRound(pixel->y()))))
    return std::nullopt;
  return pixel;
}

/// Relative brightness at that share of the distance; kNone where it is neither the floor nor the object.
double TopCompleter::gainAlong(const FloorFrame& frame, const Eigen::Vector2d& floor_m, double share) const {
  const auto at = pixelAt(floor_m, share);
  if (!at) return kNone;
  const cv::Point pixel(cvRound(at->x()), cvRound(at->y()));
  if (frame.view(pixel) == 0) return kNone;
  const double gain = gainAt(frame, pixel.x, pixel.y);
  return gain < kOther || gain > limit_ ? kNone : gain;
}

/// Measures the brightness in front of the near edge, in rows of one pixel distance, until the view ends.
void TopCompleter::measureRows(const FloorFrame& frame) {
  rows_.clear();
  shares_.clear();
  is_cut_ = false;
  const Eigen::Vector2d& middle = near_m_[near_m_.size() / 2];
  const auto before = pixelAt(middle, 1.0);
  for (double share = 1.0; before && rows_.size() < kMostRows;) {
    const auto here = pixelAt(middle, share), next = pixelAt(middle, share - kShareStep);
    if (!here || !next) return;
    const bool is_mixed = (*here - *before).norm() < kMixed_px;
    share -= kShareStep / std::max(1e-3, (*next - *here).norm());
    if (share < kLeastShare) return;
    if (is_mixed) continue;
    Row row;
    std::array<double, kBearingLag> last;
    last.fill(kNone);
    std::size_t k = 0;
    for (const Eigen::Vector2d& near : near_m_) {
      const double gain = gainAlong(frame, near, share), other = std::exchange(last[k++ % kBearingLag], gain);
      if (gain == kNone) continue;
      row.count += 1.0;
      row.sum += gain;
      if (other == kNone) continue;
      row.pairs += 1.0;
      row.squares += 0.5 * (gain - other) * (gain - other);
    }
    if (2.0 * row.pairs < static_cast<double>(near_m_.size())) {
      is_cut_ = true;
      return;
    }
    rows_.push_back(row);
    shares_.push_back(share);
  }
}

/// Log-likelihood of rows [begin, end) as one surface. Its variance is that of the bearings within a row,
/// plus the second differences between rows, because shadows at a foot and the light change gradually from
/// row to row.
double TopCompleter::logLikelihood(std::size_t begin, std::size_t end) const {
  const std::size_t first = std::min(begin + 2 * kLag, end);
  const double count = until_[end].count - until_[begin].count,
               within = until_[end].within - until_[begin].within,
               along = until_[end].along - until_[first].along;
  return -0.5 * count * std::log((within + along) / count + kFloorVariance);
}

/// Squared tolerance of a floor pixel, as a share of the brightness: texture and noise.
double TopCompleter::noise2OfFloor(const FloorFrame& frame) const {
  const cv::Point middle = (around_.tl() + around_.br()) / 2;
  const cv::Vec3f& r = floorAt(frame, middle.x, middle.y);
  return static_cast<double>(frame.noise * frame.noise / std::max(1.0f, r.dot(r)));
}

/// Index of the first floor row; the number of rows where the view ends before the side does.
std::optional<std::size_t> TopCompleter::findFoot(const FloorFrame& frame) {
  const std::size_t n = rows_.size();
  if (n < kLeastSide_px) return std::nullopt;
  const auto meanOf = [this](std::size_t i) { return rows_[i].sum / rows_[i].count; };
  until_.assign(n + 1, {});
  for (std::size_t i = 0; i < n; ++i) {
    const Row& row = rows_[i];
    const double bend = i < 2 * kLag ? 0.0 : meanOf(i) - 2.0 * meanOf(i - kLag) + meanOf(i - 2 * kLag);
    until_[i + 1] = {until_[i].count + row.pairs, until_[i].within + row.squares,
                     until_[i].along + row.pairs * bend * bend};
  }
  const double whole = logLikelihood(0, n);
  double best = kLeastGain * until_[n].count;
  std::optional<std::size_t> foot;
  for (std::size_t i = kLeastSide_px; i + kLeastFloor_px <= n; ++i) {
    const double gained = logLikelihood(0, i) + logLikelihood(i, n) - whole;
    if (gained <= best) continue;
    best = gained;
    foot = i;
  }
  const double noise2 = noise2OfFloor(frame);
  const auto isFloor = [&](std::size_t begin, std::size_t end) {
    return until_[end].within - until_[begin].within <=
           kOfFloor * kOfFloor * noise2 * (until_[end].count - until_[begin].count);
  };
  // A face without the floor's texture, however similar its colour: the floor reference may have leaked onto
  // it.
  const auto isSmoother = [&](std::size_t end) {
    const Sums &side = until_[end], &all = until_[n];
    const double floor = (all.within - side.within) / (all.count - side.count);
    return floor > kFloorVariance && kSmoother * side.within / side.count < floor;
  };
  // The rows in front of the top must differ from the floor.
  const auto isOff = [&](std::size_t end) {
    double off = 0.0;
    for (std::size_t i = 0; i < end; ++i) off += std::abs(meanOf(i) - 1.0) / static_cast<double>(end);
    return off > kFaint || !isFloor(0, end) || isSmoother(end);
  };
  if (foot && (!isFloor(*foot, n) || !isOff(*foot))) foot.reset();
  if (!foot && is_cut_ && !isFloor(0, n)) foot = n;
  return foot;
}

/// Draws hull_ into whole_. @return its bounding rectangle
cv::Rect TopCompleter::drawHull() {
  const cv::Rect box = cv::boundingRect(hull_) & cv::Rect({0, 0}, size_);
  for (int y = box.y; y < box.br().y; ++y) std::fill_n(whole_.ptr(y) + box.x, box.width, std::uint8_t{0});
  const cv::Point* points = hull_.data();
  const int count = static_cast<int>(hull_.size());
  cv::fillPoly(whole_, &points, &count, 1, cv::Scalar(255));
  return box;
}

double TopCompleter::shareInHull(const Blob& region) {
  const cv::Rect box = drawHull();
  int inside = 0;
  for (const Run& run : region.runs) {
    if (run.row < box.y || run.row >= box.br().y) continue;
    const std::uint8_t* row = whole_.ptr(run.row);
    for (int x = std::max(run.begin, box.x); x < std::min(run.end, box.br().x); ++x) inside += row[x] != 0;
  }
  return static_cast<double>(inside) / std::max(1, region.area_px);
}

/// Takes the hull of the top and of its projection to the floor at that share.
void TopCompleter::take(const FloorFrame& frame, double share) {
  outline_ = hull_;
  for (const Eigen::Vector2d& at : top_m_) {
    const auto pixel = pixelAt(at, share);
    if (!pixel) return;
    outline_.emplace_back(cvRound(pixel->x()), cvRound(pixel->y()));
  }
  cv::convexHull(outline_, hull_);
  const cv::Rect box = drawHull();
  for (int y = box.y; y < box.br().y; ++y) {
    const std::uint8_t *row = whole_.ptr(y), *view = frame.view.ptr(y);
    const auto isIn = [&](int x) { return row[x] != 0 && view[x] != 0; };
    for (int begin = box.x; begin < box.br().x; ++begin) {
      if (!isIn(begin)) continue;
      int end = begin;
      while (end < box.br().x && isIn(end)) ++end;
      runs_.push_back({y, begin, end});
      begin = end;
    }
  }
}

}  // namespace omnifleet::ground
