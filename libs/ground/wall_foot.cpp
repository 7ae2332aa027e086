#include "ground/wall_foot.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::ground {

namespace {

constexpr double kDegree = M_PI / 180.0, kBearing_rad = 2.0 * M_PI / WallFoot::kBearings;
constexpr double kFirst_deg = 55.0, kLast_deg = 2.0;  // depressions between which walls are searched for
constexpr double kLeastStep_deg = 0.15,
                 kMostStep_deg = 0.6;  // limits of a step, which is one pixel between them
constexpr double kWindow_deg = 1.2;    // twice this angle is compared on either side
constexpr int kLeastPixels = 2;
constexpr int kShadow = 3;           // bearings beside an object on which its shadow may lie
constexpr float kMostSigmas = 3.0f;  // limit of one bearing's contribution
constexpr int kDirectionStride = 3, kStepStride = 2, kBearingStride = 3;  // of the first, coarse search
constexpr int kAround = 12,
              kLeastSeen = 8;           // bearings to either side, and how many of them must show the line
constexpr float kLeastEvidence = 1.0f;  // σ, mean of these bearings
constexpr int kLeastBearings = 20, kMostLines = 6;
constexpr float kLeastScore = 60.0f;  // kLeastBearings bearings with kMostSigmas each
constexpr int kTurned2 = 18;  // half bearings by which the directions of lines behind one another may differ
constexpr float kAsPlain = 0.35f;  // minimum score of a line behind another, as a share of the other's
constexpr float kNone = std::numeric_limits<float>::infinity();

int wrapBearing(int bearing) {
  return (bearing % WallFoot::kBearings + WallFoot::kBearings) % WallFoot::kBearings;
}

}  // namespace

WallFoot::WallFoot(const lens::Camera& camera, const FloorView& floor_view)
    : height_m_(camera.height()),
      places_(floor_view.cells(), cv::Vec2s(-1, 0)),
      open_(kBearings, 0),
      line_of_(kBearings, -1),
      range_m_(kBearings, kNone) {
  layOutSteps(camera, floor_view);
  layOutCells(camera, floor_view);
  layOutLines();
  sums_.resize(static_cast<std::size_t>(kBearings * (steps_ + 1)));
  contrast_.resize(pixels_.size());
  sorted_.resize(pixels_.size());  // all its memory is touched before the first frame
  lines_.reserve(kMostLines);
}

void WallFoot::layOutSteps(const lens::Camera& camera, const FloorView& floor_view) {
  const auto pixelAt = [&](double bearing, double depression) {
    const double range = height_m_ / std::tan(depression);
    return camera.pixelFromPoint(
        {camera.foot().x() + range * std::cos(bearing), camera.foot().y() + range * std::sin(bearing), 0.0});
  };
  const auto a = pixelAt(0.0, 30 * kDegree), b = pixelAt(0.0, 29 * kDegree);
  const double pixel_deg = a && b ? 1.0 / std::max(1e-3, (*a - *b).norm()) : kLeastStep_deg;
  step_rad_ = std::clamp(pixel_deg, kLeastStep_deg, kMostStep_deg) * kDegree;
  steps_ = static_cast<int>((kFirst_deg - kLast_deg) * kDegree / step_rad_);
  window_ = std::max(2, static_cast<int>(std::lround(kWindow_deg * kDegree / step_rad_)));
  for (int k = 0; k < kBearings; ++k) {
    const double turns = k / static_cast<double>(kBearings) + 0.5;
    const int sector = static_cast<int>((turns - std::floor(turns)) * Horizon::kSectors);
    sector_.push_back(static_cast<std::uint8_t>(1 + std::min(Horizon::kSectors - 1, sector)));
    for (int s = 0; s < steps_; ++s) {
      const auto pixel = pixelAt(k * kBearing_rad, kFirst_deg * kDegree - s * step_rad_);
      const cv::Point at = pixel ? cv::Point(cvRound(pixel->x()), cvRound(pixel->y())) : cv::Point(-1, -1);
      const bool seen = cv::Rect({0, 0}, floor_view.imageSize()).contains(at) && floor_view.mask()(at) != 0;
      pixels_.push_back(seen ? Step{static_cast<std::int16_t>(at.x), static_cast<std::int16_t>(at.y)}
                             : Step{-1, -1});
    }
  }
}

