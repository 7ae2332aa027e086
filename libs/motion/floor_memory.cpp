#include "motion/floor_memory.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::motion {
namespace {

// One hit counts two and one observation of floor subtracts one. Two hits make a cell occupied, and a removed
// obstacle is free within one to two seconds.
constexpr int kHit = 2, kOccupied = 3, kMost = 8;
constexpr double kFarCells = 1e8;

}  // namespace

FloorMemory::Options FloorMemory::Options::read(const options::Section& section) {
  Options options;
  section.read("cell_m", options.cell_m, {0.01, 0.5});
  section.read("window_m", options.window_m, {1.0, 100.0});
  section.read("sight_m", options.sight_m, {0.1, 50.0});
  section.finish();
  if (options.window_m < 2.0 * options.sight_m) section.fail("window_m", "must be at least twice sight_m");
  if (options.window_m > 400.0 * options.cell_m) section.fail("window_m", "must be at most 400 cells");
  return options;
}

FloorMemory::FloorMemory(const Options& options) : options_(options) {
  const int size = static_cast<int>(std::ceil(options.window_m / options.cell_m));
  seen_ = cv::Mat1b::zeros(size, size);
  hit_ = cv::Mat1b::zeros(size, size);
}

Eigen::Vector2i FloorMemory::cellOf(const Eigen::Vector2d& place_m) const {
  // Places beyond this bound are outside any window.
  const Eigen::Array2d cell = (place_m / options_.cell_m).array().floor().max(-kFarCells).min(kFarCells);
  return cell.cast<int>().matrix() - first_;
}

Eigen::Vector2d FloorMemory::centreOf(const Eigen::Vector2i& cell) const {
  return options_.cell_m * ((first_ + cell).cast<double>() + Eigen::Vector2d(0.5, 0.5));
}

bool FloorMemory::isInside(const Eigen::Vector2i& cell) const {
  return (cell.array() >= 0).all() && (cell.array() < seen_.cols).all();
}

void FloorMemory::forget() {
  seen_.setTo(0);
  is_current_ = false;
}

void FloorMemory::see(const Pose2& map_from_base, const Scan& scan) {
  if (scan.range_m.empty()) return;
  moveTo(map_from_base * scan.origin_m);
  clearSeen(map_from_base, scan);
  markHits(map_from_base, scan);
  is_current_ = false;
}

/// Moves the window once the robot is a quarter of its size off its centre.
void FloorMemory::moveTo(const Eigen::Vector2d& here_m) {
  const int size = seen_.cols;
  const Eigen::Vector2i off = cellOf(here_m) - Eigen::Vector2i::Constant(size / 2);
  if (placed_ && (off.array().abs() < size / 4).all()) return;
  cv::Mat1b moved = cv::Mat1b::zeros(size, size);
  const cv::Rect all(0, 0, size, size);
  const cv::Rect kept = all & cv::Rect(off.x(), off.y(), size, size);
  if (placed_ && !kept.empty()) seen_(kept).copyTo(moved(kept - cv::Point(off.x(), off.y())));
  seen_ = moved;
  first_ += off;
  placed_ = true;
}

/// A cell shows floor if every ray that may cross it ends beyond it.
void FloorMemory::clearSeen(const Pose2& map_from_base, const Scan& scan) {
  const Eigen::Vector2d origin_m = map_from_base * scan.origin_m;
  const int rays = static_cast<int>(scan.range_m.size());
  const double step_rad = 2.0 * M_PI / rays, half_m = 0.75 * options_.cell_m;
  const int reach = static_cast<int>(options_.sight_m / options_.cell_m);
  const Eigen::Vector2i middle = cellOf(origin_m);
  for (int row = std::max(0, middle.y() - reach); row <= std::min(seen_.rows - 1, middle.y() + reach);
       ++row) {
    for (int column = std::max(0, middle.x() - reach); column <= std::min(seen_.cols - 1, middle.x() + reach);
         ++column) {
      std::uint8_t& seen = seen_(row, column);
      if (seen == 0) continue;
      const Eigen::Vector2d off_m = centreOf({column, row}) - origin_m;
      const double range_m = off_m.norm();
      if (range_m < scan.blind_m + half_m || range_m > options_.sight_m) continue;
      const double bearing_rad = std::atan2(off_m.y(), off_m.x()) - map_from_base.theta_rad;
      const int ray = static_cast<int>(std::lround(bearing_rad / step_rad));
      const int aside = static_cast<int>(std::ceil(half_m / (range_m * step_rad)));
      bool floor = true;
      for (int i = ray - aside; floor && i <= ray + aside; ++i) {
        const auto k = static_cast<std::size_t>(((i % rays) + rays) % rays);
        floor = scan.label[k] != RayLabel::kInvalid && range_m + half_m < scan.range_m[k];
      }
      if (floor) --seen;
    }
  }
}

void FloorMemory::markHits(const Pose2& map_from_base, const Scan& scan) {
  const double step_rad = 2.0 * M_PI / static_cast<double>(scan.range_m.size());
  hit_.setTo(0);
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const double range_m = scan.range_m[i], bearing_rad = step_rad * static_cast<double>(i);
    if (!isSolid(scan.label[i]) || !(range_m <= options_.sight_m)) continue;
    const Eigen::Vector2i cell =
        cellOf(map_from_base *
               (scan.origin_m + range_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad))));
    if (!isInside(cell) || hit_(cell.y(), cell.x())) continue;
    hit_(cell.y(), cell.x()) = 1;
    std::uint8_t& seen = seen_(cell.y(), cell.x());
    seen = static_cast<std::uint8_t>(std::min(kMost, seen + kHit));
  }
}

void FloorMemory::clear(const Eigen::Vector2d& place_m, double radius_m) {
  const int reach = static_cast<int>(std::ceil(radius_m / options_.cell_m));
  const Eigen::Vector2i middle = cellOf(place_m);
  for (int row = -reach; row <= reach; ++row) {
    for (int column = -reach; column <= reach; ++column) {
      const Eigen::Vector2i cell = middle + Eigen::Vector2i(column, row);
      if (!isInside(cell) || (centreOf(cell) - place_m).norm() > radius_m) continue;
      seen_(cell.y(), cell.x()) = 0;
    }
  }
  is_current_ = false;
}

const cv::Mat1f& FloorMemory::clearance_m() const {
  if (is_current_) return clearance_m_;
  is_current_ = true;
  cv::compare(seen_, kOccupied, free_, cv::CMP_LT);
  if (cv::countNonZero(free_) == static_cast<int>(free_.total())) {
    clearance_m_.create(free_.size());
    clearance_m_.setTo(options_.window_m);
    return clearance_m_;
  }
  cv::distanceTransform(free_, clearance_m_, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  clearance_m_ *= options_.cell_m;
  return clearance_m_;
}

double FloorMemory::clearanceAt(const Eigen::Vector2d& place_m) const {
  const Eigen::Vector2i cell = cellOf(place_m);
  return isInside(cell) ? clearance_m()(cell.y(), cell.x()) : options_.window_m;
}

}  // namespace omnifleet::motion
