#include "local_mapper/floor_scan.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/pose2.h"
#include "ground/wall_finder.h"

namespace omnifleet::local_mapper {

namespace {

constexpr double kMarch_m = 0.01;  // step along a ray for measuring the visible floor, once per camera

constexpr double kWalls_m = 4.0;  // walls are searched for up to this range
// A part of a wall may begin this many blocks in front of the known foot of the wall, because edges are
// joined over gaps.
constexpr double kBeforeWall = 1.0, kBeforeFoot = 2.5;
constexpr double kRangeFactor = 1.1;  // multiple of the range of a cell, which may begin in front of the foot
constexpr std::size_t kEdge =
    200;  // steps in front of the growing of a wall within which its foot is searched for

std::uint8_t kindAt(const FloorScan::Room& room, int u, int v) {
  const int x = u / ground::FloorView::kCell, y = v / ground::FloorView::kCell;
  return y < room.kinds.rows && x < room.kinds.cols ? room.kinds(y, x) : std::uint8_t{0};
}

bool isInTheWay(std::uint8_t object) {
  return object != 0 && object != ground::WallFinder::kShadow;
}

cv::Vec3f pixelAt(const cv::Mat& image, int u, int v) {
  if (image.channels() == 3) return image.at<cv::Vec3b>(v, u);
  return cv::Vec3f::all(image.at<std::uint8_t>(v, u));
}

/// Radial extent of one pixel on the floor, metres, at a floor point.
double radialMetres(const lens::Camera& camera, const Eigen::Vector2d& floor) {
  const auto pixel = camera.pixelFromPoint({floor.x(), floor.y(), 0.0});
  if (!pixel) return 0.0;
  const auto beyond =
      camera.pixelFromPoint({floor.x() + (floor - camera.foot()).normalized().x() * kMarch_m,
                             floor.y() + (floor - camera.foot()).normalized().y() * kMarch_m, 0.0});
  return beyond ? kMarch_m / std::max(1e-6, (*beyond - *pixel).norm()) : 0.0;
}

}  // namespace

ScanOptions ScanOptions::read(const options::Section& section) {
  ScanOptions o;
  section.read("rays", o.rays, {8, 3600});
  section.read("max_range_m", o.max_range_m, {0.1, 100.0});
  section.read("sigma_px", o.sigma_px, {0.01, 20.0});
  section.finish();
  return o;
}

FloorScan::FloorScan(const lens::Camera& camera, const ground::FloorView& view, const ScanOptions& options)
    : camera_(&camera), options_(options) {
  const auto n = static_cast<std::size_t>(options.rays);
  nearest_m_.resize(n);
  undecided_m_.resize(n);
  object_.resize(n);
  meets_wall_.resize(n);
  ends_at_wall_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double phi = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(n);
    bearing_.emplace_back(std::cos(phi), std::sin(phi));
    double begin = -1.0, end = 0.0;
    step_begin_.push_back(steps_.size());
    for (double r = kMarch_m; r <= std::max(options.max_range_m, kWalls_m) + 1e-9; r += kMarch_m) {
      const Eigen::Vector2d p = camera.foot() + r * bearing_[i];
      const auto pixel = camera.pixelFromPoint({p.x(), p.y(), 0.0});
      const cv::Point at = pixel ? cv::Point(cvRound(pixel->x()), cvRound(pixel->y())) : cv::Point(-1, -1);
      const bool seen = cv::Rect({0, 0}, view.imageSize()).contains(at) && view.mask()(at) != 0;
      if (seen && begin < 0) begin = r;
      if (!seen && begin >= 0) break;
      // Of an object that the edge of the view cuts, nothing may be left there, so no floor is certain.
      const bool sure = seen && !view.nearCut(static_cast<float>(at.x), static_cast<float>(at.y));
      if (sure && r <= options.max_range_m + 1e-9) end = r;
      if (seen) steps_.push_back({static_cast<std::int16_t>(at.x), static_cast<std::int16_t>(at.y)});
    }
    if (end < begin) {
      begin = -1.0;
      steps_.resize(step_begin_.back());
    }
    floor_begin_m_.push_back(static_cast<float>(begin));
    blind_m_ = std::max(blind_m_, begin);
    floor_end_m_.push_back(static_cast<float>(end));
    floor_end_sigma_m_.push_back(
        static_cast<float>(options.sigma_px * radialMetres(camera, camera.foot() + end * bearing_[i])));
  }
  if (steps_.empty())
    throw options::Error(
        "no floor visible: hardly a pixel is left between the robot's own body (self_mask_radius_px) and "
        "the end of the view (fov_deg); check these keys and focal_px, position_m, rotation_rpy_deg in "
        "its sensor.yaml");
  step_begin_.push_back(steps_.size());
  ray_samples_.reserve(steps_.size() / bearing_.size() + 1);
  findSectors();
}