void WallFoot::layOutLines() {
  for (int beside2 = 0; beside2 <= 2 * kWide + 1; ++beside2) {
    for (int step2 = 0; step2 < 2 * steps_; ++step2) {
      const double ahead = kFirst_deg * kDegree - (0.5 * step2 - 0.5) * step_rad_;
      const double depression = std::atan(std::tan(ahead) * std::cos(0.5 * beside2 * kBearing_rad));
      curves_.push_back(static_cast<float>((kFirst_deg * kDegree - depression) / step_rad_ + 0.5));
    }
  }
  scores_.resize(static_cast<std::size_t>(steps_));
}

void WallFoot::layOutCells(const lens::Camera& camera, const FloorView& floor_view) {
  constexpr int kCell = FloorView::kCell;
  for (int y = 0; y < places_.rows; ++y) {
    for (int x = 0; x < places_.cols; ++x) {
      const auto floor = camera.floorFromPixel({(x + 0.5) * kCell - 0.5, (y + 0.5) * kCell - 0.5});
      if (!floor || floor_view.coverage()(y, x) == 0) continue;
      const Eigen::Vector2d to = *floor - camera.foot();
      const int bearing =
          wrapBearing(static_cast<int>(std::lround(std::atan2(to.y(), to.x()) / kBearing_rad)));
      const double depression = std::atan2(height_m_, to.norm());
      places_(y, x) = {static_cast<short>(bearing),
                       static_cast<short>(std::lround((kFirst_deg * kDegree - depression) / step_rad_))};
    }
  }
}

void WallFoot::readSteps(const cv::Mat& image, const cv::Mat1b& objects) {
  const int channels = image.channels();
  const Step* pixel = pixels_.data();
  Sum* sum = sums_.data();
  for (int k = 0; k < kBearings; ++k) {
    Sum so_far{0.0f, 0.0f, 0.0f};
    *sum++ = so_far;
    for (int s = 0; s < steps_; ++s, ++pixel, *sum++ = so_far) {
      if (pixel->u < 0) continue;
      if (objects(pixel->v, pixel->u) != 0) {
        so_far.hidden += 1.0f;
        continue;
      }
      const std::uint8_t* at = image.ptr(pixel->v) + pixel->u * channels;
      so_far.brightness += static_cast<float>(channels == 3 ? at[0] + at[1] + at[2] : 3 * at[0]);
      so_far.count += 1.0f;
    }
  }
}

/// Relative difference in brightness between what lies from `from` to `to` steps beyond a step and what lies
/// as far in front of it. 0 where either is not visible.
float WallFoot::stepBetween(int bearing, int at, int from, int to) const {
  const Sum* sums = sums_.data() + bearing * (steps_ + 1);
  const auto clamped = [&](int step) { return sums + std::clamp(step, 0, steps_); };
  const Sum &inner_begin = *clamped(at - to), &inner_end = *clamped(at - from),
            &outer_begin = *clamped(at + from), &outer_end = *clamped(at + to);
  const float before = inner_end.count - inner_begin.count, after = outer_end.count - outer_begin.count;
  if (before < kLeastPixels || after < kLeastPixels) return 0.0f;
  const float inner = (inner_end.brightness - inner_begin.brightness) / before,
              outer = (outer_end.brightness - outer_begin.brightness) / after;
  return (outer - inner) / std::max(1.0f, 0.5f * (inner + outer));
}

/// Contrast that both the near and the far half of the window show, without the contribution of linearly
/// changing light (three times as large in the far half). A line on the floor is thus no edge.
float WallFoot::contrastAt(int bearing, int step) const {
  const int begin = std::max(0, step - 2 * window_), end = std::min(steps_, step + 2 * window_);
  for (const int beside : {-kShadow, 0, kShadow}) {
    const Sum* sums = sums_.data() + wrapBearing(bearing + beside) * (steps_ + 1);
    if (sums[end].hidden > sums[begin].hidden) return 0.0f;
  }
  const float near = stepBetween(bearing, step, 0, window_),
              far = stepBetween(bearing, step, window_, 2 * window_);
  const float step_alone = 0.5f * (3.0f * near - far);
  if (step_alone * far <= 0.0f) return 0.0f;
  return std::abs(step_alone) < std::abs(far) ? step_alone : far;
}

