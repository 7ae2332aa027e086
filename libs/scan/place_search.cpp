#include "scan/place_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

namespace omnifleet::scan {
namespace {

constexpr int kUnit = PlaceGrid::kUnit;
constexpr int kBlock = 30;               // beams between two tests whether a node can still reach the cut
constexpr double kReferenceShare = 0.9;  // of the beams, that the steps of heading suit
constexpr int kGroups = 4;
constexpr double kGroupRanges[kGroups] = {0.5, 1.0, 2.0, 3.0};  // reference ranges, longest beam
constexpr double kWidestHeading = 0.05;                         // rad
constexpr int kMostHeadings = 8192;
constexpr double kFarthest = 1e6;  // cells from the corner of the grid to a start
constexpr double kNearEnd = 2.0;   // cells at both ends of a beam that may lie in a surface
constexpr float kProbeBonus = 0.1f;
constexpr std::size_t kProbes = 20;
constexpr int kStride = 6;  // number of the window that a beam crosses at once without a surface in it
constexpr double kHalfStride = 4.0;  // cells
constexpr int kClimb = 2, kMostClimbs = 100;

/// Σ v and its weights, in units of 1/kUnit.
struct Sum {
  int value = 0, weight = 0;
};

/// The beams that take part: ends in the scan's frame in cells. The near ones come first. Within each group
/// the order is scattered, so that any first part of the beams stands for all of them.
struct Beams {
  std::vector<Eigen::Vector2d> ends;
  std::array<int, kGroups> groups{};  ///< end of each group
  double reference = 0.0;             ///< range, cells

  Beams(const LineScan& scan, const PlaceSearchOptions& o, double cell_m) {
    std::vector<Eigen::Vector2d> all;
    std::vector<double> ranges;
    for (std::size_t i = 0; i < scan.beams().size(); ++i) {
      if (!PlaceGrid::usable(scan.beams()[i], o.max_range_m, cell_m)) continue;
      ranges.push_back(1.0 / (static_cast<double>(scan.beams()[i].s) * cell_m));
      all.emplace_back(ranges.back() * scan.bearings()[i].cast<double>());
    }
    if (static_cast<int>(all.size()) < o.min_beams) return;
    const auto rank = static_cast<std::ptrdiff_t>(kReferenceShare * static_cast<double>(ranges.size() - 1));
    std::nth_element(ranges.begin(), ranges.begin() + rank, ranges.end());
    reference = std::max(1.0, ranges[static_cast<std::size_t>(rank)]);
    const std::size_t n = std::min(all.size(), static_cast<std::size_t>(o.beams));
    std::size_t step = std::max<std::size_t>(1, n * 5 / 8);
    while (std::gcd(step, n) != 1) ++step;
    double least = -1.0;
    for (std::size_t group = 0; group < kGroups; ++group) {
      const double most = kGroupRanges[group] * reference;
      for (std::size_t k = 0; k < n; ++k) {
        const Eigen::Vector2d& end = all[(k * step % n) * all.size() / n];
        if (end.norm() > least && end.norm() <= most) ends.push_back(end);
      }
      groups[group] = static_cast<int>(ends.size());
      least = most;
    }
  }
};

/// A beam's end for one heading, in cells of the grid from that of the start.
struct Cell {
  std::int16_t x, y;
};

struct Node {
  float score;           ///< upper bound; of a leaf: without passed surfaces, or exact
  std::int32_t x, y;     ///< steps from the start; the node covers [x, x + 2^level), likewise y
  std::int16_t heading;  ///< in units of 2^level headings
  std::int8_t level;
  bool exact;
};

/// The order of a heap: total, so that the search is deterministic.
struct Worse {
  float bonus;  ///< per level below the top
  bool operator()(const Node& a, const Node& b) const {
    const float first = a.score - bonus * static_cast<float>(a.level),
                second = b.score - bonus * static_cast<float>(b.level);
    if (first != second) return first < second;
    if (a.level != b.level) return a.level > b.level;
    if (a.exact != b.exact) return b.exact;
    if (a.heading != b.heading) return a.heading > b.heading;
    return a.y != b.y ? a.y > b.y : a.x > b.x;
  }
};

class Tree {
 public:
  Tree(const PlaceGrid& grid, const PlaceSearchOptions& options, const Beams& beams, const Pose2& start,
       double reach_m, double reach_rad)
      : grid_(grid), o_(options), beams_(beams), start_(start), reach_(reach_m / grid.cell()) {
    makeTable();
    step_rad_ = std::clamp(1.0 / beams.reference, 2.0 * M_PI / kMostHeadings, kWidestHeading);
    headings_ = static_cast<int>(std::ceil(2.0 * M_PI / step_rad_));
    step_rad_ = 2.0 * M_PI / headings_;
    full_circle_ = reach_rad + 0.5 * step_rad_ >= M_PI;
    if (!full_circle_) headings_ = 2 * static_cast<int>(reach_rad / step_rad_) + 1;
    origin_ = grid.inCells(start.translation());
    origin_cell_ = origin_.array().floor().cast<int>();
  }

