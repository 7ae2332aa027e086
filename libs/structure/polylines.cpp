#include "structure/polylines.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "geometry/polygon.h"
#include "structure/border.h"
#include "structure/line_pieces.h"

namespace omnifleet::structure {
namespace {

using detail::Border;
using detail::Stretch;

/// Entries of `surface` by cell.
class SurfaceIndex {
 public:
  explicit SurfaceIndex(const SurfaceMap& map) : entries_(map.cells.size(), nullptr) {
    for (const SurfaceCell& cell : map.surface) {
      if (cell.x < 0 || cell.x >= map.width || cell.y < 0 || cell.y >= map.height) continue;
      const auto at = static_cast<std::size_t>(cell.x + cell.y * map.width);
      if (map.cells[at] == Cell::kOccupied && cell.mean_m.allFinite()) entries_[at] = &cell;
    }
  }

  /// nullptr: no ray ends in the cell.
  const SurfaceCell* at(int cell) const {
    return cell == detail::kOutside ? nullptr : entries_[static_cast<std::size_t>(cell)];
  }

 private:
  std::vector<const SurfaceCell*> entries_;
};

/// The cells of a border, beginning with the lowest one that has ray ends; empty if none has.
std::vector<const SurfaceCell*> cellsInOrder(const Border& border, const SurfaceIndex& surface) {
  std::vector<const SurfaceCell*> cells;
  std::size_t start = border.cells.size();
  for (std::size_t i = 0; i < border.cells.size(); ++i) {
    cells.push_back(surface.at(border.cells[i]));
    if (cells.back() != nullptr && (start == border.cells.size() || border.cells[i] < border.cells[start]))
      start = i;
  }
  if (start == border.cells.size()) return {};
  std::rotate(cells.begin(), cells.begin() + static_cast<std::ptrdiff_t>(start), cells.end());
  return cells;
}

/// Cells in order along a border, without immediate returns. Around a corner or a single protruding cell, the
/// border passes by a cell twice, before and after the protruding cell. The stretch has it once, in the order
/// that gives the shorter line.
class StretchCells {
 public:
  void append(const SurfaceCell* cell) {
    const std::size_t size = cells_.size();
    if (size >= 1 && cells_.back() == cell) return;
    if (size >= 2 && cells_[size - 2] == cell) {
      has_returned_ = true;
      return;
    }
    if (has_returned_ && size >= 3) {
      const SurfaceCell *before = cells_[size - 3], *&twice = cells_[size - 2], *&between = cells_[size - 1];
      const double as_met = distance(before, twice) + distance(between, cell);
      if (distance(before, between) + distance(twice, cell) < as_met - kNegligible_m)
        std::swap(twice, between);
    }
    has_returned_ = false;
    cells_.push_back(cell);
  }
  const std::vector<const SurfaceCell*>& cells() const { return cells_; }

 private:
  static constexpr double kNegligible_m = 1e-9;
  static double distance(const SurfaceCell* a, const SurfaceCell* b) {
    return (a->mean_m - b->mean_m).norm();
  }

