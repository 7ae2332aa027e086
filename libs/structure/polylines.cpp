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

/// Appends a cell to a stretch. At a single protruding cell the border returns to the cell before it at once;
/// the stretch does not.
void append(Stretch& stretch, const SurfaceCell* cell) {
  std::vector<const SurfaceCell*>& cells = stretch.cells;
  const bool is_return = cells.size() >= 2 && (cells.back() == cell || cells[cells.size() - 2] == cell);
  if (!is_return) cells.push_back(cell);
}

/// Splits a border where too many cells in a row have no ray ends.
std::vector<Stretch> stretchesOf(const Border& border, const SurfaceIndex& surface, int max_gap) {
  std::vector<Stretch> stretches(1);
  int missing = 0;
  for (const SurfaceCell* cell : cellsInOrder(border, surface)) {
    missing = cell == nullptr ? missing + 1 : 0;
    if (missing == max_gap + 1) stretches.emplace_back();
    if (cell != nullptr) append(stretches.back(), cell);
  }
  if (missing > max_gap) {
    stretches.pop_back();
  } else if (stretches.size() == 1) {
    stretches.front().is_ring = true;
  } else {  // the last stretch continues at the beginning
    for (const SurfaceCell* cell : stretches.front().cells) append(stretches.back(), cell);
    std::swap(stretches.front(), stretches.back());
    stretches.pop_back();
  }
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

Polyline polylineOf(const Stretch& stretch, bool is_island, const SurfaceMap& map,
                    const PolylineOptions& options) {
  Polyline line;
  line.points_m = detail::verticesOf(stretch, map, options);
  line.closed = stretch.is_ring && is_island && line.points_m.size() >= 3;
  if (stretch.is_ring && !line.closed && line.points_m.size() >= 3)
    line.points_m.push_back(line.points_m.front());
  std::vector<double> sigmas_m;
  std::vector<std::uint32_t> observations;
  for (const SurfaceCell* cell : stretch.cells) {
    sigmas_m.push_back(cell->sigma_m);
    observations.push_back(cell->observations);
    line.observers |= cell->observers;
  }
  line.sigma_m = medianOf(std::move(sigmas_m));
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
