#include "motion/frontiers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace omnifleet::motion {
namespace {

constexpr std::size_t kMostSamples = 8;  // cells of a frontier that are tested for visibility
constexpr int kStride = 2;               // cells between candidates
constexpr double kGrazingCells = 1.1;    // next to an occupied cell
constexpr double kGrazing = 0.3;
constexpr double kNextCells = 1.6;  // the line of sight may end this far (cells) before the frontier
const std::array<Eigen::Vector2i, 4> kBeside{Eigen::Vector2i(1, 0), Eigen::Vector2i(-1, 0),
                                             Eigen::Vector2i(0, 1), Eigen::Vector2i(0, -1)};

bool isFrontier(const ExplorationGrid& grid, const Eigen::Vector2i& cell) {
  if (grid.at(cell) != Cell::kUnknown) return false;
  return std::any_of(kBeside.begin(), kBeside.end(), [&](const Eigen::Vector2i& way) {
    return grid.isInside(cell + way) && grid.at(cell + way) == Cell::kFree;
  });
}

/// The connected frontier cells around `seed` within a square of side `extent` (cells) about it.
Frontier groupAround(const ExplorationGrid& grid, const Eigen::Vector2i& seed, int extent, cv::Mat1b& done) {
  Frontier frontier;
  frontier.cells.push_back(seed);
  done(seed.y(), seed.x()) = 1;
  Eigen::Vector2i least = seed, most = seed;
  for (std::size_t next = 0; next < frontier.cells.size(); ++next) {
    const Eigen::Vector2i at = frontier.cells[next];
    for (int k = 0; k < 9; ++k) {
      const Eigen::Vector2i cell = at + Eigen::Vector2i(k % 3 - 1, k / 3 - 1);
      if (!grid.isInside(cell) || done(cell.y(), cell.x()) || !isFrontier(grid, cell)) continue;
      const Eigen::Vector2i low = least.cwiseMin(cell), high = most.cwiseMax(cell);
      if ((high - low).maxCoeff() >= extent) continue;
      least = low;
      most = high;
      done(cell.y(), cell.x()) = 1;
      frontier.cells.push_back(cell);
    }
  }
  return frontier;
}

void place(const ExplorationGrid& grid, Frontier& frontier) {
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2i& cell : frontier.cells) mean_m += grid.centreOf(cell);
  mean_m /= static_cast<double>(frontier.cells.size());
  const auto nearest =
      std::min_element(frontier.cells.begin(), frontier.cells.end(), [&](const auto& a, const auto& b) {
        return (grid.centreOf(a) - mean_m).squaredNorm() < (grid.centreOf(b) - mean_m).squaredNorm();
      });
  frontier.place_m = grid.centreOf(*nearest);
}

std::vector<Eigen::Vector2i> samplesOf(const Frontier& frontier) {
  const std::size_t n = std::min(kMostSamples, frontier.cells.size());
  std::vector<Eigen::Vector2i> samples;
  for (std::size_t i = 0; i < n; ++i) samples.push_back(frontier.cells[i * frontier.cells.size() / n]);
  return samples;
}

/// Share of a line of sight that counts: all if it keeps a cell away from what hides, part if it grazes it,
/// none if it is hidden.
double visibility(const ExplorationGrid& grid, const cv::Mat1b& opaque, const Eigen::Vector2i& from,
                  const Eigen::Vector2i& to) {
  const Eigen::Vector2d way = (to - from).cast<double>();
  const double length = way.norm();
  const int steps = static_cast<int>(std::ceil(2.0 * length));
  double share = 1.0;
  for (int step = 1; step < steps; ++step) {
    const double along = length * step / steps;
    if (along > length - kNextCells) break;
    const Eigen::Vector2i cell = from + (way * (along / length)).array().round().cast<int>().matrix();
    if (grid.at(cell) != Cell::kFree || opaque(cell.y(), cell.x())) return 0.0;
    if (grid.occupiedClearance_m()(cell.y(), cell.x()) <= kGrazingCells * grid.cell_m()) share = kGrazing;
  }
  return share;
}

/// The heading that shows most of the visible samples, and their share.
Viewpoint lookFrom(const ExplorationGrid& grid, const cv::Mat1b& opaque,
                   const std::vector<Eigen::Vector2i>& samples, const Eigen::Vector2i& from,
                   const ViewpointOptions& options) {
  Viewpoint view{from, 0.0, 0.0};
  std::array<double, kMostSamples> bearing_rad{}, share{};
  std::size_t visible = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2i& sample : samples) {
    const Eigen::Vector2d way_m = grid.cell_m() * (sample - from).cast<double>();
    const double range_m = way_m.norm();
    if (range_m < options.nearest_m || range_m > options.farthest_m) continue;
    share[visible] = visibility(grid, opaque, from, sample);
    if (share[visible] <= 0.0) continue;
    bearing_rad[visible++] = std::atan2(way_m.y(), way_m.x());
    sum += way_m / range_m;
  }
  if (visible == 0) return view;
  view.heading_rad = std::atan2(sum.y(), sum.x());
  for (std::size_t i = 0; i < visible; ++i) {
    if (std::abs(wrapAngle(bearing_rad[i] - view.heading_rad)) <= 0.5 * options.field_of_view_rad)
      view.seen += share[i] / static_cast<double>(samples.size());
  }
  return view;
}

}  // namespace

std::vector<Frontier> findFrontiers(const ExplorationGrid& grid, double extent_m, int least_cells) {
  std::vector<Frontier> frontiers;
  cv::Mat1b done = cv::Mat1b::zeros(grid.size());
  const int extent = std::max(1, static_cast<int>(std::lround(extent_m / grid.cell_m())));
  for (int row = 0; row < done.rows; ++row) {
    for (int column = 0; column < done.cols; ++column) {
      if (done(row, column) || !isFrontier(grid, {column, row})) continue;
      Frontier frontier = groupAround(grid, {column, row}, extent, done);
      if (static_cast<int>(frontier.cells.size()) < least_cells) continue;
      place(grid, frontier);
      frontiers.push_back(std::move(frontier));
    }
  }
  return frontiers;
}

std::vector<Viewpoint> viewpointsOf(const Frontier& frontier, const ExplorationGrid& grid,
                                    const cv::Mat1b& standable, const cv::Mat1b& opaque,
                                    const std::vector<Eigen::Vector2i>& here,
                                    const ViewpointOptions& options) {
  const std::vector<Eigen::Vector2i> samples = samplesOf(frontier);
  std::vector<Viewpoint> views;
  const auto consider = [&](const Eigen::Vector2i& cell) {
    if (!grid.isInside(cell) || !standable(cell.y(), cell.x())) return;
    const Viewpoint view = lookFrom(grid, opaque, samples, cell, options);
    if (view.seen > 0.0) views.push_back(view);
  };
  for (const Eigen::Vector2i& cell : here) consider(cell);
  const int reach = static_cast<int>(options.farthest_m / grid.cell_m()) + 1;
  const Eigen::Vector2i middle = grid.cellOf(frontier.place_m);
  const auto first = [](int at) { return std::max(0, at - at % kStride); };
  for (int row = first(middle.y() - reach); row <= middle.y() + reach; row += kStride)
    for (int column = first(middle.x() - reach); column <= middle.x() + reach; column += kStride)
      consider({column, row});
  return views;
}

}  // namespace omnifleet::motion
