#include "ground/notch_splitter.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr float kLeastDepth_px = 2.0f,
                kLeastDepthShare = 0.05f;  // kLeastDepthShare: of the square root of the area
constexpr std::size_t kMostNotches = 6;
constexpr std::size_t kNearby = 6;      // points of the outline next to a notch that belong to it
constexpr double kLeastGain = 0.3;      // of a loop's concavity, by one of possibly several chords
constexpr float kLongestChord = 1.15f;  // of the square root of the smaller part's area

double areaOf(const std::vector<cv::Point2f>& points) {
  double twice = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto &a = points[i], &b = points[i + 1 < points.size() ? i + 1 : 0];
    twice += static_cast<double>(a.x) * b.y - static_cast<double>(a.y) * b.x;
  }
  return 0.5 * std::abs(twice);
}

}  // namespace

NotchOptions NotchOptions::read(const options::Section& section) {
  NotchOptions o;
  section.read("enabled", o.enabled);
  section.read("max_solidity", o.max_solidity, {0.0, 1.0});
  section.read("min_gain", o.min_gain, {0.0, 1.0});
  section.read("min_share", o.min_share, {0.0, 0.5});
  section.read("min_area_px", o.min_area_px, {4, 1000000});
  section.finish();
  return o;
}

NotchSplitter::NotchSplitter(const FloorView& view, const NotchOptions& options)
    : view_(&view), options_(options), mask_(view.imageSize(), std::uint8_t{0}) {}

const std::vector<Blob>& NotchSplitter::split(const Blob& blob, const Contour& contour) {
  clearMask();
  if (!options_.enabled || blob.area_px < 2 * options_.min_area_px) return parts_;
  takeLoops(contour);
  const double least = std::max<double>(options_.min_area_px, options_.min_share * blob.area_px);
  const double before = notches();
  const std::size_t pieces = loops_.size();
  while (loops_.size() < kMaxParts && cutWorst(least)) {
  }
  if (loops_.size() > pieces && notches() > (1.0 - options_.min_gain) * before) return parts_;
  const auto small = [&](const Loop& loop) { return loop.area < least; };
  loops_.erase(std::remove_if(loops_.begin(), loops_.end(), small), loops_.end());
  if (loops_.size() > 1) write(blob);
  return parts_;
}

void NotchSplitter::clearMask() {
  for (const Blob& part : parts_)
    for (const Run& run : part.runs)
      std::fill(mask_.ptr(run.row) + run.begin, mask_.ptr(run.row) + run.end, std::uint8_t{0});
  parts_.clear();
}

void NotchSplitter::measure(Loop& loop) {
  loop.area = areaOf(loop.points);
  cv::convexHull(loop.points, hull_points_);
  loop.hull_area = cv::contourArea(hull_points_);
}

void NotchSplitter::takeLoops(const Contour& contour) {
  loops_.clear();
  for (std::size_t k = 0; k < contour.loop_begin.size(); ++k) {
    const std::size_t begin = contour.loop_begin[k];
    const std::size_t end =
        k + 1 < contour.loop_begin.size() ? contour.loop_begin[k + 1] : contour.points_px.size();
    loops_.emplace_back();
    for (std::size_t i = begin; i < end; ++i)
      loops_.back().points.emplace_back(contour.points_px[i].x(), contour.points_px[i].y());
    measure(loops_.back());
  }
}

double NotchSplitter::notches() const {
  double sum = 0.0;
  for (const Loop& loop : loops_) sum += loop.notches();
  return sum;
}

/// Cuts the loop with the most concavity. @return false when no loop should be cut
bool NotchSplitter::cutWorst(double least_area) {
  std::size_t worst = loops_.size();
  for (std::size_t k = 0; k < loops_.size(); ++k) {
    const Loop& loop = loops_[k];
    if (loop.area < 2.0 * least_area || loop.area >= options_.max_solidity * loop.hull_area) continue;
    if (worst == loops_.size() || loop.notches() > loops_[worst].notches()) worst = k;
  }
  if (worst == loops_.size()) return false;
  findNotches(loops_[worst]);
  std::size_t from = 0, to = 0;
  if (!findChord(loops_[worst], least_area, from, to)) return false;
  part(loops_[worst], from, to, first_, second_);
  std::swap(loops_[worst], first_);
  loops_.push_back(second_);
  return true;
}

/// Finds the deepest point below each edge of the hull.
void NotchSplitter::findNotches(const Loop& loop) {
  cv::convexHull(loop.points, hull_, false, false);
  std::sort(hull_.begin(), hull_.end());
  found_.clear();
  const float least = std::max(kLeastDepth_px, kLeastDepthShare * static_cast<float>(std::sqrt(loop.area)));
  const std::size_t n = loop.points.size();
  for (std::size_t k = 0; k < hull_.size(); ++k) {
    const auto begin = static_cast<std::size_t>(hull_[k]);
    const auto end = k + 1 < hull_.size() ? static_cast<std::size_t>(hull_[k + 1])
                                          : static_cast<std::size_t>(hull_[0]) + n;
    const cv::Point2f a = loop.points[begin], along = loop.points[end % n] - a;
    const auto length = static_cast<float>(cv::norm(along));
    if (length < 2.0f * kLeastDepth_px) continue;
    Notch deepest{0, 0.0f};
    for (std::size_t i = begin + 1; i < end; ++i) {
      const cv::Point2f d = loop.points[i % n] - a;
      const float depth = std::abs(along.x * d.y - along.y * d.x) / length;
      if (depth > deepest.depth) deepest = {i % n, depth};
    }
    const cv::Point2f p = loop.points[deepest.at];
    if (deepest.depth >= least && !view_->nearBorder(p.x, p.y)) found_.push_back(deepest);
  }
  std::sort(found_.begin(), found_.end(), [](const Notch& a, const Notch& b) { return a.depth > b.depth; });
  if (found_.size() > kMostNotches) found_.resize(kMostNotches);
}

