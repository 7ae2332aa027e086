#include "structure/mirrors.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::structure {
namespace {

using Eigen::Vector2d;

struct Piece {
  Vector2d from, to;
  Vector2d along() const { return (to - from).normalized(); }
};

/// A gap with the free area that robots are in on its right side.
struct Gap {
  Vector2d from, along, back;  ///< `along` and `back` have length 1
  double width = 0.0;

  double behind(const Vector2d& p) const { return back.dot(p - from); }
  Vector2d image(const Vector2d& p) const { return p - 2.0 * behind(p) * back; }
};

class Search {
 public:
  Search(const SurfaceMap& map, const MirrorOptions& options) : map_(map), options_(options) {
    mean_of_.assign(map.cells.size(), -1);
    for (std::size_t i = 0; i < map.surface.size(); ++i)
      mean_of_[static_cast<std::size_t>(map.surface[i].x + map.surface[i].y * map.width)] =
          static_cast<int>(i);
  }

  std::vector<Gap> gaps() const;
  /// Free cells connected with the gap behind it, then the occupied cells beside them.
  struct Region {
    std::vector<int> free, occupied;
  };
  Region regionBehind(const Gap& gap) const;
  bool isMirrorImage(const Region& region, const Gap& gap) const;
  /// Whether a robot was behind the gap, in the region or next to it: cells under a robot that turns in place
  /// stay unknown.
  bool wasVisited(const Region& region, const Gap& gap, const std::vector<Vector2d>& robots_m,
                  double reach_m) const;

  Vector2d middleOf(int at) const {
    return map_.origin_m + map_.resolution_m * Vector2d(at % map_.width + 0.5, at / map_.width + 0.5);
  }

 private:
  Cell classAt(int at) const { return at < 0 ? Cell::kUnknown : map_.cells[static_cast<std::size_t>(at)]; }
  std::vector<Piece> pieces() const;
  /// Whether all cells within `reach` cells of a place have the class.
  bool isAllAround(const Vector2d& p, int reach, Cell wanted) const;
  bool isAnyAround(const Vector2d& p, int reach, Cell wanted) const;
  template <typename Visit>
  void forEachAround(int at, int reach, const Visit& visit) const;

