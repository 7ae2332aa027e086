#include "flow/feature_flow.h"

#include <algorithm>
#include <cmath>

#include "ground/floor_view.h"

namespace omnifleet::flow {

namespace {

// Margin around a region. The outline is searched for in it, and the region may have moved this much more
// than expected.
constexpr int kSlack_px = 16;
static_assert(CellColours::kSide == ground::FloorView::kCell);

}  // namespace

FeatureFlowOptions FeatureFlowOptions::read(const options::Section& section) {
  FeatureFlowOptions o;
  o.harris = HarrisOptions::read(section.child("harris"));
  o.lucas_kanade = LucasKanadeOptions::read(section.child("lucas_kanade"));
  o.filter = VectorFilterOptions::read(section.child("filter"));
  o.points = PointOptions::read(section.child("points"));
  section.read("sigma_px", o.sigma_px, {0.01, 5.0});
  section.finish();
  return o;
}

FeatureFlow::FeatureFlow(const lens::Camera& camera, const FeatureFlowOptions& options)
    : camera_(&camera),
      options_(options),
      harris_(options.harris),
      lucas_kanade_(options.lucas_kanade),
      points_(camera, options.points, options.sigma_px),
      previous_(options.lucas_kanade.levels),
      current_(options.lucas_kanade.levels) {}

/// Pixels around a point that tracking with `levels` pyramid levels needs.
int FeatureFlow::reach(int levels) const {
  return lucas_kanade_.reach_px(levels) + Pyramid::lossOf(levels);
}

void FeatureFlow::push(const cv::Mat& image, const CellColours& cells,
                       const std::vector<ground::Blob>& regions) {
  std::swap(previous_, current_);
  std::swap(previous_seen_, current_seen_);
  has_previous_ = has_current_;
  has_current_ = true;
  const cv::Rect frame(0, 0, image.cols, image.rows);
  const int coarsest_px = reach(current_.size()),
            reach_px = reach(std::min(current_.size(), Pyramid::kCellLevel));
  const auto around = [&](const cv::Rect& r, int by) {
    return cv::Rect(r.x - by, r.y - by, r.width + 2 * by, r.height + 2 * by) & frame;
  };
  built_.clear();
  built_coarsely_.clear();
  current_seen_.clear();
  int area = 0;
  for (const ground::Blob& region : regions) {
    current_seen_.push_back(around(region.rect, kSlack_px));
    built_.push_back(around(region.rect, kSlack_px + reach_px));
    built_coarsely_.push_back(around(region.rect, kSlack_px + coarsest_px));
    area += built_.back().area();
  }
  if (area >= frame.area()) {
    current_seen_.assign(1, frame);
    built_.assign(1, frame);
    built_coarsely_.assign(1, frame);
  }
  current_.build(image, built_, cells, built_coarsely_);
}

bool FeatureFlow::wasSeen(const Eigen::Vector2f& pixel) const {
  const cv::Point2f at(pixel.x(), pixel.y());
  return std::any_of(previous_seen_.begin(), previous_seen_.end(),
                     [&](const cv::Rect& rect) { return cv::Rect2f(rect).contains(at); });
}

double FeatureFlow::floorSigma(const Eigen::Vector2f& pixel, const Eigen::Vector2d& floor) const {
  const Eigen::Vector2d outward = pixel.cast<double>() - camera_->model().principal_point_px;
  const double r = outward.norm();
  if (r < 1e-6) return options_.sigma_px * camera_->height();
  const auto beyond = camera_->floorFromPixel(pixel.cast<double>() + outward / r);
  const double metres = beyond ? (*beyond - floor).norm() : floor.norm();
  return std::sqrt(2.0) * options_.sigma_px * metres;  // noise of both ends of the vector
}

bool FeatureFlow::followCorner(const Corner& corner, const Pose2& previous_from_current, FlowVector& vector) {
  const auto to_m = camera_->floorFromPixel(corner.pixel.cast<double>());
  if (!to_m) {
    ++rejected_;
    return false;
  }
  const Eigen::Vector2d expected = previous_from_current * *to_m;
  const auto guess = camera_->pixelFromPoint({expected.x(), expected.y(), 0.0});
  Eigen::Vector2f from = guess ? Eigen::Vector2f(guess->cast<float>()) : corner.pixel;
  if (!wasSeen(from)) return false;
  if (!lucas_kanade_.followBothWays(current_, previous_, corner.pixel, from)) return false;
  const auto from_m = camera_->floorFromPixel(from.cast<double>());
  if (!from_m) {
    ++rejected_;
    return false;
  }
  vector.from_px = from;
  vector.to_px = corner.pixel;
  vector.from_m = from_m->cast<float>();
  vector.to_m = to_m->cast<float>();
  vector.residual_m = (*to_m - previous_from_current.inverse() * *from_m).cast<float>();
  return true;
}

void FeatureFlow::finish(const Motion& motion, ObjectObservation& object) {
  const Pose2 current_from_previous = motion.valid ? motion.previous_from_current.inverse() : Pose2{};
  const Eigen::Vector2d c = camera_->foot();
  displacements_.clear();
  for (const auto& v : found_) {
    const Eigen::Vector2d turned = current_from_previous.rotation() * (v.from_m.cast<double>() - c);
    displacements_.push_back(
        {v.to_m.cast<double>() - c - turned, floorSigma(v.to_px, v.to_m.cast<double>())});
  }
  kept_.clear();
  for (const std::size_t i : filterVectors(displacements_, options_.filter)) {
    points_.follow(found_[i].from_px, found_[i].to_px);
    object.vectors.push_back(found_[i]);
    kept_.push_back(displacements_[i]);
  }
  if (!motion.valid) return;
  const Height height = heightFromVectors(kept_, current_from_previous * c - c, camera_->height());
  object.height_m = height.height_m;
  object.height_sigma_m = height.sigma_m;
}

void FeatureFlow::track(const std::vector<ground::Blob>& blobs, const std::vector<std::size_t>& which,
                        const Motion& motion, std::vector<ObjectObservation>& objects) {
  for (auto& object : objects) {
    object.vectors.clear();
    object.vectors.reserve(static_cast<std::size_t>(options_.harris.max_per_label));
    object.height_m = object.height_sigma_m = 0.0;
  }
  if (!has_previous_) return;
  const auto& corners =
      harris_.detect(current_.grey(), current_.size() > 1 ? current_.level(1) : cv::Mat1b(), blobs, which);
  points_.advance(motion);
  const Pose2 own = motion.valid ? motion.previous_from_current : Pose2{};
  std::size_t next = 0;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    found_.clear();
    for (; next < corners.size() && corners[next].blob == i; ++next) {
      FlowVector vector;
      if (followCorner(corners[next], own, vector)) found_.push_back(vector);
    }
    finish(motion, objects[i]);
  }
  auto point = points_.points().begin();
  for (auto& object : objects)
    for (FlowVector& vector : object.vectors) vector.point = *point++;
}

}  // namespace omnifleet::flow
