#include "motion/route.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::motion {
namespace {

constexpr double kNearEndM =
    0.35;  // m, about the robot and the goal; within it a clearance that is already lower is accepted
constexpr float kTightStart =
    20.0f;  // cost per metre of leaving a place with less clearance than a path may have
constexpr double kSameGoalM = 0.3;  // m; places to keep move, so a path to a goal this near is kept
constexpr double kEpsM = 1e-3;
constexpr int kPauseAfterFailure = 5;  // frames

/// The goal, or the point where the straight line to it leaves the window.
Eigen::Vector2d within(const FloorMemory& floor, const Eigen::Vector2d& from_m,
                       const Eigen::Vector2d& goal_m) {
  if (floor.isInside(floor.cellOf(goal_m))) return goal_m;
  double inside = 0.0, outside = 1.0;
  while ((outside - inside) * (goal_m - from_m).norm() > 0.5 * floor.cell_m()) {
    const double middle = 0.5 * (inside + outside);
    (floor.isInside(floor.cellOf(from_m + middle * (goal_m - from_m))) ? inside : outside) = middle;
  }
  return from_m + inside * (goal_m - from_m);
}

}  // namespace

Route::Options Route::Options::read(const options::Section& section) {
  Options options;
  section.read("tight_margin_m", options.tight_margin_m, {0.0, 2.0});
  section.read("margin_m", options.margin_m, {0.0, 2.0});
  section.read("near_cost", options.near_cost, {0.0, 100.0});
  section.read("switch_share", options.switch_share, {0.1, 1.0});
  section.finish();
  if (options.tight_margin_m > options.margin_m) section.fail("tight_margin_m", "must not exceed margin_m");
  return options;
}

/// Cost per metre at the given clearance; infinity if no path may lead there.
double Route::stepCost(double clear_m, double radius_m) const {
  const double tight_m = radius_m + options_.tight_margin_m, wide_m = radius_m + options_.margin_m;
  if (clear_m >= wide_m) return 1.0;
  if (clear_m < tight_m) return std::numeric_limits<double>::infinity();
  return 1.0 + options_.near_cost * (wide_m - clear_m) / std::max(kEpsM, wide_m - tight_m);
}

/// Whether a straight line has the given clearance; near its ends the clearance at the ends is sufficient.
bool Route::isFree(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m,
                   double clear_m) const {
  const double length_m = (to_m - from_m).norm();
  if (length_m <= 2.0 * floor.cell_m()) return true;  // the cell grid does not resolve lines this short
  const double start_m = std::min(clear_m, floor.clearanceAt(from_m)),
               end_m = std::min(clear_m, floor.clearanceAt(to_m));
  const int samples = static_cast<int>(std::ceil(2.0 * length_m / floor.cell_m()));
  for (int sample = 1; sample < samples; ++sample) {
    const double along_m = length_m * sample / samples;
    double wanted_m = clear_m;
    if (along_m < kNearEndM) wanted_m = std::min(wanted_m, start_m);
    if (length_m - along_m < kNearEndM) wanted_m = std::min(wanted_m, end_m);
    if (floor.clearanceAt(from_m + along_m / length_m * (to_m - from_m)) < wanted_m - kEpsM) return false;
  }
  return true;
}

Route::Leg Route::towards(const FloorMemory& floor, const Eigen::Vector2d& from_m,
                          const Eigen::Vector2d& goal_m, double radius_m) {
  if ((goal_m - path_goal_m_).norm() > kSameGoalM) {
    path_m_.clear();
    path_goal_m_ = goal_m;
    search_pause_ = 0;
  }
  const Leg straight{goal_m, (goal_m - from_m).norm(), true, true};
  // A robot on a detour leaves it only for a straight line with the larger margin.
  const double margin_m = path_m_.empty() ? options_.tight_margin_m : options_.margin_m;
  const bool goal_is_free = floor.clearanceAt(goal_m) >= radius_m;
  if (goal_is_free && isFree(floor, from_m, goal_m, radius_m + margin_m)) {
    path_m_.clear();
    return straight;
  }
  dropDriven(floor, from_m, radius_m);
  search_pause_ = std::max(0, search_pause_ - 1);
  if (search_pause_ == 0) search(floor, from_m, within(floor, from_m, goal_m), radius_m);
  if (!path_m_.empty()) return legOf(floor, from_m, radius_m);
  // Without a path the robot is either too close to an obstacle (it drives straight on) or as near to the
  // goal as possible (it stays).
  const bool squeezed = floor.clearanceAt(from_m) < radius_m + options_.tight_margin_m;
  return squeezed ? straight : Leg{from_m, 0.0, false, false};
}