/// Finds a ray per sector that is certainly not beyond the sector's beginning. It subtracts one ray, so
/// rounding does not matter.
void FloorScan::findSectors() {
  first_.resize(kSectors);
  for (std::size_t k = 0; k < kSectors; ++k) {
    const double along = 4.0 * static_cast<double>(k) / kSectors, quarter = std::floor(along);
    const double angle = 0.5 * M_PI * quarter + std::atan2(along - quarter, 1.0 - along + quarter);
    const double ray = std::floor(angle / (2.0 * M_PI) * static_cast<double>(bearing_.size()));
    first_[k] = static_cast<std::size_t>(std::max(0.0, ray - 1.0));
  }
}

void FloorScan::begin() {
  std::fill(nearest_m_.begin(), nearest_m_.end(), std::numeric_limits<double>::infinity());
  std::fill(undecided_m_.begin(), undecided_m_.end(), std::numeric_limits<double>::infinity());
  std::fill(object_.begin(), object_.end(), std::uint16_t{0});
  std::fill(ends_at_wall_.begin(), ends_at_wall_.end(), std::uint8_t{0});
}

void FloorScan::add(const FloorContour& contour, std::uint16_t label) {
  for (std::size_t k = 0; k < contour.loop_begin.size(); ++k) {
    const auto [begin, end] = contour.loop(k);
    if (begin == end) continue;
    Eigen::Vector2d a = contour.points_m[end - 1] - camera_->foot();
    std::size_t before = rayBefore(a);
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d b = contour.points_m[i] - camera_->foot();
      const std::size_t next = rayBefore(b);
      if (next != before) addSegment(a, before, b, next, label);
      a = b;
      before = next;
    }
  }
}

/// The sectors divide the square |x| + |y| = 1 evenly.
std::size_t FloorScan::sectorOf(const Eigen::Vector2d& to) {
  const double x = to.x(), y = to.y(), sum = std::abs(x) + std::abs(y);
  if (!(sum > 0.0)) return 0;
  const double along = y >= 0 ? (x > 0 ? y / sum : 1.0 - x / sum) : (x < 0 ? 2.0 - y / sum : 3.0 + x / sum);
  return std::min(kSectors - 1, static_cast<std::size_t>(along * (kSectors / 4.0)));
}

/// Index of the last ray at or before a direction.
std::size_t FloorScan::rayBefore(const Eigen::Vector2d& to) const {
  const auto isBefore = [&](std::size_t ray) {
    const Eigen::Vector2d& d = bearing_[ray];
    return d.x() * to.y() - d.y() * to.x() < 0.0;
  };
  const std::size_t n = bearing_.size();
  std::size_t ray = first_[sectorOf(to)];
  while (ray + 1 < n && !isBefore(ray + 1)) ++ray;
  return ray;
}

void FloorScan::addAll(const cv::Mat1b& objects) {
  for (std::size_t ray = 0; ray < bearing_.size(); ++ray) {
    for (std::size_t k = step_begin_[ray]; k < step_begin_[ray + 1]; ++k) {
      if (!isInTheWay(objects(steps_[k].v, steps_[k].u))) continue;
      const double range =
          static_cast<double>(floor_begin_m_[ray]) + kMarch_m * static_cast<double>(k - step_begin_[ray]);
      if (range < nearest_m_[ray] - kMarch_m) {  // otherwise the contour is more accurate
        nearest_m_[ray] = range;
        object_[ray] = 0;
      }
      break;
    }
  }
}

double FloorScan::rangeAt(std::size_t ray, std::size_t step) const {
  return static_cast<double>(floor_begin_m_[ray]) + kMarch_m * static_cast<double>(step - step_begin_[ray]);
}

void FloorScan::findWalls(const Room& room) {
  block_px_ = room.block_px;
  wall_m_.assign(bearing_.size(), std::numeric_limits<double>::infinity());
  for (std::size_t ray = 0; ray < bearing_.size(); ++ray) {
    const std::size_t begin = step_begin_[ray], end = step_begin_[ray + 1];
    const auto valueAt = [&](std::size_t k) { return room.objects(steps_[k].v, steps_[k].u); };
    const auto isGrown = [&](std::size_t k) {
      return kindAt(room, steps_[k].u, steps_[k].v) == ground::WallFinder::kWallGrown;
    };
    std::size_t k = begin;
    while (k < end && !isInTheWay(valueAt(k)) && !isGrown(k)) ++k;
    const bool is_grown = k < end && !isInTheWay(valueAt(k));
    meets_wall_[ray] = k < end && (is_grown || valueAt(k) == ground::WallFinder::kWall) ? 1 : 0;
    if (begin == end) continue;
    const double foot_m = footByLines(ray, room);
    if (std::isfinite(foot_m) && (k == end || foot_m <= kRangeFactor * rangeAt(ray, k))) {
      meets_wall_[ray] = 1;
      wall_m_[ray] = foot_m;
      continue;
    }
    if (is_grown) k = footOfWall(ray, k, room);
    if (k == end || meets_wall_[ray] != 0) wall_m_[ray] = rangeAt(ray, k);
  }
}

