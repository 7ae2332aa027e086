#include "local_mapper/silhouette.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "outline/convex_hull.h"

namespace omnifleet::local_mapper {

namespace {

constexpr std::size_t kAhead = 8;       // points of an outline that are prefetched
constexpr std::size_t kNearHidden = 3;  // points of an outline to each side of a border

}  // namespace

SilhouetteOptions SilhouetteOptions::read(const options::Section& section) {
  SilhouetteOptions o;
  section.read("outline", o.outline, std::vector<std::string>{"contour", "features"});
  section.read("max_contact_m", o.max_contact_m, {0.05, 100.0});
  section.read("far_contact_m", o.far_contact_m, {0.0, 100.0});
  section.read("far_solidity", o.far_solidity, {0.0, 1.0});
  section.read("far_area_px", o.far_area_px, {1, 1000000});
  section.read("sigma_px", o.sigma_px, {0.01, 20.0});
  section.read("sigma_floor_m", o.sigma_floor_m, {0.0, 1.0});
  section.read("support_bias_px", o.support_bias_px, {-5.0, 5.0});
  section.read("min_area_px", o.min_area_px, {1, 1000000});
  section.finish();
  return o;
}

Silhouette::Silhouette(const lens::Camera& camera, const ground::FloorView& view,
                       const SilhouetteOptions& options)
    : camera_(&camera), view_(&view), floor_table_(camera), options_(options) {
  for (int k = 0; k < SupportFunction::kDirections; ++k) {
    const double phi = 2.0 * M_PI * k / SupportFunction::kDirections;
    directions_.emplace_back(std::cos(phi), std::sin(phi));
  }
}

bool Silhouette::measure(const ground::Blob& blob, const ground::Contour& contour,
                         const std::vector<bool>& hides, ObjectObservation& object) {
  projectToFloor(contour, hides);
  is_around_ = closesAroundFoot();
  if (floor_.points_m.empty() || is_around_) return false;
  findContact(object);
  const double contact_m = (object.contact_m - camera_->foot()).norm();
  if (contact_m > std::max(options_.max_contact_m, options_.far_contact_m)) return false;
  object.rect_x_px = blob.rect.x;
  object.rect_y_px = blob.rect.y;
  object.rect_width_px = blob.rect.width;
  object.rect_height_px = blob.rect.height;
  measureHull(object);
  if (object.hull_m.size() < 3) return false;
  // Far away, a few pixels of the floor's pattern are as large as an object, but ragged.
  if (contact_m > options_.max_contact_m &&
      (object.truncated || object.solidity < options_.far_solidity || blob.area_px < options_.far_area_px))
    return false;
  measureCentroid(blob, object);
  measureSupports(object);
  return true;
}

double Silhouette::contactDistance(const ground::Contour& contour) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < contour.points_px.size(); ++i) {
    if (contour.beside[i] != 0) continue;
    const Eigen::Vector2f point = floor_table_.at(contour.points_px[i].x(), contour.points_px[i].y());
    if (point.allFinite()) nearest = std::min(nearest, (point.cast<double>() - camera_->foot()).norm());
  }
  return nearest;
}

