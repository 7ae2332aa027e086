#include "motion/exploration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "motion/frontier_assignment.h"

namespace omnifleet::motion {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFieldOfView_rad = M_PI_2;  // until a robot has published a view
constexpr double kViewEdge_rad = 0.1;        // a frontier at the edge of the view does not count as seen
constexpr double kSameM = 0.12;              // m, a goal or skipped place this near a frontier belongs to it
constexpr double kLeavingM = 0.25;           // m about the robot, where it may leave a tight place
constexpr double kNearLook = 0.6;            // the last look is from within this share of look_m
constexpr double kEdgeM = 0.05;              // m beyond the hidden floor
constexpr double kLookDepthM = 0.2;          // m, least depth of the ring of viewpoints
constexpr float kTightPrice = 20.0f;         // cost per metre there

/// Visits the cells within a distance of the rectangle around an outline.
template <typename Visit>
void forCellsAround(const ExplorationGrid& grid, const Polygon& outline_m, double far_m, Visit visit) {
  Eigen::Vector2d low_m = outline_m.front(), high_m = low_m;
  for (const Eigen::Vector2d& vertex : outline_m) {
    low_m = low_m.cwiseMin(vertex);
    high_m = high_m.cwiseMax(vertex);
  }
  const Eigen::Vector2d far(far_m, far_m);
  const Eigen::Vector2i low = grid.cellOf(low_m - far).cwiseMax(0);
  const Eigen::Vector2i high =
      grid.cellOf(high_m + far).cwiseMin(Eigen::Vector2i(grid.size().width - 1, grid.size().height - 1));
  for (int row = low.y(); row <= high.y(); ++row)
    for (int column = low.x(); column <= high.x(); ++column) visit(column, row);
}

}  // namespace

bool isAt(const ExplorationGrid& grid, const Frontier& frontier, const Eigen::Vector2d& place_m,
          double near_m) {
  return std::any_of(frontier.cells.begin(), frontier.cells.end(), [&](const Eigen::Vector2i& cell) {
    return (grid.centreOf(cell) - place_m).norm() <= near_m;
  });
}

Exploration::Options Exploration::Options::read(const options::Section& section) {
  Options options;
  section.read("margin_m", options.margin_m, {0.0, 1.0});
  section.read("wide_margin_m", options.wide_margin_m, {0.0, 2.0});
  section.read("near_cost", options.near_cost, {0.0, 100.0});
  section.read("extent_m", options.extent_m, {0.05, 5.0});
  section.read("least_cells", options.least_cells, {1, 1000});
  section.read("look_m", options.look_m, {0.1, 10.0});
  section.read("look_part_s", options.look_part_s, {0.0, 100.0});
  section.read("keep_s", options.keep_s, {0.0, 100.0});
  section.read("beside_cost", options.beside_cost, {0.0, 100.0});
  section.read("near_s", options.near_s, {0.0, 1000.0});
  section.read("near_m", options.near_m, {0.01, 100.0});
  section.finish();
  if (options.margin_m > options.wide_margin_m) section.fail("margin_m", "must not exceed wide_margin_m");
  return options;
}