/// Range at which WallFoot found a line; infinite where it found none.
double FloorScan::footByLines(std::size_t ray, const Room& room) const {
  if (!room.foot.any()) return std::numeric_limits<double>::infinity();
  constexpr std::size_t kBearings = ground::WallFoot::kBearings;
  const std::size_t rays = bearing_.size(), nearest = (ray * kBearings + rays / 2) / rays % kBearings;
  return static_cast<double>(room.foot.range_m()[nearest]);
}

/// Finds the foot between the last cell that is certainly floor and the cell of `step`, which is certainly
/// wall, or slightly behind it. It is where the colours divide best in two (least squares), because shadows
/// at the foot fade and the wall's texture averages out. The growing of the floor stops some blocks before
/// the edge; that of the wall may have crossed it.
std::size_t FloorScan::footOfWall(std::size_t ray, std::size_t step, const Room& room) {
  constexpr std::size_t kStops = 3;  // blocks before an edge where growing stops
  std::size_t first = step;
  while (first > step_begin_[ray] && step - first < kEdge &&
         kindAt(room, steps_[first].u, steps_[first].v) != ground::WallFinder::kFloorGrown)
    --first;
  ray_samples_.clear();
  cv::Vec3f sum(0, 0, 0);
  const std::size_t reach = kStops * static_cast<std::size_t>(room.block_px);
  for (std::size_t k = first; k < step_begin_[ray + 1] && (k <= step || ray_samples_.size() < reach); ++k) {
    if (k > first && steps_[k].u == steps_[k - 1].u && steps_[k].v == steps_[k - 1].v) continue;
    ray_samples_.push_back({k, sum});
    sum += pixelAt(room.image, steps_[k].u, steps_[k].v);
  }
  const auto n = static_cast<float>(ray_samples_.size());
  float best = 0.0f;
  std::size_t foot = step;
  for (std::size_t i = 1; i < ray_samples_.size(); ++i) {
    const auto before = static_cast<float>(i), after = n - before;
    const cv::Vec3f apart = ray_samples_[i].sum_before / before - (sum - ray_samples_[i].sum_before) / after;
    const float between = before * after * apart.dot(apart);
    if (between <= best) continue;
    best = between;
    foot = ray_samples_[i].step;
  }
  return foot;
}

void FloorScan::addWalls() {
  for (std::size_t ray = 0; ray < bearing_.size(); ++ray) {
    if (meets_wall_[ray] == 0 || wall_m_[ray] > nearest_m_[ray]) continue;
    nearest_m_[ray] = wall_m_[ray];
    object_[ray] = 0;
    ends_at_wall_[ray] = 1;
  }
}

std::optional<Eigen::Vector2d> FloorScan::wallBeside(long ray, long step) const {
  const auto n = static_cast<long>(bearing_.size());
  for (long k = 1; k <= n / 8; ++k) {
    const auto at = static_cast<std::size_t>((((ray + k * step) % n) + n) % n);
    if (std::isfinite(wall_m_[at])) return wall_m_[at] * bearing_[at];
  }
  return std::nullopt;
}

bool FloorScan::isInFrontOfWalls(const FloorContour& contour, const Eigen::Vector2d& contact_m) const {
  constexpr double kBefore_m = 0.04, kBefore_px = 2.5;
  const Eigen::Vector2d at = contact_m - camera_->foot();
  const double step = 2.0 * M_PI / static_cast<double>(bearing_.size()), bearing = std::atan2(at.y(), at.x());
  double right = 0.0, left = 0.0;  // extent beside the contact's bearing
  for (const Eigen::Vector2d& p : contour.points_m) {
    const Eigen::Vector2d to = p - camera_->foot();
    const double beside = wrapAngle(std::atan2(to.y(), to.x()) - bearing);
    right = std::min(right, beside);
    left = std::max(left, beside);
  }
  const auto a = wallBeside(std::lround(std::floor((bearing + right) / step)), -1),
             b = wallBeside(std::lround(std::ceil((bearing + left) / step)), 1);
  if (!a && !b) return false;
  const double before = std::max(kBefore_m, kBefore_px * radialMetres(*camera_, contact_m));
  if (!a || !b) return at.norm() + before < (a ? *a : *b).norm();
  const Eigen::Vector2d along = (*b - *a).normalized(), away(along.y(), -along.x());
  return away.dot(*a - at) >= before;
}

