#include "occupancy/visible_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "occupancy/fixed_trig.h"

namespace omnifleet::occupancy {
namespace {

using structure::Cell;
using structure::SurfaceMap;

constexpr std::uint8_t kSolid = 1;    ///< counted as occupied
constexpr std::uint8_t kGap = 2;      ///< free or unknown in a narrow gap between occupied cells
constexpr std::uint8_t kSeen = 4;     ///< a ray or a robot reached it
constexpr std::uint8_t kReached = 8;  ///< a ray ended there first

constexpr std::int64_t kUnit = 10, kWeight = 1024;  // 1 mm: no ray end is known better

std::int64_t weightOf(std::int64_t sigma) {
  const std::int64_t s = std::max(sigma, kUnit);
  return std::max<std::int64_t>(1, kWeight * kUnit * kUnit / (s * s));
}

std::int64_t sigmaOf(const Contribution& seen, std::uint32_t i) {
  return i < seen.sigma_dmm.size() ? std::int64_t{seen.sigma_dmm[i]} : 0;
}

/// Weight of the ray ends in one cell, and their mean direction times weight.
struct Peak {
  std::int64_t weight = 0, x = 0, y = 0;
};

/// Ray ends in one cell. Positions in 0.1 mm relative to the corner of the map, weights relative to a σ of
/// 1 mm: integers, so that the sums do not depend on their order.
struct Ends {
  std::int64_t weight = 0, x = 0, y = 0;
  std::uint32_t rays = 0, keyframes = 0;
  std::int64_t last_keyframe = -1;
  std::uint64_t observers = 0;
};

class Canvas {
 public:
  Canvas(const CellCounts& counts, const OccupancyOptions& options)
      : limits_(rayLimitsOf(options)), resolution_(limits_.resolution) {
    constexpr std::int64_t kFar = std::int64_t{1} << 40U;
    std::int64_t x_high = -kFar, y_high = -kFar;
    x_low_ = y_low_ = kFar;
    counts.forEachKnown([&](std::int64_t x, std::int64_t y, CellClass) {
      x_low_ = std::min(x_low_, x), x_high = std::max(x_high, x);
      y_low_ = std::min(y_low_, y), y_high = std::max(y_high, y);
    });
    width_ = x_high - x_low_ + 1;
    height_ = y_high - y_low_ + 1;
    classes_.assign(static_cast<std::size_t>(width_ * height_), CellClass::kUnknown);
    marks_.assign(classes_.size(), 0);
    ends_index_.assign(classes_.size(), -1);
    counts.forEachKnown([&](std::int64_t x, std::int64_t y, CellClass now) {
      const auto at = static_cast<std::size_t>((y - y_low_) * width_ + x - x_low_);
      classes_[at] = now;
      if (now == CellClass::kOccupied) marks_[at] = kSolid;
    });
    peaks_.resize(classes_.size());
  }

  /// First for all contributions.
  void weigh(const Applied& what);
  /// Between weighing and drawing.
  void removeNoise(const OccupancyOptions& options);
  void draw(const Applied& what, std::int64_t keyframe, std::uint64_t observer);
  /// Robots see what they stand on.
  void drive(const Applied& what);
  SurfaceMap result(double resolution_m) const;

 private:
  void markGaps(int widest);
  template <typename Visit>
  void forEachRay(const Applied& what, const Visit& visit) const;
  void drawRay(const PointDmm& from, const Direction& along, const RayExtent& ray, std::int64_t sigma);
  void addEnd(std::size_t at, const PointDmm& end, std::int64_t sigma);