  double headingStep() const { return step_rad_; }

  std::vector<PlaceCandidate> search() {
    turnBeams(o_.levels);
    cut_ = static_cast<float>(o_.min_score);
    addRoots();
    probe();
    while (!queue_.empty() && static_cast<int>(found_.size()) < o_.most) {
      if (nodes_ > o_.max_nodes) return {};
      const Node node = pop();
      if (node.score < cut_) break;
      if (isSuppressed(node)) continue;
      if (node.level > 0)
        branch(node);
      else if (!node.exact)
        push(withPassed(node));
      else
        accept(node);
    }
    return found_;
  }

  /// At the start itself.
  PlaceCandidate evaluateStart() {
    headings_ = 1;
    turnBeams(1);
    if (!isPossible(0, 0, 0)) return candidate({0.0f, 0, 0, 0, 0, true});
    return candidate(withPassed({exactScore(0, 0, 0), 0, 0, 0, 0, false}));
  }

 private:
  struct Zone {
    Pose2 pose;
    double m, rad;
  };

  void makeTable() {
    const int unknown = static_cast<int>(std::lround(o_.unknown_weight * kUnit));
    for (int code = 0; code < 256; ++code) {
      const bool known = code >= PlaceGrid::kKnown;
      const int value = known ? code - PlaceGrid::kZero : code,
                weight = known ? kUnit : std::max(code, unknown);
      table_[static_cast<std::size_t>(code)] = value * 65536 + weight;
    }
  }

  double heading(double h) const { return (h - headings_ / 2) * step_rad_; }
  const Cell* cellsOf(int level, int h) const {
    return cells_.data() +
           (first_[static_cast<std::size_t>(level)] + static_cast<std::size_t>(h)) * beams_.ends.size();
  }

  /// Ends of all beams for the middle heading of each node.
  void turnBeams(int levels) {
    cells_.clear();
    const Eigen::Vector2d within = origin_ - origin_cell_.cast<double>();
    std::size_t count = 0;
    for (int level = 0; level < levels; ++level) {
      first_.push_back(count);
      for (int h = 0; h << level < headings_; ++h, ++count) {
        const double angle = start_.theta_rad + heading((h << level) + 0.5 * ((1 << level) - 1));
        const double c = std::cos(angle), s = std::sin(angle);
        for (const Eigen::Vector2d& end : beams_.ends)
          cells_.push_back({toCell(within.x() + c * end.x() - s * end.y()),
                            toCell(within.y() + s * end.x() + c * end.y())});
      }
    }
  }

  static std::int16_t toCell(double value) {
    return static_cast<std::int16_t>(std::clamp(std::floor(value), -32000.0, 32000.0));
  }

  /// Sums over the beams [from, to) at one level of the grid. kInside: all of them end in the grid.
  template <bool kInside>
  Sum sumBeams(const Cell* from, const Cell* to, const std::uint8_t* codes, int x, int y) const {
    const auto width = static_cast<int>(grid_.width()), height = static_cast<int>(grid_.height());
    std::int32_t packed = 0;
    for (const Cell* cell = from; cell != to; ++cell) {
      const int cx = cell->x + x, cy = cell->y + y;
      const bool inside = kInside || (static_cast<unsigned>(cx) < static_cast<unsigned>(width) &&
                                      static_cast<unsigned>(cy) < static_cast<unsigned>(height));
      packed += table_[inside ? codes[cy * width + cx] : 0];
    }
    const int weight = packed & 0xffff;
    return {(packed - weight) / 65536, weight};
  }