/// Converts the contrasts to σ of what most of the floor and the walls show: texture and noise. @return false
/// where nothing is visible
bool WallFoot::measureContrasts() {
  sorted_.clear();
  float* contrast = contrast_.data();
  for (int k = 0; k < kBearings; ++k) {
    const bool is_open = open_[static_cast<std::size_t>(k)] != 0;
    for (int s = 0; s < steps_; ++s, ++contrast) {
      *contrast = is_open ? contrastAt(k, s) : 0.0f;
      if (*contrast != 0.0f && k % 4 == 0) sorted_.push_back(std::abs(*contrast));
    }
  }
  if (sorted_.empty()) return false;
  const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  constexpr float kSigmaOfMedian = 1.4826f, kLeast = 1e-3f;
  const float per_sigma = 1.0f / std::max(kLeast, kSigmaOfMedian * *middle);
  for (float& value : contrast_) value = std::clamp(value * per_sigma, -kMostSigmas, kMostSigmas);
  return true;
}

/// Step at which a line is seen at a bearing; steps_ where it is not visible.
float WallFoot::stepOf(const Line& line, int bearing) const {
  const int beside2 =
      wrapBearing(bearing - line.direction2 / 2 + kBearings / 2) * 2 - kBearings - line.direction2 % 2;
  return std::abs(beside2) <= 2 * kWide + 1 ? curve(beside2)[line.step2] : static_cast<float>(steps_);
}

float WallFoot::evidenceOf(const Line& line, int bearing) const {
  const auto step = static_cast<int>(stepOf(line, bearing) + 0.5f);
  return step >= 0 && step < steps_
             ? contrast_[static_cast<std::size_t>(wrapBearing(bearing) * steps_ + step)]
             : 0.0f;
}

float WallFoot::scoreOf(const Line& line) const {
  float sum = 0.0f;
  for (int k = line.direction2 / 2 - kWide + 1; k < line.direction2 / 2 + kWide; ++k)
    if (open_[static_cast<std::size_t>(wrapBearing(k))] != 0) sum += evidenceOf(line, k);
  return sum;
}

/// Sums the contrasts of every third bearing along the lines in a direction, into scores_.
void WallFoot::sumAlongLines(int direction) {
  std::fill(scores_.begin(), scores_.end(), 0.0f);
  for (int beside = -kWide; beside <= kWide; beside += kBearingStride) {
    const auto k = static_cast<std::size_t>(wrapBearing(direction + beside));
    if (open_[k] == 0) continue;
    const float* row = contrast_.data() + k * static_cast<std::size_t>(steps_);
    const float* steps = curve(2 * beside);
    for (int s = 0; s < steps_; s += kStepStride) {
      const auto step = static_cast<int>(steps[2 * s] + 0.5f);
      if (step >= steps_) break;  // the line is above the last step from there on
      scores_[static_cast<std::size_t>(s)] += row[step];
    }
  }
}

WallFoot::Line WallFoot::findLine() {
  Line rough;
  for (int direction = 0; direction < kBearings; direction += kDirectionStride) {
    sumAlongLines(direction);
    for (int s = 0; s < steps_; s += kStepStride) {
      const float score = scores_[static_cast<std::size_t>(s)];
      if (std::abs(score) > std::abs(rough.score)) rough = {2 * direction, 2 * s, score};
    }
  }
  Line best;
  for (int a = -kDirectionStride; a <= kDirectionStride; ++a) {
    for (int s = std::max(0, rough.step2 - 4); s <= std::min(2 * steps_ - 1, rough.step2 + 4); ++s) {
      Line line{rough.direction2 + a, s, 0.0f};
      line.score = scoreOf(line);
      if (std::abs(line.score) > std::abs(best.score)) best = line;
    }
  }
  return best;
}

/// The farthest of the lines that lie behind one another.
WallFoot::Line WallFoot::outermost(Line line) const {
  for (;;) {
    Line beyond;
    for (int a = -kTurned2; a <= kTurned2; a += kDirectionStride) {
      for (int s = line.step2 + 4 * window_; s < 2 * steps_; s += 2) {
        Line other{line.direction2 + a, s, 0.0f};
        other.score = scoreOf(other);
        if (std::abs(other.score) > std::abs(beyond.score)) beyond = other;
      }
    }
    if (std::abs(beyond.score) < std::max(kLeastScore, kAsPlain * std::abs(line.score))) return line;
    line = beyond;
  }
}