/// Visits (ray, floor point relative to the camera foot) for each pixel.
template <typename Visit>
void FloorScan::forFloor(const ground::Blob& blob, Visit visit) const {
  const double step = 2.0 * M_PI / static_cast<double>(bearing_.size());
  const auto n = static_cast<long>(bearing_.size());
  for (const ground::Run& run : blob.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      const auto floor = camera_->floorFromPixel({x, run.row});
      if (!floor) continue;
      const Eigen::Vector2d at = *floor - camera_->foot();
      const long ray = std::lround(std::atan2(at.y(), at.x()) / step);
      visit(static_cast<std::size_t>(((ray % n) + n) % n), at);
    }
  }
}

bool FloorScan::isOfWalls(const ground::Blob& blob, double blocks) const {
  int at_walls = 0, all = 0;
  forFloor(blob, [&](std::size_t ray, const Eigen::Vector2d& at) {
    ++all;
    if (ends_at_wall_[ray] == 0) return;
    const double wall_m = nearest_m_[ray],
                 metres_per_px = radialMetres(*camera_, camera_->foot() + wall_m * bearing_[ray]);
    at_walls += at.norm() > wall_m - blocks * block_px_ * metres_per_px ? 1 : 0;
  });
  return 2 * at_walls > all;
}

std::optional<Eigen::Vector2d> FloorScan::addUndecided(const ground::Blob& blob, Candidate candidate) {
  if (candidate == Candidate::kBoard && isOfWalls(blob, kBeforeWall)) return std::nullopt;
  if (candidate == Candidate::kIntensityEdge && isOfWalls(blob, kBeforeFoot)) return std::nullopt;
  double nearest_m = std::numeric_limits<double>::infinity();
  std::optional<Eigen::Vector2d> contact_m;
  forFloor(blob, [&](std::size_t ray, const Eigen::Vector2d& at) {
    undecided_m_[ray] = std::min(undecided_m_[ray], at.norm());
    if (at.norm() >= nearest_m) return;
    nearest_m = at.norm();
    contact_m = camera_->foot() + at;
  });
  return contact_m;
}

/// Tests the rays from one end of a segment to the other, the shorter way around.
void FloorScan::addSegment(const Eigen::Vector2d& a, std::size_t before_a, const Eigen::Vector2d& b,
                           std::size_t before_b, std::uint16_t label) {
  const bool left = a.x() * b.y() - a.y() * b.x() > 0.0;
  const std::size_t n = bearing_.size(), from = left ? before_a : before_b, to = left ? before_b : before_a;
  for (std::size_t ray = from; ray != to;) {
    ray = ray + 1 < n ? ray + 1 : 0;
    const Eigen::Vector2d side(-bearing_[ray].y(), bearing_[ray].x());
    const double da = side.dot(a), db = side.dot(b);
    const double share = std::abs(da - db) > 1e-12 ? std::clamp(da / (da - db), 0.0, 1.0) : 0.0;
    const double range = bearing_[ray].dot(a + share * (b - a));
    if (range <= 0.0 || range >= nearest_m_[ray]) continue;
    nearest_m_[ray] = range;
    object_[ray] = label;
  }
}

void FloorScan::finish(Scan& scan) {
  const std::size_t n = bearing_.size();
  scan.origin_m = camera_->foot();
  scan.blind_m = blind_m_;
  scan.range_m.resize(n);
  scan.sigma_m.resize(n);
  scan.label.resize(n);
  scan.object.assign(n, 0);
  shares_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    scan.range_m[i] = floor_end_m_[i];
    scan.sigma_m[i] = floor_end_sigma_m_[i];
    scan.label[i] = floor_begin_m_[i] < 0.0f ? RayLabel::kInvalid : RayLabel::kFloorEnd;
    const double range = std::min(nearest_m_[i], undecided_m_[i]);
    if (floor_begin_m_[i] < 0.0f || range > static_cast<double>(floor_end_m_[i])) continue;
    scan.range_m[i] = static_cast<float>(range);
    scan.sigma_m[i] =
        static_cast<float>(options_.sigma_px * radialMetres(*camera_, camera_->foot() + range * bearing_[i]));
    if (range < nearest_m_[i]) {
      scan.label[i] = RayLabel::kUndecided;
      continue;
    }
    scan.label[i] = ends_at_wall_[i] != 0 ? RayLabel::kObstacle : RayLabel::kUnknown;
    scan.object[i] = object_[i];
  }
  for (std::size_t i = 0; i < n; ++i)
    if (floor_begin_m_[i] >= 0.0f) shares_.push_back(scan.range_m[i] / floor_end_m_[i]);
  const auto middle = shares_.begin() + static_cast<std::ptrdiff_t>(shares_.size() / 2);
  if (!shares_.empty()) std::nth_element(shares_.begin(), middle, shares_.end());
  free_share_ = shares_.empty() ? 0.0 : static_cast<double>(*middle);
}

}  // namespace omnifleet::local_mapper