  std::vector<const SurfaceCell*> cells_;
  bool has_returned_ = false;
};

/// Joins the ends of a ring: removes immediate returns there too. The lowest cell remains the first.
std::vector<const SurfaceCell*> ringOf(std::vector<const SurfaceCell*> cells) {
  const SurfaceCell* lowest = cells.front();
  std::rotate(cells.begin(), cells.begin() + static_cast<std::ptrdiff_t>(cells.size() / 2), cells.end());
  StretchCells joined;
  for (const SurfaceCell* cell : cells) joined.append(cell);
  cells = joined.cells();
  if (cells.size() > 1 && cells.back() == cells.front()) cells.pop_back();
  std::rotate(cells.begin(), std::find(cells.begin(), cells.end(), lowest), cells.end());
  return cells;
}

/// Splits a border where too many cells in a row have no ray ends.
std::vector<Stretch> stretchesOf(const Border& border, const SurfaceIndex& surface, int max_gap) {
  std::vector<StretchCells> parts(1);
  int missing = 0;
  for (const SurfaceCell* cell : cellsInOrder(border, surface)) {
    missing = cell == nullptr ? missing + 1 : 0;
    if (missing == max_gap + 1) parts.emplace_back();
    if (cell != nullptr) parts.back().append(cell);
  }
  if (parts.size() == 1) {
    if (parts.front().cells().empty()) return {};
    return {Stretch{ringOf(parts.front().cells()), true}};
  }
  if (missing <= max_gap) {  // the last part continues at the beginning
    for (const SurfaceCell* cell : parts.front().cells()) parts.back().append(cell);
    std::swap(parts.front(), parts.back());
  }
  parts.pop_back();
  std::vector<Stretch> stretches;
  for (const StretchCells& part : parts) stretches.push_back({part.cells(), false});
  return stretches;
}

/// Mean distance between the two long sides of a ring.
double thicknessOf(const Stretch& ring) {
  Polygon polygon;
  double length = 0.0;
  for (const SurfaceCell* cell : ring.cells) {
    if (!polygon.empty()) length += (cell->mean_m - polygon.back()).norm();
    polygon.push_back(cell->mean_m);
  }
  length += (polygon.front() - polygon.back()).norm();
  return length > 0.0 ? 2.0 * std::abs(signedArea(polygon)) / length : 0.0;
}

std::size_t farthestFrom(std::size_t from, const std::vector<const SurfaceCell*>& cells) {
  std::size_t farthest = from;
  double most = 0.0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const double distance = (cells[i]->mean_m - cells[from]->mean_m).squaredNorm();
    if (distance > most) most = distance, farthest = i;
  }
  return farthest;
}

/// The longer one of the two sides between the ends of a thin ring.
Stretch sideOf(const Stretch& ring) {
  const std::size_t a = farthestFrom(0, ring.cells), b = farthestFrom(a, ring.cells),
                    size = ring.cells.size();
  const std::size_t beyond = (b + size - a) % size;
  Stretch side;
  const bool is_first_longer = 2 * beyond >= size;
  const std::size_t from = is_first_longer ? a : b, steps = is_first_longer ? beyond : size - beyond;
  for (std::size_t i = 0; i <= steps; ++i) side.cells.push_back(ring.cells[(from + i) % size]);
  return side;
}

template <typename T>
T medianOf(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double distanceTo(const Polyline& line, const Eigen::Vector2d& p) {
  const std::size_t points = line.points_m.size(), sides = line.closed ? points : points - 1;
  double least = points == 0 ? 0.0 : (line.points_m.front() - p).norm();
  for (std::size_t i = 0; points > 0 && i < sides; ++i) {
    const Eigen::Vector2d& a = line.points_m[i];
    const Eigen::Vector2d along = line.points_m[(i + 1) % points] - a;
    const double share = std::clamp((p - a).dot(along) / std::max(1e-12, along.squaredNorm()), 0.0, 1.0);
    least = std::min(least, (a + share * along - p).norm());
  }
  return least;
}

Polyline polylineOf(const Stretch& stretch, bool is_island, const SurfaceMap& map,
                    const PolylineOptions& options) {
  Polyline line;
  line.points_m = detail::verticesOf(stretch, map, options);
  line.closed = stretch.is_ring && is_island && line.points_m.size() >= 3;
  if (stretch.is_ring && !line.closed && line.points_m.size() >= 3)
    line.points_m.push_back(line.points_m.front());
  std::vector<double> sigmas_m, offsets_m;
  std::vector<std::uint32_t> observations;
  for (const SurfaceCell* cell : stretch.cells) {
    sigmas_m.push_back(cell->sigma_m);
    offsets_m.push_back(distanceTo(line, cell->mean_m));
    observations.push_back(cell->observations);
    line.observers |= cell->observers;
  }
  constexpr double kNormal = 1.4826;  // σ of a normal distribution ÷ median of the absolute values
  line.sigma_m = std::hypot(medianOf(std::move(sigmas_m)), kNormal * medianOf(std::move(offsets_m)));
  line.observations = medianOf(std::move(observations));
  return line;
}

}  // namespace

PolylineOptions PolylineOptions::read(const options::Section& section) {
  PolylineOptions o;
  section.read("tolerance_m", o.tolerance_m, {0.001, 1.0});
  section.read("tolerance_sigmas", o.tolerance_sigmas, {0.0, 10.0});
  section.read("least_cells", o.least_cells, {2, 1000});
  section.read("max_gap_cells", o.max_gap_cells, {0, 10});
  section.read("least_free_cells", o.least_free_cells, {1, 10000});
  section.finish();
  return o;
}

std::vector<Polyline> polylinesOf(const SurfaceMap& map, const PolylineOptions& options) {
  const SurfaceIndex surface(map);
  std::vector<std::pair<int, Polyline>> lines;  // with the first cell
  for (const Border& border : detail::bordersOf(map)) {
    if (border.area < 0 && -border.area < options.least_free_cells) continue;
    for (Stretch& stretch : stretchesOf(border, surface, options.max_gap_cells)) {
      if (static_cast<int>(stretch.cells.size()) < options.least_cells) continue;
      if (stretch.is_ring && thicknessOf(stretch) < 0.5 * options.tolerance_m) stretch = sideOf(stretch);
      const SurfaceCell& first = *stretch.cells.front();
      Polyline line = polylineOf(stretch, border.area > 0, map, options);
      if (line.points_m.size() >= 2) lines.emplace_back(first.x + first.y * map.width, std::move(line));
    }
  }
  std::stable_sort(lines.begin(), lines.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Polyline> result;
  for (auto& [first, line] : lines) result.push_back(std::move(line));
  return result;
}

}  // namespace omnifleet::structure