void Silhouette::projectToFloor(const ground::Contour& contour, const std::vector<bool>& hides) {
  bool is_cut = false;
  const auto isHidden = [&](std::size_t begin, std::size_t end, std::size_t i) {
    // Points next to the border between two objects belong to neither.
    for (std::size_t k = 0; k <= 2 * kNearHidden && !hides.empty(); ++k) {
      const std::size_t at = begin + (i - begin + end - begin + k - kNearHidden) % (end - begin);
      if (hides[contour.beside[at]]) return true;
    }
    return false;
  };
  is_hidden_ = false;
  floor_.points_m.clear();
  floor_.pixels.clear();
  floor_.cut.clear();
  floor_.loop_begin.clear();
  std::size_t loop = 0, loop_end = 0;
  for (std::size_t i = 0; i < contour.points_px.size(); ++i) {
    if (loop < contour.loop_begin.size() && contour.loop_begin[loop] == i) {
      floor_.loop_begin.push_back(floor_.points_m.size());
      ++loop;
      loop_end = loop < contour.loop_begin.size() ? contour.loop_begin[loop] : contour.points_px.size();
    }
    const Eigen::Vector2f& pixel = contour.points_px[i];
    const Eigen::Vector2f& ahead = contour.points_px[std::min(i + kAhead, contour.points_px.size() - 1)];
    floor_table_.prefetch(ahead.x(), ahead.y());
    const Eigen::Vector2f point = floor_table_.at(pixel.x(), pixel.y());
    if (!point.allFinite()) {
      ++rejected_;
      continue;
    }
    floor_.points_m.push_back(point.cast<double>());
    floor_.pixels.push_back(pixel);
    const bool hidden = !hides.empty() && isHidden(contour.loop_begin[loop - 1], loop_end, i);
    is_hidden_ = is_hidden_ || hidden;
    const bool cut = view_->nearBorder(pixel.x(), pixel.y());
    is_cut = is_cut || cut;
    floor_.cut.push_back(hidden || cut ? 1 : 0);
  }
  // An object that is wholly visible ends where it appears to, however near to the edge of the view.
  for (std::size_t i = 0; i < floor_.cut.size() && is_cut; ++i)
    if (view_->nearCut(floor_.pixels[i].x(), floor_.pixels[i].y())) floor_.cut[i] = 1;
}

/// Counts the crossings of the contour with a ray from the camera foot.
bool Silhouette::closesAroundFoot() const {
  const Eigen::Vector2d foot = camera_->foot();
  bool inside = false;
  for (std::size_t k = 0; k < floor_.loop_begin.size(); ++k) {
    const auto [begin, end] = floor_.loop(k);
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d a = floor_.points_m[i] - foot,
                            b = floor_.points_m[i + 1 < end ? i + 1 : begin] - foot;
      if ((a.y() > 0.0) == (b.y() > 0.0)) continue;
      if (a.x() + (b.x() - a.x()) * a.y() / (a.y() - b.y()) > 0.0) inside = !inside;
    }
  }
  return inside;
}

bool Silhouette::isLine() const {
  constexpr double kWidest_m = 0.08, kShortest_m = 0.25, kLeastRatio = 5.0, kHighest_m = 0.08;
  const Eigen::Vector2d foot = camera_->foot();
  double twice_area = 0.0, perimeter_m = 0.0, across_m2 = 0.0;
  for (std::size_t k = 0; k < floor_.loop_begin.size(); ++k) {
    const auto [begin, end] = floor_.loop(k);
    double twice = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d a = floor_.points_m[i] - foot,
                            b = floor_.points_m[i + 1 < end ? i + 1 : begin] - foot;
      const double cross = a.x() * b.y() - a.y() * b.x();
      twice += cross;
      across_m2 += 0.5 * std::abs(cross);
      perimeter_m += (b - a).norm();
    }
    twice_area += std::abs(twice);
  }
  const double length_m = 0.5 * perimeter_m, width_m = twice_area / perimeter_m;
  if (length_m < kShortest_m || width_m > kWidest_m || length_m < kLeastRatio * width_m) return false;
  const double stretched = 0.5 * twice_area / across_m2;
  return camera_->height() * stretched / (1.0 + stretched) < kHighest_m || hasParallelSides();
}

/// Is a straight thin region that leads away from the camera as wide far away as near?
bool Silhouette::hasParallelSides() const {
  constexpr double kFarther = 1.25, kShare = 0.35;  // minimum ratio of the distances; how much wider the far
                                                    // part may be, per how much farther
  constexpr double kEnds = 0.1, kPart = 0.3;  // shares of the length: left out at each end; used at each end
  Eigen::Vector2d middle(0.0, 0.0);
  for (const Eigen::Vector2d& p : floor_.points_m) middle += p;
  middle /= static_cast<double>(floor_.points_m.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& p : floor_.points_m) spread += (p - middle) * (p - middle).transpose();
  Eigen::Vector2d along = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvectors().col(1);
  if (along.dot(middle - camera_->foot()) < 0.0) along = -along;
  const Eigen::Vector2d across(-along.y(), along.x());
  double begin = std::numeric_limits<double>::infinity(), end = -begin;
  for (const Eigen::Vector2d& p : floor_.points_m) {
    begin = std::min(begin, along.dot(p - middle));
    end = std::max(end, along.dot(p - middle));
  }
  struct Part {
    double at, low = std::numeric_limits<double>::infinity(), high = -low;
    double width_m() const { return high - low; }
  };
  const double length_m = end - begin;
  Part near{begin + (kEnds + 0.5 * kPart) * length_m}, far{end - (kEnds + 0.5 * kPart) * length_m};
  for (const Eigen::Vector2d& p : floor_.points_m) {
    for (Part* part : {&near, &far}) {
      if (std::abs(along.dot(p - middle) - part->at) > 0.5 * kPart * length_m) continue;
      part->low = std::min(part->low, across.dot(p - middle));
      part->high = std::max(part->high, across.dot(p - middle));
    }
  }
  const auto away_m = [&](const Part& part) { return (middle + part.at * along - camera_->foot()).norm(); };
  const double farther = away_m(far) / away_m(near), wider = far.width_m() / near.width_m();
  return farther > kFarther && wider > 0.0 && wider < 1.0 + kShare * (farther - 1.0);
}