void Exploration::priceCells(const ExplorationGrid& grid, const Eigen::Vector2d& here_m, double radius_m,
                             const std::vector<Barriers::Solid>& solids, cv::Mat1f& price) const {
  cv::Mat1f clearance_m = grid.occupiedClearance_m().clone();
  const cv::Mat1f& unknown_m = grid.unknownClearance_m();
  const double wide_m = radius_m + options_.wide_margin_m, tight_m = radius_m + options_.margin_m;
  for (const Barriers::Solid& solid : solids) {
    const double more_m = solid.margin_m - options_.margin_m;
    forCellsAround(grid, solid.outline_m, wide_m + std::max(0.0, more_m), [&](int column, int row) {
      const double clear_m = distanceTo(solid.outline_m, grid.centreOf({column, row})) - more_m;
      clearance_m(row, column) = std::min(clearance_m(row, column), static_cast<float>(clear_m));
    });
  }
  const Eigen::Vector2i here = grid.cellOf(here_m);
  const bool inside = grid.isInside(here);
  const double here_clear_m = inside ? clearance_m(here.y(), here.x()) - 1e-3 : 0.0;
  const double slope = options_.near_cost / std::max(1e-3, wide_m - tight_m);
  for (int row = 0; row < price.rows; ++row) {
    for (int column = 0; column < price.cols; ++column) {
      const double clear_m = clearance_m(row, column), edge_m = unknown_m(row, column);
      float& cost = price(row, column);
      cost = std::numeric_limits<float>::infinity();
      if (grid.at({column, row}) != Cell::kFree) continue;
      if (clear_m >= tight_m && edge_m >= radius_m) {
        cost = static_cast<float>(1.0 + slope * std::max(0.0, wide_m - clear_m));
      } else if (inside && clear_m >= std::min(here_clear_m, tight_m) &&
                 (grid.centreOf({column, row}) - here_m).norm() <= kLeavingM) {
        cost = kTightPrice;
      }
    }
  }
}

/// First from anywhere; floor that the body hides is shown by rays that pass over it. Then from where all of
/// it is in view, at last from near.
ViewpointOptions Exploration::viewpointOptions(const Explorer& robot, int look) const {
  ViewpointOptions options;
  const double view_rad = robot.field_of_view_rad > 0.0 ? robot.field_of_view_rad : kFieldOfView_rad;
  options.field_of_view_rad = std::max(kViewEdge_rad, view_rad - kViewEdge_rad);
  options.nearest_m = look == 0 ? robot.radius_m : robot.blind_m + kEdgeM;
  options.farthest_m = std::max(look < kLooks - 1 ? options_.look_m : kNearLook * options_.look_m,
                                options.nearest_m + kLookDepthM);
  return options;
}

/// Other robots that drive are avoided, but they do not stay.
void Exploration::discourage(const ExplorationGrid& grid, const Polygon& outline_m, double radius_m,
                             cv::Mat1f& price) const {
  const double far_m = radius_m + options_.wide_margin_m;
  forCellsAround(grid, outline_m, far_m, [&](int column, int row) {
    if (distanceTo(outline_m, grid.centreOf({column, row})) < far_m)
      price(row, column) += static_cast<float>(options_.beside_cost);
  });
}

/// The viewpoint that the robot reaches first; seeing more of the frontier is worth some time.
Exploration::Choice Exploration::choose(const std::vector<Viewpoint>& views, const DistanceField& field,
                                        const Explorer& robot, const ExplorationGrid& grid) const {
  Choice best{kInfinity, {}};
  for (const Viewpoint& view : views) {
    if (!field.reaches(view.cell)) continue;
    const double way_m = grid.cell_m() * static_cast<double>(field.cost(view.cell));
    const Eigen::Vector2d straight_m = grid.centreOf(view.cell) - robot.map_from_base.translation();
    const double first_rad = way_m > 2.0 * grid.cell_m()
                                 ? std::atan2(straight_m.y(), straight_m.x()) - robot.map_from_base.theta_rad
                                 : view.heading_rad - robot.map_from_base.theta_rad;
    const double time_s = way_m / options_.cruise_mps + std::abs(wrapAngle(first_rad)) / options_.turn_radps +
                          options_.look_part_s * (1.0 - view.seen);
    if (time_s < best.time_s) best = {time_s, view};
  }
  return best;
}