double NotchSplitter::gainOf(const Loop& loop, double least_area, std::size_t from, std::size_t to) {
  part(loop, from, to, first_, second_);
  const double smaller = std::min(first_.area, second_.area);
  if (smaller < least_area || first_.area + second_.area > 1.02 * loop.area)
    return -1.0;  // the chord leaves the loop
  const double chord = cv::norm(loop.points[from] - loop.points[to]);
  if (chord > kLongestChord * std::sqrt(smaller)) return -1.0;
  return loop.hull_area - first_.hull_area - second_.hull_area;
}

bool NotchSplitter::findChord(const Loop& loop, double least_area, std::size_t& from, std::size_t& to) {
  const std::size_t n = loop.points.size();
  double best = kLeastGain * loop.notches();
  bool found = false;
  const auto consider = [&](std::size_t a, std::size_t b) {
    const std::size_t apart = (b + n - a) % n;
    if (apart < kNearby || n - apart < kNearby) return;
    const double gain = gainOf(loop, least_area, a, b);
    if (gain <= best) return;
    best = gain;
    from = a;
    to = b;
    found = true;
  };
  for (std::size_t i = 0; i < found_.size(); ++i)
    for (std::size_t j = i + 1; j < found_.size(); ++j) consider(found_[i].at, found_[j].at);
  if (found) return true;
  // A single notch: cuts straight across to the nearest point that does not belong to the notch.
  for (const Notch& notch : found_) {
    const std::size_t reach = std::max(kNearby, static_cast<std::size_t>(2.0f * notch.depth));
    double nearest = 1e9;
    std::size_t across = notch.at;
    for (std::size_t k = reach; k + reach < n; ++k) {
      const std::size_t i = (notch.at + k) % n;
      const double distance = cv::norm(loop.points[i] - loop.points[notch.at]);
      if (distance < nearest) nearest = distance, across = i;
    }
    if (across != notch.at) consider(notch.at, across);
  }
  return found;
}

void NotchSplitter::part(const Loop& loop, std::size_t from, std::size_t to, Loop& first, Loop& second) {
  first.points.clear();
  second.points.clear();
  const std::size_t n = loop.points.size();
  for (std::size_t i = from;; i = (i + 1) % n) {
    first.points.push_back(loop.points[i]);
    if (i == to) break;
  }
  for (std::size_t i = to;; i = (i + 1) % n) {
    second.points.push_back(loop.points[i]);
    if (i == from) break;
  }
  measure(first);
  measure(second);
}

/// Assigns each pixel of the region to the loop that contains it, or that contains the nearest pixel of its
/// run. Pixels along a chord go to the last loop that contains them. Pixels in no loop belong to parts that
/// are too small.
void NotchSplitter::write(const Blob& blob) {
  paint(blob.rect);
  parts_.assign(loops_.size(), Blob{});
  for (const Run& run : blob.runs) {
    std::uint8_t* row = canvas_.ptr(run.row - blob.rect.y) - blob.rect.x;
    for (int x = run.begin + 1; x < run.end; ++x)
      if (row[x] == 0) row[x] = row[x - 1];
    for (int x = run.end - 2; x >= run.begin; --x)
      if (row[x] == 0) row[x] = row[x + 1];
    for (int x = run.begin; x < run.end;) {
      int end = x;
      while (end < run.end && row[end] == row[x]) ++end;
      if (row[x] != 0) add(parts_[static_cast<std::size_t>(row[x] - 1)], {run.row, x, end}, blob.label);
      x = end;
    }
  }
  const auto empty = [](const Blob& part) { return part.runs.empty(); };
  parts_.erase(std::remove_if(parts_.begin(), parts_.end(), empty), parts_.end());
  if (parts_.size() < 2) parts_.clear();
  for (std::size_t k = 0; k < parts_.size(); ++k)
    for (const Run& run : parts_[k].runs)
      std::fill(mask_.ptr(run.row) + run.begin, mask_.ptr(run.row) + run.end,
                static_cast<std::uint8_t>(k + 1));
}

void NotchSplitter::paint(const cv::Rect& rect) {
  canvas_.create(rect.size());
  canvas_.setTo(0);
  for (std::size_t k = 0; k < loops_.size(); ++k) {
    corners_.clear();
    for (const auto& p : loops_[k].points)
      corners_.emplace_back(cvRound(p.x) - rect.x, cvRound(p.y) - rect.y);
    const cv::Point* corners = corners_.data();
    const int count = static_cast<int>(corners_.size());
    cv::fillPoly(canvas_, &corners, &count, 1, static_cast<double>(k + 1));
  }
}

void NotchSplitter::add(Blob& part, const Run& run, int label) {
  const cv::Rect here(run.begin, run.row, run.end - run.begin, 1);
  part.rect = part.runs.empty() ? here : part.rect | here;
  part.runs.push_back(run);
  part.area_px += here.width;
  part.label = label;
}

}  // namespace omnifleet::ground
