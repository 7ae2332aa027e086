#include "motion/exploration_grid.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::motion {
namespace {

// As in FloorMemory: two hits make a cell with floor occupied, a removed obstacle is free within 1–2 s.
constexpr int kHit = 2, kOccupied = 3, kMost = 8;
constexpr double kFaceCells = 0.75;   // from the centre of a cell to its farthest corner
constexpr double kBeforeCells = 0.4;  // the noise of a hit must not show floor behind the face
constexpr double kFarCells = 1e6;
constexpr int kMostCells = 400;

}  // namespace

ExplorationGrid::Options ExplorationGrid::Options::read(const options::Section& section) {
  Options options;
  section.read("cell_m", options.cell_m, {0.01, 0.5});
  section.read("centre_m", options.centre_m);
  section.read("size_m", options.size_m, {0.5, 200.0});
  section.read("sight_m", options.sight_m, {0.2, 16.0});
  section.read("robot_m", options.robot_m, {0.0, 1.0});
  section.read("hit_cells", options.hit_cells, {0.01, 10.0});
  section.finish();
  if (options.size_m.maxCoeff() > kMostCells * options.cell_m)
    section.fail("size_m", "must be at most 400 cells");
  return options;
}

ExplorationGrid::ExplorationGrid(const Options& options) : options_(options) {
  const Eigen::Array2d corner = (options.centre_m - 0.5 * options.size_m).array() / options.cell_m;
  first_ = corner.floor().cast<int>().matrix();
  const Eigen::Array2i size = (options.size_m.array() / options.cell_m).ceil().cast<int>();
  for (cv::Mat1b* layer : {&hits_, &floor_, &cells_, &hit_now_})
    *layer = cv::Mat1b::zeros(size.y(), size.x());
}

Eigen::Vector2i ExplorationGrid::cellOf(const Eigen::Vector2d& place_m) const {
  const Eigen::Array2d cell = (place_m / options_.cell_m).array().floor().max(-kFarCells).min(kFarCells);
  return cell.cast<int>().matrix() - first_;
}

Eigen::Vector2d ExplorationGrid::centreOf(const Eigen::Vector2i& cell) const {
  return options_.cell_m * ((first_ + cell).cast<double>() + Eigen::Vector2d(0.5, 0.5));
}

bool ExplorationGrid::isInside(const Eigen::Vector2i& cell) const {
  return cell.minCoeff() >= 0 && cell.x() < cells_.cols && cell.y() < cells_.rows;
}

template <typename Visit>
void ExplorationGrid::forCellsNear(const Eigen::Vector2d& place_m, double radius_m, Visit visit) const {
  const int reach = static_cast<int>(std::ceil(radius_m / options_.cell_m));
  const Eigen::Vector2i middle = cellOf(place_m);
  for (int row = std::max(0, middle.y() - reach); row <= std::min(cells_.rows - 1, middle.y() + reach); ++row)
    for (int column = std::max(0, middle.x() - reach);
         column <= std::min(cells_.cols - 1, middle.x() + reach); ++column)
      visit(Eigen::Vector2i(column, row));
}

void ExplorationGrid::classify(const Eigen::Vector2i& cell) {
  const int hits = hits_(cell.y(), cell.x());
  const bool floor = floor_(cell.y(), cell.x()) != 0;
  const bool occupied = hits >= kOccupied || (hits > 0 && !floor);
  const Cell now = occupied ? Cell::kOccupied : floor ? Cell::kFree : Cell::kUnknown;
  std::uint8_t& before = cells_(cell.y(), cell.x());
  if (before == static_cast<std::uint8_t>(now)) return;
  before = static_cast<std::uint8_t>(now);
  occupied_is_current_ = unknown_is_current_ = false;
}

void ExplorationGrid::see(const Pose2& map_from_base, const View& view, const std::vector<Polygon>& robots) {
  if (view.ray.empty()) return;
  markHits(map_from_base, view, robots);
  markFloor(map_from_base, view);
}

void ExplorationGrid::markHits(const Pose2& map_from_base, const View& view,
                               const std::vector<Polygon>& robots) {
  hit_now_.setTo(0);
  is_hit_.assign(view.ray.size(), 0);
  for (std::size_t i = 0; i < view.ray.size(); ++i) {
    const double range_m = view.range_m(i), bearing_rad = view.bearing_rad(i);
    // The object lies anywhere in the sector of the ray.
    const bool sharp = 0.5 * range_m * view.step_rad <= options_.cell_m;
    if (view.kind(i) != View::kSolid || range_m > options_.sight_m || !sharp) continue;
    const Eigen::Vector2d place_m =
        map_from_base *
        (view.origin_m + range_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad)));
    const bool robot = std::any_of(robots.begin(), robots.end(), [&](const Polygon& outline) {
      return distanceTo(outline, place_m) <= options_.robot_m;
    });
    const Eigen::Vector2i cell = cellOf(place_m);
    if (robot || !isInside(cell) || hit_now_(cell.y(), cell.x())) continue;
    hit_now_(cell.y(), cell.x()) = 1;
    std::uint8_t& hits = hits_(cell.y(), cell.x());
    hits = static_cast<std::uint8_t>(std::min(kMost, hits + kHit));
    classify(cell);
  }
}