  RayLimits limits_;
  std::int64_t resolution_;
  std::int64_t x_low_, y_low_, width_ = 0, height_ = 0;
  std::vector<CellClass> classes_;
  std::vector<std::uint8_t> marks_;
  std::vector<Peak> peaks_;
  std::vector<std::int32_t> ends_index_;
  std::vector<Ends> ends_;
  std::int64_t keyframe_ = 0;
  std::uint64_t observer_ = 0;
};

/// Marks the cells between two occupied ones that are at most `widest` cells apart in a row, a column or a
/// diagonal.
void Canvas::markGaps(int widest) {
  constexpr std::array<std::pair<int, int>, 4> kDirections{{{1, 0}, {0, 1}, {1, 1}, {1, -1}}};
  for (std::int64_t y = 0; y < height_; ++y) {
    for (std::int64_t x = 0; x < width_; ++x) {
      if ((marks_[static_cast<std::size_t>(y * width_ + x)] & kSolid) == 0) continue;
      for (const auto& [dx, dy] : kDirections) {
        int other = 1;
        const auto isSolid = [&](int k) {
          const std::int64_t u = x + k * dx, v = y + k * dy;
          return u >= 0 && u < width_ && v >= 0 && v < height_ &&
                 (marks_[static_cast<std::size_t>(v * width_ + u)] & kSolid) != 0;
        };
        while (other <= widest + 1 && !isSolid(other)) ++other;
        if (other > widest + 1) continue;
        for (int k = 1; k < other; ++k)
          marks_[static_cast<std::size_t>((y + k * dy) * width_ + x + k * dx)] |= kGap;
      }
    }
  }
}

/// Calls visit(origin, direction, extent, σ) for each ray that has an effect.
template <typename Visit>
void Canvas::forEachRay(const Applied& what, const Visit& visit) const {
  const Contribution& seen = *what.contribution;
  const PointDmm origin = scanOrigin(seen, what.at);
  const Turn heading = turnFromDmrad(what.at.theta_dmrad);
  const auto count = static_cast<std::uint32_t>(what.roles.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    if (what.roles[i] == RayRole::kNone) continue;
    visit(origin, directionOf(heading + turnOfBearing(i, count)),
          extentOf(seen, i, what.roles[i], limits_, what.cuts), sigmaOf(seen, i));
  }
}

void Canvas::weigh(const Applied& what) {
  forEachRay(
      what, [this](const PointDmm& origin, const Direction& along, const RayExtent& ray, std::int64_t sigma) {
        if (ray.role != RayRole::kHit) return;
        const std::int64_t x = floorDivide(origin.x_dmm + roundQ30(ray.range * along.cos_q30), resolution_) -
                               x_low_,
                           y = floorDivide(origin.y_dmm + roundQ30(ray.range * along.sin_q30), resolution_) -
                               y_low_;
        if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
        Peak& peak = peaks_[static_cast<std::size_t>(y * width_ + x)];
        const std::int64_t weight = weightOf(sigma);
        peak.weight += weight;
        peak.x += weight * (along.cos_q30 >> 20);
        peak.y += weight * (along.sin_q30 >> 20);
      });
}

/// A surface has ray ends in the cells before and behind it, too: their σ may be as large as half a cell. An
/// occupied cell with a small share of the ends in it and in the next one along the rays is no surface of its
/// own.
void Canvas::removeNoise(const OccupancyOptions& options) {
  std::vector<std::size_t> noise;
  const auto isNoiseOf = [&](std::size_t at, std::int64_t x, std::int64_t y) {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return false;
    const auto other = static_cast<std::size_t>(y * width_ + x);
    if (classes_[other] != CellClass::kOccupied) return false;
    const auto weight = static_cast<double>(peaks_[at].weight);
    return weight < options.least_share * (weight + static_cast<double>(peaks_[other].weight));
  };
  for (std::size_t at = 0; at < classes_.size(); ++at) {
    if (classes_[at] != CellClass::kOccupied || peaks_[at].weight == 0) continue;
    const Peak& peak = peaks_[at];
    const std::int64_t longest = std::max(std::abs(peak.x), std::abs(peak.y));
    if (longest == 0) continue;
    const auto step = [&](std::int64_t part) {
      return (2 * std::abs(part) >= longest ? 1 : 0) * (part < 0 ? -1 : 1);
    };
    const std::int64_t x = static_cast<std::int64_t>(at) % width_, y = static_cast<std::int64_t>(at) / width_;
    if (isNoiseOf(at, x + step(peak.x), y + step(peak.y)) ||
        isNoiseOf(at, x - step(peak.x), y - step(peak.y)))
      noise.push_back(at);
  }
  for (const std::size_t at : noise) {
    classes_[at] = CellClass::kUnknown;
    marks_[at] = 0;
  }
  markGaps(static_cast<int>(options.least_gap_m / options.resolution_m + 1e-9));
}

void Canvas::addEnd(std::size_t at, const PointDmm& end, std::int64_t sigma) {
  std::int32_t& index = ends_index_[at];
  if (index < 0) {
    index = static_cast<std::int32_t>(ends_.size());
    ends_.emplace_back();
  }
  Ends& ends = ends_[static_cast<std::size_t>(index)];
  const std::int64_t weight = weightOf(sigma);
  ends.weight += weight;
  ends.x += weight * (end.x_dmm - x_low_ * resolution_);
  ends.y += weight * (end.y_dmm - y_low_ * resolution_);
  ++ends.rays;
  if (ends.last_keyframe != keyframe_) ++ends.keyframes;
  ends.last_keyframe = keyframe_;
  ends.observers |= observer_;
}

/// Walks over the cells of a ray up to its end, and one cell farther if it ends at a surface.
void Canvas::drawRay(const PointDmm& from, const Direction& along, const RayExtent& ray, std::int64_t sigma) {
  const bool is_hit = ray.role == RayRole::kHit;
  const auto pointAt = [&](std::int64_t length) {
    return PointDmm{static_cast<std::int32_t>(from.x_dmm + roundQ30(length * along.cos_q30)),
                    static_cast<std::int32_t>(from.y_dmm + roundQ30(length * along.sin_q30))};
  };
  const PointDmm end = pointAt(ray.range), to = pointAt(is_hit ? ray.range + resolution_ : ray.range),
                 free_end = pointAt(ray.range - ray.free);
  const auto cellOf = [&](const PointDmm& p) {
    return std::pair{floorDivide(p.x_dmm, resolution_) - x_low_, floorDivide(p.y_dmm, resolution_) - y_low_};
  };
  const auto [end_x, end_y] = cellOf(end);
  const auto [free_x, free_y] = cellOf(free_end);
  auto [x, y] = cellOf(from);
  const auto [to_x, to_y] = cellOf(to);
  const std::int64_t dx = std::abs(std::int64_t{to.x_dmm} - from.x_dmm),
                     dy = std::abs(std::int64_t{to.y_dmm} - from.y_dmm);
  const std::int64_t step_x = to.x_dmm >= from.x_dmm ? 1 : -1, step_y = to.y_dmm >= from.y_dmm ? 1 : -1;
  const std::int64_t in_x = from.x_dmm - (x + x_low_) * resolution_,
                     in_y = from.y_dmm - (y + y_low_) * resolution_;
  std::int64_t next_x = (step_x > 0 ? resolution_ - in_x : in_x + 1) * dy,
               next_y = (step_y > 0 ? resolution_ - in_y : in_y + 1) * dx;
  const std::int64_t steps = std::abs(to_x - x) + std::abs(to_y - y);
  bool sees_floor = true, in_gap = false, has_entered = false;  // the known cells
  int since_free = 2;  // cells since the last one that is counted as free
  const auto advance = [&] {
    const bool across_x = next_x < next_y;
    x += across_x ? step_x : 0;
    y += across_x ? 0 : step_y;
    next_x += across_x ? resolution_ * dy : 0;
    next_y += across_x ? 0 : resolution_ * dx;
  };
  for (std::int64_t i = 0; i <= steps; ++i, advance()) {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) {
      if (has_entered) return;
      continue;
    }
    has_entered = true;
    const auto at = static_cast<std::size_t>(y * width_ + x);
    std::uint8_t& mark = marks_[at];
    if ((mark & kSolid) != 0) {
      if (is_hit && (ray.at_floor || since_free < 2) && std::abs(x - end_x) <= 1 &&
          std::abs(y - end_y) <= 1) {
        mark |= kReached;
        addEnd(at, end, sigma);
      }
      return;
    }
    since_free = classes_[at] == CellClass::kFree ? 0 : since_free + 1;
    const bool is_gap = (mark & kGap) != 0;
    if (in_gap && !is_gap) sees_floor = false;  // through a gap
    in_gap = is_gap;
    const bool is_end = x == free_x && y == free_y;
    if (sees_floor && (!is_end || ray.role == RayRole::kFree)) mark |= kSeen;
    if (is_end) sees_floor = false;
  }
}

void Canvas::draw(const Applied& what, std::int64_t keyframe, std::uint64_t observer) {
  keyframe_ = keyframe;
  observer_ = observer;
  forEachRay(what, [this](const PointDmm& origin, const Direction& along, const RayExtent& ray,
                          std::int64_t sigma) { drawRay(origin, along, ray, sigma); });
}

void Canvas::drive(const Applied& what) {
  if (what.body == nullptr) return;
  forEachCovered(*what.body, what.at, what.body_margin_dmm, resolution_,
                 [this](std::int64_t x, std::int64_t y) {
                   if (x < x_low_ || y < y_low_ || x >= x_low_ + width_ || y >= y_low_ + height_) return;
                   marks_[static_cast<std::size_t>((y - y_low_) * width_ + x - x_low_)] |= kSeen;
                 });
}

SurfaceMap Canvas::result(double resolution_m) const {
  SurfaceMap map;
  map.resolution_m = resolution_m;
  map.origin_m = resolution_m * Eigen::Vector2d(static_cast<double>(x_low_), static_cast<double>(y_low_));
  map.width = static_cast<int>(width_);
  map.height = static_cast<int>(height_);
  map.cells.assign(classes_.size(), Cell::kUnknown);
  for (std::size_t at = 0; at < classes_.size(); ++at) {
    if (classes_[at] == CellClass::kOccupied && (marks_[at] & kReached) != 0) map.cells[at] = Cell::kOccupied;
    if (classes_[at] == CellClass::kFree && (marks_[at] & kSeen) != 0) map.cells[at] = Cell::kFree;
    if (map.cells[at] != Cell::kOccupied || ends_index_[at] < 0) continue;
    const Ends& ends = ends_[static_cast<std::size_t>(ends_index_[at])];
    const auto weight = static_cast<double>(ends.weight);
    structure::SurfaceCell cell;
    cell.x = static_cast<int>(at % static_cast<std::size_t>(width_));
    cell.y = static_cast<int>(at / static_cast<std::size_t>(width_));
    cell.mean_m = map.origin_m + Eigen::Vector2d(static_cast<double>(ends.x), static_cast<double>(ends.y)) /
                                     (weight * kDmmPerMetre);
    // The ends of one keyframe share its error: only keyframes are independent.
    const double of_one_m = static_cast<double>(kUnit) / kDmmPerMetre *
                            std::sqrt(static_cast<double>(kWeight) * ends.rays / weight);
    cell.sigma_m = of_one_m / std::sqrt(static_cast<double>(ends.keyframes));
    cell.observations = ends.keyframes;
    cell.observers = ends.observers;
    map.surface.push_back(cell);
  }
  return map;
}

/// Sector of the heading in which a scan looks, if it sees less than half of its surroundings: a forward
/// camera that turns in place sees something else in each. Of other scans 0.
std::uint32_t sectorOf(const Applied& what) {
  constexpr unsigned kBits = 4;  // sectors of 22.5°, a quarter of what a camera of 90° sees
  const std::vector<RayLabel>& labels = what.contribution->label;
  const auto unseen = std::count(labels.begin(), labels.end(), RayLabel::kInvalid);
  if (2 * static_cast<std::size_t>(unseen) <= labels.size()) return 0;
  return 1 + (turnFromDmrad(what.at.theta_dmrad) >> (32U - kBits));
}

/// Keyframes that are drawn: of each robot the latest three per square of four cells (0.2 m), and per sector
/// of the heading where the scan looks one way only.
std::vector<const AppliedSet::value_type*> chosen(const AppliedSet& applied, std::int64_t resolution) {
  constexpr int kPerSquare = 3, kCells = 4;
  std::map<std::tuple<std::string, std::int64_t, std::int64_t, std::uint32_t>, int> taken;
  std::vector<const AppliedSet::value_type*> some;
  for (auto entry = applied.rbegin(); entry != applied.rend(); ++entry) {
    const PointDmm origin = scanOrigin(*entry->second.contribution, entry->second.at);
    int& count = taken[{entry->first.first, floorDivide(origin.x_dmm, kCells * resolution),
                        floorDivide(origin.y_dmm, kCells * resolution), sectorOf(entry->second)}];
    if (count++ < kPerSquare) some.push_back(&*entry);
  }
  return some;
}

}  // namespace

SurfaceMap visibleMap(const CellCounts& counts, const AppliedSet& applied, const OccupancyOptions& options) {
  if (counts.known() == 0) return {};
  Canvas canvas(counts, options);
  std::map<std::string, std::uint64_t> bits;
  for (const auto& [key, what] : applied) bits.emplace(key.first, std::uint64_t{1} << (bits.size() % 64U));
  const auto keyframes = chosen(applied, std::llround(options.resolution_m * kDmmPerMetre));
  for (const auto* entry : keyframes) canvas.weigh(entry->second);
  canvas.removeNoise(options);
  std::int64_t keyframe = 0;
  for (const auto* entry : keyframes) canvas.draw(entry->second, keyframe++, bits.at(entry->first.first));
  for (const auto& [key, what] : applied) canvas.drive(what);
  SurfaceMap map = canvas.result(options.resolution_m);
  for (const auto& [robot, bit] : bits) map.robots.push_back(robot);
  return map;
}

}  // namespace omnifleet::occupancy