  const SurfaceMap& map_;
  const MirrorOptions& options_;
  std::vector<int> mean_of_;
};

template <typename Visit>
void Search::forEachAround(int at, int reach, const Visit& visit) const {
  const int x = at % map_.width, y = at / map_.width;
  for (int v = std::max(0, y - reach); v <= std::min(map_.height - 1, y + reach); ++v)
    for (int u = std::max(0, x - reach); u <= std::min(map_.width - 1, x + reach); ++u)
      visit(u + v * map_.width);
}

bool Search::isAllAround(const Vector2d& p, int reach, Cell wanted) const {
  const int at = map_.indexAt(p);
  bool all = at >= 0;
  if (all) forEachAround(at, reach, [&](int other) { all = all && classAt(other) == wanted; });
  return all;
}

bool Search::isAnyAround(const Vector2d& p, int reach, Cell wanted) const {
  const int at = map_.indexAt(p);
  bool any = false;
  if (at >= 0) forEachAround(at, reach, [&](int other) { any = any || classAt(other) == wanted; });
  return any;
}

std::vector<Piece> Search::pieces() const {
  std::vector<Piece> pieces;
  for (const Polyline& line : polylinesOf(map_, {})) {
    const std::size_t points = line.points_m.size(), sides = line.closed ? points : points - 1;
    for (std::size_t i = 0; i < sides; ++i) {
      const Piece piece{line.points_m[i], line.points_m[(i + 1) % points]};
      if ((piece.to - piece.from).norm() >= options_.least_piece_m) pieces.push_back(piece);
    }
  }
  return pieces;
}

/// Free area is on the right side of each piece, so two pieces of one wall have one direction.
std::vector<Gap> Search::gaps() const {
  constexpr double kParallel = 0.9976;  // cosine of 4 degrees: a cell over the length of a short piece
  std::vector<Gap> gaps;
  const std::vector<Piece> all = pieces();
  for (const Piece& first : all) {
    const Vector2d along = first.along(), back(-along.y(), along.x());
    for (const Piece& second : all) {
      const double width = along.dot(second.from - first.to);
      if (width < options_.least_width_m || width > options_.greatest_width_m) continue;
      if (along.dot(second.along()) < kParallel) continue;
      if (std::abs(back.dot(second.from - first.to)) > map_.resolution_m) continue;
      const Vector2d joined = (second.from - first.to).normalized();
      const Gap gap{first.to, joined, Vector2d(-joined.y(), joined.x()), width};
      // Floor must be seen through most of the gap.
      int free = 0, steps = 0;
      for (double at = 0.5 * map_.resolution_m; at < width; at += map_.resolution_m, ++steps) {
        const Vector2d on = gap.from + at * gap.along;
        const bool before = map_.cellAt(on - map_.resolution_m * gap.back) == Cell::kFree,
                   after = map_.cellAt(on + map_.resolution_m * gap.back) == Cell::kFree;
        free += before && after ? 1 : 0;
      }
      if (2 * free > steps) gaps.push_back(gap);
    }
  }
  return gaps;
}

Search::Region Search::regionBehind(const Gap& gap) const {
  Region region;
  std::vector<std::uint8_t> taken(map_.cells.size(), 0);
  const auto take = [&](int at) {
    const Cell found = classAt(at);
    if (found == Cell::kUnknown || taken[static_cast<std::size_t>(at)] != 0) return;
    // Cells of the wall itself stay.
    if (gap.behind(middleOf(at)) <= (found == Cell::kFree ? 0.0 : map_.resolution_m)) return;
    taken[static_cast<std::size_t>(at)] = 1;
    (found == Cell::kFree ? region.free : region.occupied).push_back(at);
  };
  for (double at = 0.0; at <= gap.width; at += 0.5 * map_.resolution_m) {
    const int seed = map_.indexAt(gap.from + at * gap.along + map_.resolution_m * gap.back);
    if (classAt(seed) == Cell::kFree) take(seed);
  }
  for (std::size_t next = 0; next < region.free.size(); ++next) {
    const int at = region.free[next];
    forEachAround(at, 1, [&](int other) {
      const bool beside = other % map_.width == at % map_.width || other / map_.width == at / map_.width;
      if (beside || classAt(other) == Cell::kOccupied) take(other);
    });
  }
  // Corners touch only other occupied cells.
  for (std::size_t next = 0; next < region.occupied.size(); ++next)
    forEachAround(region.occupied[next], 1, [&](int other) {
      if (classAt(other) == Cell::kOccupied) take(other);
    });
  return region;
}

bool Search::wasVisited(const Region& region, const Gap& gap, const std::vector<Vector2d>& robots_m,
                        double reach_m) const {
  std::vector<std::uint8_t> visited(map_.cells.size(), 0);
  for (const Vector2d& robot : robots_m) {
    const int at = map_.indexAt(robot), reach = static_cast<int>(std::ceil(reach_m / map_.resolution_m));
    if (at < 0 || gap.behind(robot) <= 0.0) continue;
    forEachAround(at, reach, [&](int other) { visited[static_cast<std::size_t>(other)] = 1; });
  }
  return std::any_of(region.free.begin(), region.free.end(),
                     [&](int at) { return visited[static_cast<std::size_t>(at)] != 0; });
}

bool Search::isMirrorImage(const Region& region, const Gap& gap) const {
  constexpr int kReach = 2;
  constexpr double kSigmas = 3.0;
  int equal = 0, contradicting = 0;
  std::vector<std::uint8_t> taken(map_.cells.size(), 0);
  for (const int at : region.occupied) {
    const int mean = mean_of_[static_cast<std::size_t>(at)];
    const Vector2d p = mean < 0 ? middleOf(at) : map_.surface[static_cast<std::size_t>(mean)].mean_m;
    equal += isAnyAround(gap.image(p), kReach, Cell::kOccupied) ? 1 : 0;
    contradicting += isAllAround(gap.image(p), kReach, Cell::kFree) ? 1 : 0;
  }
  // What stands on this side must not be missing on the other one.
  for (const int at : region.free) {
    const int image = map_.indexAt(gap.image(middleOf(at)));
    if (image < 0 || classAt(image) != Cell::kOccupied || taken[static_cast<std::size_t>(image)] != 0)
      continue;
    taken[static_cast<std::size_t>(image)] = 1;
    contradicting += isAllAround(middleOf(at), kReach, Cell::kFree) ? 1 : 0;
  }
  const double compared = equal + contradicting, share = options_.contradicting_share;
  return contradicting <= share * compared + kSigmas * std::sqrt(share * (1.0 - share) * compared);
}

}  // namespace

MirrorOptions MirrorOptions::read(const options::Section& section) {
  MirrorOptions o;
  section.read("search", o.search);
  section.read("contradicting_share", o.contradicting_share, {0.0, 1.0});
  section.read("least_piece_m", o.least_piece_m, {0.05, 10.0});
  section.read("least_width_m", o.least_width_m, {0.05, 10.0});
  section.read("greatest_width_m", o.greatest_width_m, {0.05, 30.0});
  section.finish();
  return o;
}

void hideBehindMirrors(SurfaceMap& map, const std::vector<Vector2d>& robots_m, double reach_m,
                       const MirrorOptions& options) {
  map.mirrors.clear();
  map.mirrored.clear();
  if (!options.search || map.cells.empty()) return;
  std::vector<std::uint8_t> hidden(map.cells.size(), 0);
  {
    const Search search(map, options);
    for (const Gap& gap : search.gaps()) {
      const Search::Region region = search.regionBehind(gap);
      if (region.free.empty() || search.wasVisited(region, gap, robots_m, reach_m) ||
          !search.isMirrorImage(region, gap))
        continue;
      for (const auto* cells : {&region.free, &region.occupied})
        for (const int at : *cells) hidden[static_cast<std::size_t>(at)] = 1;
      map.mirrors.push_back({gap.from, gap.from + gap.width * gap.along});
    }
  }
  if (map.mirrors.empty()) return;
  for (std::size_t at = 0; at < hidden.size(); ++at)
    if (hidden[at] != 0) map.cells[at] = Cell::kUnknown;
  map.surface.erase(std::remove_if(map.surface.begin(), map.surface.end(),
                                   [&](const SurfaceCell& cell) {
                                     return hidden[static_cast<std::size_t>(cell.x + cell.y * map.width)] !=
                                            0;
                                   }),
                    map.surface.end());
  map.mirrored = std::move(hidden);
}

}  // namespace omnifleet::structure