void ExplorationGrid::markFloor(const Pose2& map_from_base, const View& view) {
  const Eigen::Vector2d origin_m = map_from_base * view.origin_m;
  const int rays = static_cast<int>(view.ray.size());
  forCellsNear(origin_m, options_.sight_m, [&](const Eigen::Vector2i& cell) {
    const Eigen::Vector2d way_m = centreOf(cell) - origin_m;
    const double range_m = way_m.norm();
    if (range_m > options_.sight_m || hit_now_(cell.y(), cell.x())) return;
    const double bearing_rad = std::atan2(way_m.y(), way_m.x()) - map_from_base.theta_rad - view.first_rad;
    // Half a step before the first ray still belongs to it.
    double from_first_rad = std::remainder(bearing_rad, 2.0 * M_PI);
    if (from_first_rad < -0.5 * view.step_rad) from_first_rad += 2.0 * M_PI;
    const long ray = std::lround(from_first_rad / view.step_rad);
    if (ray < 0 || ray >= rays) return;
    const auto i = static_cast<std::size_t>(ray);
    const View::Kind kind = view.kind(i);
    if (kind == View::kNothing || kind == View::kSolidNear) return;
    const double before_m = kind == View::kSolid ? kBeforeCells * options_.cell_m : 0.0;
    if (range_m + before_m >= view.range_m(i)) return;
    std::uint8_t& hits = hits_(cell.y(), cell.x());
    if (range_m < view.blind_m && hits > 0) return;
    // The face of an obstacle crosses its cells; they are free only if the hits lie clearly beyond them.
    if (hits > 0 && range_m + kFaceCells * options_.cell_m < view.range_m(i)) --hits;
    floor_(cell.y(), cell.x()) = 1;
    classify(cell);
  });
}

void ExplorationGrid::stand(const Polygon& outline_m) {
  double reach_m = 0.0;
  const Eigen::Vector2d middle_m = centroid(outline_m);
  for (const Eigen::Vector2d& vertex : outline_m) reach_m = std::max(reach_m, (vertex - middle_m).norm());
  forCellsNear(middle_m, reach_m + options_.cell_m, [&](const Eigen::Vector2i& cell) {
    if (!contains(outline_m, centreOf(cell))) return;
    hits_(cell.y(), cell.x()) = 0;
    floor_(cell.y(), cell.x()) = 1;
    classify(cell);
  });
}

void ExplorationGrid::assumeFree(const Eigen::Vector2d& place_m, double radius_m) {
  forCellsNear(place_m, radius_m, [&](const Eigen::Vector2i& cell) {
    if (at(cell) != Cell::kUnknown || (centreOf(cell) - place_m).norm() > radius_m) return;
    floor_(cell.y(), cell.x()) = 1;
    classify(cell);
  });
}

const cv::Mat1f& ExplorationGrid::occupiedClearance_m() const {
  if (occupied_is_current_) return occupied_clearance_m_;
  occupied_is_current_ = true;
  cv::compare(cells_, static_cast<int>(Cell::kOccupied), mask_, cv::CMP_NE);
  cv::distanceTransform(mask_, occupied_clearance_m_, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  if (cv::countNonZero(mask_) == static_cast<int>(mask_.total()))
    occupied_clearance_m_.setTo(options_.size_m.norm());
  else
    occupied_clearance_m_ *= options_.cell_m;
  return occupied_clearance_m_;
}

const cv::Mat1f& ExplorationGrid::unknownClearance_m() const {
  if (unknown_is_current_) return unknown_clearance_m_;
  unknown_is_current_ = true;
  cv::Mat1b framed;
  cv::compare(cells_, static_cast<int>(Cell::kUnknown), mask_, cv::CMP_NE);
  cv::copyMakeBorder(mask_, framed, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  cv::Mat1f all_m;
  cv::distanceTransform(framed, all_m, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  unknown_clearance_m_ = options_.cell_m * all_m(cv::Rect(1, 1, mask_.cols, mask_.rows));
  return unknown_clearance_m_;
}

void ExplorationGrid::occupiedNear(const Eigen::Vector2d& place_m, double radius_m,
                                   std::vector<Eigen::Vector2d>& centres_m) const {
  forCellsNear(place_m, radius_m, [&](const Eigen::Vector2i& cell) {
    const Eigen::Vector2d centre_m = centreOf(cell);
    if (at(cell) == Cell::kOccupied && (centre_m - place_m).norm() <= radius_m) centres_m.push_back(centre_m);
  });
}

}  // namespace omnifleet::motion
