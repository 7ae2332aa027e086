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
constexpr double kElsewhereM = 0.25;         // m, two viewpoints this far apart show different floor
constexpr double kSkippedM = 0.2;            // m, of the cells of a skipped frontier about its place
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

/// Whether most of a frontier has been skipped.
bool isSkipped(const ExplorationGrid& grid, const Frontier& frontier,
               const std::vector<SkippedFrontier>& skipped, bool looked) {
  const auto gone =
      std::count_if(frontier.cells.begin(), frontier.cells.end(), [&](const Eigen::Vector2i& cell) {
        return std::any_of(skipped.begin(), skipped.end(), [&](const SkippedFrontier& s) {
          return s.looked == looked && (grid.centreOf(cell) - s.place_m).norm() <= kSkippedM;
        });
      });
  return 2 * static_cast<std::size_t>(gone) > frontier.cells.size();
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

/// The floor that the body hides is shown by rays that pass over it. After a look without a result the whole
/// frontier must be beyond it.
ViewpointOptions Exploration::viewpointOptions(const Explorer& robot, bool beyond_blind) const {
  ViewpointOptions options;
  const double view_rad = robot.field_of_view_rad > 0.0 ? robot.field_of_view_rad : kFieldOfView_rad;
  options.field_of_view_rad = std::max(kViewEdge_rad, view_rad - kViewEdge_rad);
  options.nearest_m = beyond_blind ? robot.blind_m + kEdgeM : robot.radius_m;
  options.farthest_m = std::max(options_.look_m, options.nearest_m + kLookDepthM);
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
                                        const Explorer& robot, const ExplorationGrid& grid,
                                        const std::vector<Eigen::Vector2d>& failed_m) const {
  Choice best{kInfinity, {}};
  for (const Viewpoint& view : views) {
    if (!field.reaches(view.cell)) continue;
    const bool failed = std::any_of(failed_m.begin(), failed_m.end(), [&](const Eigen::Vector2d& place_m) {
      return (grid.centreOf(view.cell) - place_m).norm() < kElsewhereM;
    });
    if (failed) continue;
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

/// What each robot can reach and see. Robots that drive are not in the way for long.
void Exploration::findReachable(const ExplorationGrid& grid, const std::vector<Explorer>& robots) {
  std::vector<Barriers::Solid> standing;
  opaque_ = cv::Mat1b::zeros(grid.size());
  standable_ = cv::Mat1b::zeros(grid.size());
  coverable_ = cv::Mat1b::zeros(grid.size());
  for (const Explorer& robot : robots) {
    if (robot.explores) continue;
    standing.push_back({robot.outline_m, options_.margin_m});
    forCellsAround(grid, robot.outline_m, 0.0, [&](int column, int row) {
      if (contains(robot.outline_m, grid.centreOf({column, row}))) opaque_(row, column) = 1;
    });
  }
  fields_.resize(robots.size());
  takes_part_.assign(robots.size(), false);
  here_.clear();
  price_.create(grid.size());
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const Eigen::Vector2d here_m = robots[i].map_from_base.translation();
    takes_part_[i] = robots[i].explores && grid.isInside(grid.cellOf(here_m));
    if (!takes_part_[i]) continue;
    priceCells(grid, here_m, robots[i].radius_m, standing, price_);
    for (std::size_t k = 0; k < robots.size(); ++k) {
      if (k != i && robots[k].explores) discourage(grid, robots[k].outline_m, robots[i].radius_m, price_);
    }
    fields_[i].from(price_, grid.cellOf(here_m));
    here_.push_back(grid.cellOf(here_m));
    for (int row = 0; row < standable_.rows; ++row)
      for (int column = 0; column < standable_.cols; ++column)
        if (fields_[i].reaches({column, row})) standable_(row, column) = 1;
    addCoverable(grid, fields_[i], robots[i].radius_m);
  }
}

/// A wall of cells has gaps where hits were noisy, and a few rays end behind it. No body covers that floor.
void Exploration::addCoverable(const ExplorationGrid& grid, const DistanceField& field, double radius_m) {
  cv::Mat1b beyond(grid.size());
  for (int row = 0; row < beyond.rows; ++row)
    for (int column = 0; column < beyond.cols; ++column)
      beyond(row, column) = field.reaches({column, row}) ? 0 : 1;
  cv::Mat1f way;
  cv::distanceTransform(beyond, way, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const double most_m = radius_m + options_.margin_m + M_SQRT1_2 * grid.cell_m();
  coverable_ |= grid.cell_m() * way <= most_m;
}

bool Exploration::isCoverable(const Frontier& frontier) const {
  return std::any_of(frontier.cells.begin(), frontier.cells.end(),
                     [&](const Eigen::Vector2i& cell) { return coverable_(cell.y(), cell.x()) != 0; });
}

/// Time of each robot to a view of the frontier.
std::vector<double> Exploration::timesTo(const Frontier& frontier, const ExplorationGrid& grid,
                                         const std::vector<Explorer>& robots, std::size_t own,
                                         Viewpoint& own_viewpoint) const {
  std::vector<double> times_s(robots.size(), kInfinity);
  std::vector<Viewpoint> views;
  const Explorer* viewer = nullptr;
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const Explorer& robot = robots[i];
    if (!takes_part_[i] || isSkipped(grid, frontier, robot.skipped, false)) continue;
    const bool same = viewer && viewer->field_of_view_rad == robot.field_of_view_rad &&
                      viewer->blind_m == robot.blind_m && viewer->radius_m == robot.radius_m;
    if (!same)
      views = viewpointsOf(frontier, grid, standable_, opaque_, here_, viewpointOptions(robot, false));
    viewer = &robot;
    const Choice choice = choose(views, fields_[i], robot, grid, {});
    if (i == own) own_viewpoint = choice.viewpoint;
    const bool kept = robot.goal_m && isAt(grid, frontier, *robot.goal_m, kSameM);
    times_s[i] = kept ? std::max(0.0, choice.time_s - options_.keep_s) : choice.time_s;
  }
  return times_s;
}

Exploration::Plan Exploration::plan(const ExplorationGrid& grid, const std::vector<Explorer>& robots,
                                    std::size_t own, const std::vector<Eigen::Vector2d>& failed_m) {
  Plan plan;
  findReachable(grid, robots);
  std::vector<std::vector<double>> times_s(robots.size());
  std::vector<Eigen::Vector2d> places_m;
  std::vector<Viewpoint> own_viewpoints;
  for (Frontier& frontier : findFrontiers(grid, options_.extent_m, options_.least_cells)) {
    const bool skipped = std::any_of(robots.begin(), robots.end(), [&](const Explorer& robot) {
      return isSkipped(grid, frontier, robot.skipped, true);
    });
    if (skipped || !isCoverable(frontier)) continue;
    Viewpoint own_viewpoint;
    const std::vector<double> to_s = timesTo(frontier, grid, robots, own, own_viewpoint);
    if (std::none_of(to_s.begin(), to_s.end(), [](double t) { return std::isfinite(t); })) continue;
    for (std::size_t i = 0; i < robots.size(); ++i) times_s[i].push_back(to_s[i]);
    places_m.push_back(frontier.place_m);
    own_viewpoints.push_back(own_viewpoint);
    plan.frontiers.push_back(std::move(frontier));
  }
  plan.frontier_of = assignFrontiers(times_s, places_m, options_.near_s, options_.near_m);
  if (plan.frontier_of[own] < 0) return plan;
  const auto mine = static_cast<std::size_t>(plan.frontier_of[own]);
  plan.own = Goal{plan.frontiers[mine], own_viewpoints[mine], times_s[own][mine], false};
  if (!failed_m.empty() && robots[own].goal_m && isAt(grid, plan.own->frontier, *robots[own].goal_m, kSameM))
    lookFromElsewhere(grid, robots[own], own, failed_m, *plan.own);
  return plan;
}

/// Another viewpoint than those that have shown nothing.
void Exploration::lookFromElsewhere(const ExplorationGrid& grid, const Explorer& robot, std::size_t own,
                                    const std::vector<Eigen::Vector2d>& failed_m, Goal& goal) const {
  const Choice choice =
      choose(viewpointsOf(goal.frontier, grid, standable_, opaque_, here_, viewpointOptions(robot, true)),
             fields_[own], robot, grid, failed_m);
  goal.exhausted = !std::isfinite(choice.time_s);
  if (!goal.exhausted) goal.viewpoint = choice.viewpoint;
}

}  // namespace omnifleet::motion