Exploration::Plan Exploration::plan(const ExplorationGrid& grid, const std::vector<Explorer>& robots,
                                    std::size_t own, int look) {
  Plan plan;
  plan.frontier_of.assign(robots.size(), -1);
  std::vector<Frontier> found = findFrontiers(grid, options_.extent_m, options_.least_cells);
  std::vector<Barriers::Solid> standing;
  cv::Mat1b opaque = cv::Mat1b::zeros(grid.size());
  for (const Explorer& robot : robots) {
    if (robot.explores) continue;
    standing.push_back({robot.outline_m, options_.margin_m});
    forCellsAround(grid, robot.outline_m, 0.0, [&](int column, int row) {
      if (contains(robot.outline_m, grid.centreOf({column, row}))) opaque(row, column) = 1;
    });
  }

  // What each robot can reach; robots that drive are not in the way for long.
  fields_.resize(robots.size());
  price_.create(grid.size());
  cv::Mat1b reachable = cv::Mat1b::zeros(grid.size());
  std::vector<Eigen::Vector2i> here;
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const Eigen::Vector2i start = grid.cellOf(robots[i].map_from_base.translation());
    if (!robots[i].explores || !grid.isInside(start)) continue;
    priceCells(grid, robots[i].map_from_base.translation(), robots[i].radius_m, standing, price_);
    for (std::size_t k = 0; k < robots.size(); ++k) {
      if (k != i && robots[k].explores) discourage(grid, robots[k].outline_m, robots[i].radius_m, price_);
    }
    fields_[i].from(price_, start);
    here.push_back(start);
    for (int row = 0; row < reachable.rows; ++row)
      for (int column = 0; column < reachable.cols; ++column)
        if (fields_[i].reaches({column, row})) reachable(row, column) = 1;
  }

  std::vector<std::vector<double>> times_s(robots.size());
  std::vector<Eigen::Vector2d> places_m;
  std::vector<Viewpoint> own_viewpoint;
  for (Frontier& frontier : found) {
    const auto skippedBy = [&](const Explorer& robot, bool looked) {
      return std::any_of(robot.skipped.begin(), robot.skipped.end(), [&](const SkippedFrontier& skipped) {
        return skipped.looked == looked && isAt(grid, frontier, skipped.place_m, kSameM);
      });
    };
    if (std::any_of(robots.begin(), robots.end(), [&](const Explorer& r) { return skippedBy(r, true); }))
      continue;
    std::vector<double> row_s(robots.size(), kInfinity);
    Viewpoint mine;
    for (std::size_t i = 0; i < robots.size(); ++i) {
      const Explorer& robot = robots[i];
      if (!robot.explores || !grid.isInside(grid.cellOf(robot.map_from_base.translation()))) continue;
      if (skippedBy(robot, false)) continue;
      const auto views = viewpointsOf(frontier, grid, reachable, opaque, here, viewpointOptions(robot, 0));
      Choice choice = choose(views, fields_[i], robot, grid);
      if (i == own) {
        mine = choice.viewpoint;
        if (look > 0 && robot.goal_m && isAt(grid, frontier, *robot.goal_m, kSameM)) {
          const Choice nearer =
              choose(viewpointsOf(frontier, grid, reachable, opaque, here, viewpointOptions(robot, look)),
                     fields_[i], robot, grid);
          if (std::isfinite(nearer.time_s)) mine = nearer.viewpoint;
        }
      }
      if (robot.goal_m && isAt(grid, frontier, *robot.goal_m, kSameM))
        choice.time_s = std::max(0.0, choice.time_s - options_.keep_s);
      row_s[i] = choice.time_s;
    }
    if (std::none_of(row_s.begin(), row_s.end(), [](double t) { return std::isfinite(t); })) continue;
    for (std::size_t i = 0; i < robots.size(); ++i) times_s[i].push_back(row_s[i]);
    places_m.push_back(frontier.place_m);
    own_viewpoint.push_back(mine);
    plan.frontiers.push_back(std::move(frontier));
  }
  plan.frontier_of = assignFrontiers(times_s, places_m, options_.near_s, options_.near_m);
  const int chosen = plan.frontier_of[own];
  if (chosen >= 0) {
    const auto j = static_cast<std::size_t>(chosen);
    plan.own = Goal{plan.frontiers[j], own_viewpoint[j], times_s[own][j]};
  }
  return plan;
}

}  // namespace omnifleet::motion