void Silhouette::findContact(ObjectObservation& object) const {
  const Eigen::Vector2d foot = camera_->foot();
  double nearest = std::numeric_limits<double>::infinity();
  object.truncated = false;
  for (std::size_t i = 0; i < floor_.points_m.size(); ++i) {
    object.truncated = object.truncated || floor_.cut[i] != 0;
    const double distance = (floor_.points_m[i] - foot).squaredNorm();
    if (distance >= nearest) continue;
    nearest = distance;
    object.contact_m = floor_.points_m[i];
  }
}

/// Leaves out points inside of a triangle of two other points and the middle of all points, because they are
/// no corners of the hull. The result is exact, because points in doubt are kept.
void Silhouette::findOutermost() {
  constexpr double kDoubt_m2 = 1e-12;  // far above the rounding of an area
  Eigen::Vector2d middle(0.0, 0.0);
  for (const Eigen::Vector2d& p : floor_.points_m) middle += p;
  middle /= static_cast<double>(floor_.points_m.size());
  const auto area = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
  };
  const auto isWithin = [&](std::size_t i, std::size_t before, std::size_t after) {
    const auto &p = floor_.points_m[i], &a = floor_.points_m[before], &b = floor_.points_m[after];
    const double sign = area(a, b, middle) > 0.0 ? 1.0 : -1.0;
    return sign * area(a, b, p) > kDoubt_m2 && sign * area(b, middle, p) > kDoubt_m2 &&
           sign * area(middle, a, p) > kDoubt_m2;
  };
  outermost_.clear();
  for (std::size_t i = 0; i < floor_.points_m.size(); ++i) {
    while (outermost_.size() >= 2 && isWithin(outermost_.back(), outermost_[outermost_.size() - 2], i))
      outermost_.pop_back();
    outermost_.push_back(i);
  }
  outermost_m_.clear();
  for (const std::size_t i : outermost_) outermost_m_.push_back(floor_.points_m[i]);
}

void Silhouette::measureHull(ObjectObservation& object) {
  findOutermost();
  const Polygon hull = outline::convexHull(outermost_m_);
  object.hull_m.assign(hull.begin(), hull.end());
  double area = 0.0;
  for (std::size_t k = 0; k < floor_.loop_begin.size(); ++k) {
    const auto [begin, end] = floor_.loop(k);
    double twice = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      const auto& a = floor_.points_m[i];
      const auto& b = floor_.points_m[i + 1 < end ? i + 1 : begin];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    area += 0.5 * std::abs(twice);
  }
  const double hull_area = signedArea(object.hull_m);
  // An object in front cuts into the outline; the region is still one object.
  object.solidity = hull_area > 0.0 && !is_hidden_ ? std::min(1.0, area / hull_area) : 1.0;
}

void Silhouette::measureCentroid(const ground::Blob& blob, ObjectObservation& object) const {
  Eigen::Vector2d sum(0.0, 0.0);
  for (const auto& run : blob.runs) {
    const double pixels = run.end - run.begin;
    sum += pixels * Eigen::Vector2d(0.5 * (run.begin + run.end - 1), run.row);
  }
  const auto floor = camera_->floorFromPixel(sum / blob.area_px);
  object.centroid_m = floor ? *floor : centroid(object.hull_m);
}