double Route::costOf(const FloorMemory& floor, double radius_m) const {
  double cost = 0.0;
  for (std::size_t i = 0; i + 1 < path_m_.size(); ++i) {
    const double length_m = (path_m_[i + 1] - path_m_[i]).norm();
    double per_m = stepCost(floor.clearanceAt(path_m_[i]), radius_m);
    const bool leaving = (path_m_[i] - path_m_.front()).norm() < kNearEndM;  // as in priceCells()
    if (!std::isfinite(per_m) && leaving) per_m = kTightStart;
    cost += length_m * per_m;
  }
  return cost;
}

/// Removes the part of the path that has been driven; clears the path if it is blocked.
void Route::dropDriven(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m) {
  if (path_m_.empty()) return;
  const auto next = std::min_element(path_m_.begin(), path_m_.end(), [&](const auto& a, const auto& b) {
    return (a - from_m).squaredNorm() < (b - from_m).squaredNorm();
  });
  path_m_.erase(path_m_.begin(), next);
  if ((path_m_.front() - from_m).norm() > kNearEndM || !std::isfinite(costOf(floor, radius_m)))
    path_m_.clear();
}

/// Cost of each cell. A robot that is nearer to an obstacle than paths may be can leave, but not come nearer.
void Route::priceCells(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m) {
  const cv::Mat1f& clearance_m = floor.clearance_m();
  price_.create(clearance_m.size());
  std::transform(clearance_m.begin(), clearance_m.end(), price_.begin(),
                 [&](float clear_m) { return static_cast<float>(stepCost(clear_m, radius_m)); });
  const double start_m = floor.clearanceAt(from_m) - kEpsM;
  const Eigen::Vector2i from = floor.cellOf(from_m);
  const int reach = static_cast<int>(kNearEndM / floor.cell_m());
  for (int row = -reach; row <= reach; ++row) {
    for (int column = -reach; column <= reach; ++column) {
      const Eigen::Vector2i cell = from + Eigen::Vector2i(column, row);
      if (!floor.isInside(cell) || clearance_m(cell.y(), cell.x()) < start_m) continue;
      float& price = price_(cell.y(), cell.x());
      if (!std::isfinite(price)) price = kTightStart;
    }
  }
}

/// Searches the cheapest path. It replaces the current path if that ends elsewhere or costs clearly more.
void Route::search(const FloorMemory& floor, const Eigen::Vector2d& from_m, const Eigen::Vector2d& goal_m,
                   double radius_m) {
  const Eigen::Vector2i from = floor.cellOf(from_m);
  if (!floor.isInside(from)) return path_m_.clear();
  priceCells(floor, from_m, radius_m);
  const GridSearch::Result& found = search_.find(price_, from, floor.cellOf(goal_m));
  // A search that does not reach the goal visits the whole window. Its result changes only as fast as
  // obstacles move.
  search_pause_ = found.reaches ? 0 : kPauseAfterFailure;
  const Eigen::Vector2d end_m = found.cells.empty() ? from_m : floor.centreOf(found.cells.back());
  const bool same_end = !path_m_.empty() && (end_m - path_m_.back()).norm() < kSameGoalM;
  if (same_end && floor.cell_m() * found.cost > options_.switch_share * costOf(floor, radius_m)) return;
  path_m_.clear();
  if (found.cells.empty()) return;
  path_m_.push_back(from_m);
  for (const Eigen::Vector2i& cell : found.cells) path_m_.push_back(floor.centreOf(cell));
  reaches_ = found.reaches;
}

/// The next leg: straight to the last place of the path that is reached without coming nearer to obstacles
/// than the path does.
Route::Leg Route::legOf(const FloorMemory& floor, const Eigen::Vector2d& from_m, double radius_m) const {
  Leg leg{path_m_.back(), 0.0, false, reaches_};
  double least_m = radius_m + options_.margin_m;
  std::size_t via = std::min<std::size_t>(1, path_m_.size() - 1);
  for (std::size_t i = 1; i < path_m_.size(); ++i) {
    leg.left_m += (path_m_[i] - path_m_[i - 1]).norm();
    least_m = std::min(least_m, floor.clearanceAt(path_m_[i]));
    if (isFree(floor, from_m, path_m_[i], least_m)) via = i;
  }
  leg.via_m = path_m_[via];
  return leg;
}

}  // namespace omnifleet::motion