  struct Window {
    int number, shift;
  };
  /// The window that covers all cells in which a beam of the group ends, for all leaves of a node.
  static Window windowOf(int level, int group) {
    if (level == 0) return {0, 0};
    const int size = 1 << level, number = 2 * level;
    if (group == 0 && level > 1) return {number + 1, size / 4};  // 3/2 · 2^level cells
    if (group <= 1) return {number + 2, size / 2};
    return group == 2 ? Window{number + 3, size} : Window{number + 4, 3 * size / 2};
  }

  /// Ends early if the score cannot reach the cut.
  Sum sumUp(int level, int h, int x, int y) const {
    const Cell* cells = cellsOf(level, h);
    const auto n = static_cast<int>(beams_.ends.size());
    Sum sum;
    int from = 0;
    for (int group = 0; group < kGroups; ++group) {
      const Window window = windowOf(level, group);
      const std::uint8_t* codes = grid_.codes(window.number);
      for (const int end = beams_.groups[static_cast<std::size_t>(group)]; from < end;) {
        const int to = std::min(end, from + kBlock);
        const Sum part = sumBeams<false>(cells + from, cells + to, codes, x + origin_cell_.x() - window.shift,
                                         y + origin_cell_.y() - window.shift);
        sum.value += part.value;
        sum.weight += part.weight;
        from = to;
        const int rest = (n - to) * kUnit;
        if (to < n && score({sum.value + rest, sum.weight + rest}) < cut_) return {};
      }
    }
    return sum;
  }

  float score(const Sum& sum) const { return static_cast<float>(sum.value) / static_cast<float>(sum.weight); }
  float exactScore(int h, int x, int y) const { return score(sumUp(0, h, x, y)); }

  void push(const Node& node) {
    if (node.score < cut_ || !(node.score > 0)) return;
    queue_.push_back(node);
    std::push_heap(queue_.begin(), queue_.end(), Worse{bonus_});
  }

  Node pop() {
    std::pop_heap(queue_.begin(), queue_.end(), Worse{bonus_});
    const Node node = queue_.back();
    queue_.pop_back();
    return node;
  }

  /// Visits deep nodes first to find some good leaves: the cut rises early. No node is lost.
  void probe() {
    bonus_ = kProbeBonus;
    std::make_heap(queue_.begin(), queue_.end(), Worse{bonus_});
    std::vector<Node> leaves;
    while (!queue_.empty() && leaves.size() < kProbes && nodes_ <= o_.max_nodes) {
      const Node node = pop();
      if (node.level > 0) {
        branch(node);
        continue;
      }
      leaves.push_back(withPassed(node));
      cut_ = std::max(cut_, leaves.back().score - static_cast<float>(o_.margin));
    }
    bonus_ = 0.0f;
    queue_.insert(queue_.end(), leaves.begin(), leaves.end());
    queue_.erase(std::remove_if(queue_.begin(), queue_.end(), [&](const Node& n) { return n.score < cut_; }),
                 queue_.end());
    std::make_heap(queue_.begin(), queue_.end(), Worse{bonus_});
  }

  /// True if some leaf of the node lies within reach, and in space that some reference saw as free.
  bool isPossible(int level, int x, int y) const {
    if (!grid_.hasFree(level, x + origin_cell_.x(), y + origin_cell_.y())) return false;
    const int last = (1 << level) - 1;
    const double dx = std::max({0, x, -(x + last)}), dy = std::max({0, y, -(y + last)});
    return dx * dx + dy * dy <= reach_ * reach_;
  }

  void add(int level, int h, int x, int y) {
    if (h << level >= headings_ || !isPossible(level, x, y)) return;
    ++nodes_;
    push({score(sumUp(level, h, x, y)), x, y, static_cast<std::int16_t>(h), static_cast<std::int8_t>(level),
          false});
  }

  void addRoots() {
    const int level = o_.levels - 1;
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(reach_);
    const Eigen::Vector2d low = (grid_.low().cast<double>() - origin_).cwiseMax(-reach),
                          high = (grid_.high().cast<double>() - origin_).cwiseMin(reach);
    for (int h = 0; h << level < headings_; ++h)
      for (int y = static_cast<int>(std::floor(low.y())); y <= high.y(); y += 1 << level)
        for (int x = static_cast<int>(std::floor(low.x())); x <= high.x(); x += 1 << level)
          add(level, h, x, y);
  }

  void branch(const Node& node) {
    const int level = node.level - 1, half = 1 << level;
    for (const int h : {2 * node.heading, 2 * node.heading + 1})
      for (const int y : {0, half})
        for (const int x : {0, half}) add(level, h, node.x + x, node.y + y);
  }