Eigen::Matrix2d Silhouette::jacobian(const Eigen::Vector2f& pixel) const {
  // Two pixels to each side, because the table has errors of hundredths of a pixel. Beyond the table the lens
  // itself is used.
  constexpr float kTableStep_px = 2.0f;
  constexpr double kStep_px = 0.5;
  Eigen::Matrix2d j = Eigen::Matrix2d::Zero();
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2f far = kTableStep_px * Eigen::Vector2f::Unit(axis);
    const Eigen::Vector2f low = floor_table_.at(pixel.x() - far.x(), pixel.y() - far.y()),
                          high = floor_table_.at(pixel.x() + far.x(), pixel.y() + far.y());
    if (low.allFinite() && high.allFinite()) {
      j.col(axis) = (high - low).cast<double>() / (2.0 * kTableStep_px);
      continue;
    }
    const Eigen::Vector2d step = kStep_px * Eigen::Vector2d::Unit(axis);
    const auto before = camera_->floorFromPixel(pixel.cast<double>() - step);
    const auto after = camera_->floorFromPixel(pixel.cast<double>() + step);
    if (before && after) j.col(axis) = (*after - *before) / (2.0 * kStep_px);
  }
  return j;
}

void Silhouette::measureSupports(ObjectObservation& object) {
  corners_.clear();
  for (const auto& vertex : object.hull_m) {
    const auto found = std::find(outermost_m_.begin(), outermost_m_.end(), vertex);
    const std::size_t i = outermost_[static_cast<std::size_t>(found - outermost_m_.begin())];
    corners_.push_back({vertex - camera_->foot(), jacobian(floor_.pixels[i]), floor_.cut[i] != 0});
  }
  supportsFromCorners(object);
}

void Silhouette::measureFeatures(ObjectObservation& object) {
  Polygon ends;
  for (const FlowVector& vector : object.vectors) ends.push_back(vector.to_m.cast<double>());
  Polygon hull = outline::convexHull(ends);
  if (hull.size() < 3) {
    std::fill(object.supports.sigma_m.begin(), object.supports.sigma_m.end(), -1.0f);
    return;
  }
  object.hull_m = std::move(hull);
  object.solidity = 1.0;
  corners_.clear();
  for (const auto& vertex : object.hull_m) {
    const auto found = std::find(ends.begin(), ends.end(), vertex);
    const FlowVector& vector = object.vectors[static_cast<std::size_t>(found - ends.begin())];
    corners_.push_back({vertex - camera_->foot(), jacobian(vector.to_px), false});
  }
  supportsFromCorners(object);
}

void Silhouette::supportsFromCorners(ObjectObservation& object) {
  auto& supports = object.supports;
  supports.b_m.resize(directions_.size());
  supports.sigma_m.resize(directions_.size());
  // The corners have the same order as the directions: the farthest corner in a direction is at or behind
  // that of the previous direction.
  std::size_t at = 0;
  double reach = directions_.front().dot(corners_.front().from_foot_m);
  for (std::size_t i = 1; i < corners_.size(); ++i) {
    const double here = directions_.front().dot(corners_[i].from_foot_m);
    if (here <= reach) continue;
    reach = here;
    at = i;
  }
  for (std::size_t k = 0; k < directions_.size(); ++k) {
    const auto& n = directions_[k];
    reach = n.dot(corners_[at].from_foot_m);
    for (std::size_t step = 1; step < corners_.size(); ++step) {
      const std::size_t next = at + 1 < corners_.size() ? at + 1 : 0;
      const double here = n.dot(corners_[next].from_foot_m);
      if (here <= reach) break;
      reach = here;
      at = next;
    }
    const Corner* farthest = &corners_[at];
    const double metres_per_px = (farthest->metres_per_px.transpose() * n).norm();
    supports.b_m[k] = static_cast<float>(reach - options_.support_bias_px * metres_per_px);
    const double sigma = std::hypot(options_.sigma_px * metres_per_px, options_.sigma_floor_m);
    supports.sigma_m[k] = farthest->cut || metres_per_px <= 0.0 ? -1.0f : static_cast<float>(sigma);
  }
}

}  // namespace omnifleet::local_mapper