/// Distance at which a line meets the floor, metres; infinite where it is not visible.
float WallFoot::rangeOf(const Line& line, int bearing) const {
  const double depression =
      kFirst_deg * kDegree - (static_cast<double>(stepOf(line, bearing)) - 0.5) * step_rad_;
  return depression > kLast_deg * kDegree ? static_cast<float>(height_m_ / std::tan(depression)) : kNone;
}

/// Assigns to the line the bearings that confirm it, by the evidence around each. @return false where they
/// are too few
bool WallFoot::accept(const Line& line) {
  const int middle = line.direction2 / 2;
  const float sign = line.score < 0.0f ? -1.0f : 1.0f;
  std::array<float, 2 * kWide + 1> evidence{};
  for (int i = 0; i <= 2 * kWide; ++i)
    evidence[static_cast<std::size_t>(i)] = sign * evidenceOf(line, middle - kWide + i);
  int found = 0;
  for (int i = 0; i <= 2 * kWide; ++i) {
    const auto k = static_cast<std::size_t>(wrapBearing(middle - kWide + i));
    if (open_[k] == 0) continue;
    float sum = 0.0f;
    int seen = 0;
    for (int j = std::max(0, i - kAround); j <= std::min(2 * kWide, i + kAround); ++j) {
      sum += evidence[static_cast<std::size_t>(j)];
      seen += evidence[static_cast<std::size_t>(j)] != 0.0f ? 1 : 0;
    }
    if (seen < kLeastSeen || sum < kLeastEvidence * static_cast<float>(seen)) continue;
    range_m_[k] = rangeOf(line, middle - kWide + i);
    if (range_m_[k] == kNone) continue;
    open_[k] = 0;
    line_of_[k] = static_cast<int>(lines_.size());
    ++found;
  }
  return found >= kLeastBearings;
}

/// In a corner the nearer of both walls is visible.
void WallFoot::resolveCorners() {
  for (int k = 0; k < kBearings; ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (line_of_[at] < 0) continue;
    for (int beside = k - kAround; beside <= k + kAround; ++beside) {
      const int other = line_of_[static_cast<std::size_t>(wrapBearing(beside))];
      if (other >= 0 && other != line_of_[at])
        range_m_[at] = std::min(range_m_[at], rangeOf(lines_[static_cast<std::size_t>(other)], k));
    }
  }
}

void WallFoot::find(const cv::Mat& image, const cv::Mat1b& objects, const Sectors& leaked) {
  any_ = false;
  for (std::size_t k = 0; k < kBearings; ++k) open_[k] = leaked[sector_[k]];
  if (std::count(open_.begin(), open_.end(), std::uint8_t{1}) < kLeastBearings) return;
  std::fill(range_m_.begin(), range_m_.end(), kNone);
  readSteps(image, objects);
  if (!measureContrasts()) return;
  lines_.clear();
  std::fill(line_of_.begin(), line_of_.end(), -1);
  for (int i = 0; i < kMostLines; ++i) {
    const Line line = outermost(findLine());
    if (std::abs(line.score) < kLeastScore || !accept(line)) break;
    lines_.push_back(line);
  }
  const int last = static_cast<int>(lines_.size());
  for (std::size_t k = 0; k < kBearings; ++k) {
    if (line_of_[k] < last) continue;  // otherwise the line was rejected
    line_of_[k] = -1;
    range_m_[k] = kNone;
  }
  resolveCorners();
  any_ = std::any_of(range_m_.begin(), range_m_.end(), [](float range) { return range < kNone; });
}

bool WallFoot::isBehind(const cv::Point& cell) const {
  const cv::Vec2s& place = places_(cell);
  if (place[0] < 0) return false;
  const float range_m = range_m_[static_cast<std::size_t>(place[0])];
  const double depression = kFirst_deg * kDegree - place[1] * step_rad_;
  return range_m < kNone && height_m_ > static_cast<double>(range_m) * std::tan(depression);
}

}  // namespace omnifleet::ground