  Pose2 poseOf(const Node& leaf) const {
    return {start_.x_m + leaf.x * grid_.cell(), start_.y_m + leaf.y * grid_.cell(),
            wrapAngle(start_.theta_rad + heading(leaf.heading))};
  }

  /// True if the beam passes a surface and is behind it, far from every surface, before its own end.
  bool passes(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
    const double length = (to - from).norm();
    const Eigen::Vector2d along = (to - from) / length;
    const auto code = [&](int level, double d, double shift) {
      const Eigen::Vector2d at = from + d * along - Eigen::Vector2d::Constant(shift);
      return grid_.code(level, static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
    };
    bool surface = false;
    for (double d = kNearEnd; d < length - kNearEnd; d += 1.0) {
      if (!surface && !PlaceGrid::hasSurface(code(kStride, d, kHalfStride))) {
        d += kHalfStride - 2.0;
        continue;
      }
      const int here = code(0, d, 0.0);
      surface = surface || PlaceGrid::hasSurface(here);
      if (surface && here < PlaceGrid::kZero) return true;
    }
    return false;
  }

  Node withPassed(Node leaf) const {
    const double angle = start_.theta_rad + heading(leaf.heading), c = std::cos(angle), s = std::sin(angle);
    const Eigen::Vector2d from = origin_ + Eigen::Vector2d(leaf.x, leaf.y);
    const double weight = sumUp(0, leaf.heading, leaf.x, leaf.y).weight,
                 loss = o_.through_weight * kUnit / weight;
    double score = leaf.score;
    for (std::size_t i = 0; i < beams_.ends.size() && score >= cut_; ++i) {
      const Eigen::Vector2d& end = beams_.ends[i];
      if (passes(from, from + Eigen::Vector2d(c * end.x() - s * end.y(), s * end.x() + c * end.y())))
        score -= loss;
    }
    leaf.score = score >= cut_ ? static_cast<float>(score) : 0.0f;
    leaf.exact = true;
    return leaf;
  }

  PlaceCandidate candidate(const Node& leaf) const {
    int known = 0;
    const Cell* cells = cellsOf(0, leaf.heading);
    for (std::size_t i = 0; i < beams_.ends.size(); ++i)
      known += grid_.code(0, cells[i].x + leaf.x + origin_cell_.x(),
                          cells[i].y + leaf.y + origin_cell_.y()) >= PlaceGrid::kKnown
                   ? 1
                   : 0;
    return {poseOf(leaf), std::max(0.0, static_cast<double>(leaf.score)),
            known / static_cast<double>(beams_.ends.size())};
  }

  static bool isIn(const Zone& zone, const Pose2& pose, double margin_m, double margin_rad) {
    return (pose.translation() - zone.pose.translation()).norm() + margin_m <= zone.m &&
           std::abs(wrapAngle(pose.theta_rad - zone.pose.theta_rad)) + margin_rad <= zone.rad;
  }

  /// True if all leaves of the node are too close to a candidate or belong to its flank.
  bool isSuppressed(const Node& node) const {
    const double half = 0.5 * ((1 << node.level) - 1);
    const Pose2 centre{start_.x_m + (node.x + half) * grid_.cell(),
                       start_.y_m + (node.y + half) * grid_.cell(),
                       start_.theta_rad + heading((node.heading << node.level) + half)};
    for (const Zone& zone : zones_)
      if (isIn(zone, centre, std::sqrt(2.0) * half * grid_.cell(), half * step_rad_)) return true;
    return false;
  }

  /// Steepest ascent to a leaf that is the best within kClimb steps.
  Node climb(Node leaf) const {
    leaf.score = exactScore(leaf.heading, leaf.x, leaf.y);
    for (int round = 0; round < kMostClimbs; ++round) {
      Node best = leaf;
      for (int turn = -kClimb; turn <= kClimb; ++turn) {
        int h = leaf.heading + turn;
        if (full_circle_) h = (h + headings_) % headings_;
        if (h < 0 || h >= headings_) continue;
        for (int y = leaf.y - kClimb; y <= leaf.y + kClimb; ++y) {
          for (int x = leaf.x - kClimb; x <= leaf.x + kClimb; ++x) {
            const float value = exactScore(h, x, y);
            if (value > best.score) best = {value, x, y, static_cast<std::int16_t>(h), 0, false};
          }
        }
      }
      if (!(best.score > leaf.score)) break;
      leaf = best;
    }
    return leaf;
  }

  void accept(const Node& leaf) {
    const Pose2 pose = poseOf(leaf);
    if (!found_.empty()) {
      const Pose2 top = poseOf(climb(leaf));
      for (const Zone& zone : zones_) {
        if (!isIn(zone, top, 0.0, 0.0)) continue;
        zones_.push_back({pose, 0.5 * o_.distinct_m, 0.5 * o_.distinct_rad});
        return;
      }
    }
    found_.push_back(candidate(leaf));
    zones_.push_back({pose, o_.distinct_m, o_.distinct_rad});
    cut_ = std::max(cut_, static_cast<float>(found_.front().score - o_.margin));
  }

  const PlaceGrid& grid_;
  const PlaceSearchOptions& o_;
  const Beams& beams_;
  Pose2 start_;
  double reach_;           ///< cells
  double step_rad_ = 0.0;  ///< between headings
  int headings_ = 1;
  bool full_circle_ = false;
  Eigen::Vector2d origin_;  ///< the start, in cells of the grid
  Eigen::Vector2i origin_cell_;
  float cut_ = -1e9f;
  std::array<std::int32_t, 256> table_{};  ///< by code: value · 2^16 + weight
  std::vector<std::size_t> first_;         ///< node of each level in `cells_`
  std::vector<Cell> cells_;
  std::vector<Node> queue_;  ///< a heap
  std::vector<PlaceCandidate> found_;
  std::vector<Zone> zones_;
  float bonus_ = 0.0f;
  long nodes_ = 0;
};

}  // namespace

PlaceSearchOptions PlaceSearchOptions::read(const options::Section& section) {
  return read(section, {});
}

PlaceSearchOptions PlaceSearchOptions::read(const options::Section& section,
                                            const PlaceSearchOptions& defaults) {
  PlaceSearchOptions o = defaults;
  section.read("cell_m", o.cell_m, {0.005, 1.0});
  section.read("levels", o.levels, {2, 8});
  section.read("max_range_m", o.max_range_m, {0.1, 100.0});
  section.read("min_score", o.min_score, {0.05, 1.0});
  section.read("margin", o.margin, {0.0, 1.0});
  section.read("unknown_weight", o.unknown_weight, {0.05, 1.0});
  section.read("free_weight", o.free_weight, {0.0, 1.0});
  section.read("through_weight", o.through_weight, {0.0, 1.0});
  section.read("distinct_m", o.distinct_m, {0.0, 10.0});
  section.read("distinct_rad", o.distinct_rad, {0.0, 3.15});
  section.read("beams", o.beams, {10, 1000});
  section.read("min_beams", o.min_beams, {10, 1000});
  section.read("most", o.most, {1, 100});
  section.read("max_nodes", o.max_nodes, {1000, 1e9});
  section.finish();
  return o;
}

void PlaceSearch::setReferences(const std::vector<Reference>& references) {
  grid_.build(references, options_.cell_m, options_.levels, options_.free_weight, options_.max_range_m);
}

bool PlaceSearch::isValid(const Pose2& pose) const {
  return !empty() && pose.isFinite() && grid_.inCells(pose.translation()).cwiseAbs().maxCoeff() < kFarthest;
}

std::vector<PlaceCandidate> PlaceSearch::search(const LineScan& scan, const Pose2& start, double reach_m,
                                                double reach_rad) const {
  if (!isValid(start) || !(reach_m >= 0) || !(reach_rad >= 0)) return {};
  const Beams beams(scan, options_, grid_.cell());
  if (beams.ends.empty()) return {};
  return Tree(grid_, options_, beams, start, reach_m, reach_rad).search();
}

PlaceCandidate PlaceSearch::evaluate(const LineScan& scan, const Pose2& map_from_scan) const {
  PlaceCandidate none;
  none.map_from_scan = map_from_scan;
  if (!isValid(map_from_scan)) return none;
  const Beams beams(scan, options_, grid_.cell());
  if (beams.ends.empty()) return none;
  return Tree(grid_, options_, beams, map_from_scan, 0.0, 0.0).evaluateStart();
}

double PlaceSearch::headingStep(const LineScan& scan) const {
  if (empty()) return 0.0;
  const Beams beams(scan, options_, grid_.cell());
  return beams.ends.empty() ? 0.0 : Tree(grid_, options_, beams, {}, 0.0, M_PI).headingStep();
}

}  // namespace omnifleet::scan
