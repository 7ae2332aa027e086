#include "structure/line_pieces.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace omnifleet::structure::detail {
namespace {

using Eigen::Vector2d;

constexpr double kLeastSigma_m = 0.001;  // no mean is known better
// The mean of a cell that contains a corner: its σ (it is up to a quarter of a cell off a face), its largest
// distance from a face, and from the corner (half a diagonal).
constexpr double kCornerSigma_cells = 0.15;
constexpr double kCornerOff_cells = 0.4;
constexpr double kAtCorner_cells = 0.75;
constexpr double kReach_cells = 1.5;  // of an intersection from the corner's cell
constexpr double kLeastTurn = 0.09;   // sin 5°: lines that are closer to parallel have no intersection

double cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

struct Line {
  Vector2d at = Vector2d::Zero(), along = Vector2d::UnitX();

  double distanceTo(const Vector2d& p) const { return std::abs(cross(along, p - at)); }
  Vector2d projected(const Vector2d& p) const { return at + along * along.dot(p - at); }
};

std::optional<Vector2d> intersection(const Line& a, const Line& b) {
  const double turn = cross(a.along, b.along);
  if (std::abs(turn) < kLeastTurn) return std::nullopt;
  return a.at + a.along * (cross(b.at - a.at, b.along) / turn);
}

double distanceToSegment(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const double length = (b - a).squaredNorm();
  const double share = length > 0.0 ? std::clamp((p - a).dot(b - a) / length, 0.0, 1.0) : 0.0;
  return (p - a - share * (b - a)).norm();
}

/// The stretch and the corners found so far. Positions count along the stretch; in a ring they continue
/// beyond its ends.
class LinePieces {
 public:
  LinePieces(const Stretch& stretch, const SurfaceMap& map, const PolylineOptions& options)
      : stretch_(stretch), map_(map), options_(options), size_(static_cast<int>(stretch.cells.size())) {}

  void findCorners();
  void mergePieces();
  void sharpenCorners();
  std::vector<Vector2d> vertices() const;

 private:
  const SurfaceCell& cell(int at) const {
    const int wrapped = at % size_;
    return *stretch_.cells[static_cast<std::size_t>(wrapped < 0 ? wrapped + size_ : wrapped)];
  }
  const Vector2d& mean(int at) const { return cell(at).mean_m; }
  double within(int at, double tolerance_m) const {
    return std::max(tolerance_m, options_.tolerance_sigmas * cell(at).sigma_m);
  }

  int corners() const { return static_cast<int>(corners_.size()); }
  int pieces() const { return stretch_.is_ring ? corners() : corners() - 1; }
  /// Position of a corner; in a ring the number may be beyond its ends.
  int corner(int number) const {
    const int count = corners(), turn = number < 0 ? -1 : number / count;
    return corners_[static_cast<std::size_t>(number - turn * count)] + turn * size_;
  }
  bool isEnd(int at) const { return !stretch_.is_ring && (at == 0 || at == size_ - 1); }

  void split(int first, int last, std::vector<int>& found) const;
  int farthestFrom(int at) const;
  Line lineOf(int first, int last) const;
  Line lineOf(int piece) const;
  bool isStraight(int first, int last) const;
  std::optional<Vector2d> cornerOf(const Line& before, const Line& after, int first, int last) const;
  void replaceCorners(int number, int run, int at);
  bool agrees(int at, const Line& before, const Line& after, const Vector2d& corner_m) const;
  Vector2d vertexAt(int number, const std::vector<Line>& lines) const;

  const Stretch& stretch_;
  const SurfaceMap& map_;
  const PolylineOptions& options_;
  int size_;
  std::vector<int> corners_;  ///< positions, increasing; of an open stretch with both ends
};

int LinePieces::farthestFrom(int at) const {
  int farthest = at;
  for (int i = 0; i < size_; ++i)
    if ((mean(i) - mean(at)).squaredNorm() > (mean(farthest) - mean(at)).squaredNorm()) farthest = i;
  return farthest;
}

/// Douglas–Peucker: appends the corners between two positions, in any order. It is quadratic for lines like a
/// spiral, so it begins with a corner every 100 cells. mergePieces() removes those on straight walls.
void LinePieces::split(int first, int last, std::vector<int>& found) const {
  constexpr int kMostCells = 100;
  std::vector<std::pair<int, int>> open;
  for (int from = first; from < last; from += kMostCells) {
    if (from > first) found.push_back(from);
    open.emplace_back(from, std::min(from + kMostCells, last));
  }
  while (!open.empty()) {
    const auto [from, to] = open.back();
    open.pop_back();
    int worst = -1;
    double most = 1.0;
    for (int i = from + 1; i < to; ++i) {
      const double share = distanceToSegment(mean(i), mean(from), mean(to)) / within(i, options_.tolerance_m);
      if (share > most) most = share, worst = i;
    }
    if (worst < 0) continue;
    found.push_back(worst);
    open.emplace_back(from, worst);
    open.emplace_back(worst, to);
  }
}

void LinePieces::findCorners() {
  if (stretch_.is_ring) {
    const int far = farthestFrom(0), other = farthestFrom(far);
    const int low = std::min(far, other), high = std::max(far, other);
    corners_ = {low, high};
    split(low, high, corners_);
    split(high, low + size_, corners_);
    for (int& at : corners_) at %= size_;
  } else {
    corners_ = {0, size_ - 1};
    split(0, size_ - 1, corners_);
  }
  std::sort(corners_.begin(), corners_.end());
  corners_.erase(std::unique(corners_.begin(), corners_.end()), corners_.end());
}

/// Weighted total least squares. Cells near a corner at either end have a larger σ.
Line LinePieces::lineOf(int first, int last) const {
  const double corner_sigma_m = kCornerSigma_cells * map_.resolution_m;
  const double reach = std::pow(kAtCorner_cells * map_.resolution_m, 2);
  const auto isNear = [&](int at, int corner) {
    return !isEnd(corner) && (mean(at) - mean(corner)).squaredNorm() <= reach;
  };
  const auto weightOf = [&](int at) {
    const bool is_at_corner = isNear(at, first) || isNear(at, last);
    const double sigma = std::max(cell(at).sigma_m, kLeastSigma_m);
    return 1.0 / (sigma * sigma + (is_at_corner ? corner_sigma_m * corner_sigma_m : 0.0));
  };
  double sum = 0.0;
  Vector2d moment = Vector2d::Zero(), origin = mean(first);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (int i = first; i <= last; ++i) {
    const double weight = weightOf(i);
    const Vector2d p = mean(i) - origin;
    sum += weight;
    moment += weight * p;
    scatter += weight * p * p.transpose();
  }
  scatter -= moment * moment.transpose() / sum;
  const double angle = 0.5 * std::atan2(2.0 * scatter(0, 1), scatter(0, 0) - scatter(1, 1));
  Line line{origin + moment / sum, {std::cos(angle), std::sin(angle)}};
  if (line.along.dot(mean(last) - mean(first)) < 0) line.along = -line.along;
  return line;
}

Line LinePieces::lineOf(int piece) const {
  return lineOf(corner(piece), corner(piece + 1));
}

/// One line fits all cells; those at the ends may contain a corner. At the tip of a thin wall the cells
/// return along the same line.
bool LinePieces::isStraight(int first, int last) const {
  const Line line = lineOf(first, last);
  const double corner_off_m = kCornerOff_cells * map_.resolution_m;
  double farthest = line.along.dot(mean(first));
  for (int i = first; i <= last; ++i) {
    const bool is_corner = (i == first || i == last) && !isEnd(i);
    const double tolerance_m = within(i, 0.5 * options_.tolerance_m);
    const double off_m = line.distanceTo(mean(i)), along = line.along.dot(mean(i));
    if (off_m > (is_corner ? std::hypot(tolerance_m, corner_off_m) : tolerance_m)) return false;
    farthest = std::max(farthest, along);
    if (along < farthest - kReach_cells * map_.resolution_m) return false;
  }
  return true;
}

void LinePieces::mergePieces() {
  std::vector<int> kept;
  if (!stretch_.is_ring) kept.push_back(0);
  const int least = stretch_.is_ring ? 3 : 2;
  int left = corners();
  // The piece before corner k begins at the corner kept last.
  for (int k = stretch_.is_ring ? 0 : 1; k < corners(); ++k) {
    const int before = kept.empty() ? corner(-1) : kept.back();
    const auto after = [&] {
      return k + 1 == corners() && !kept.empty() ? kept.front() + size_ : corner(k + 1);
    };
    if (!isEnd(corner(k)) && left > least && isStraight(before, after())) {
      --left;
    } else {
      kept.push_back(corner(k));
    }
  }
  corners_ = std::move(kept);
}

/// The mean of a cell lies on one of the two faces of a corner, or the cell contains the corner.
bool LinePieces::agrees(int at, const Line& before, const Line& after, const Vector2d& corner_m) const {
  const double tolerance_m = within(at, 0.5 * options_.tolerance_m);
  const double along = before.along.dot(mean(at) - corner_m), beyond = after.along.dot(mean(at) - corner_m);
  if (along <= 0 && before.distanceTo(mean(at)) <= tolerance_m) return true;
  if (beyond >= 0 && after.distanceTo(mean(at)) <= tolerance_m) return true;
  constexpr double kMargin_cells = 0.1;
  const Vector2d in_cell = (corner_m - map_.origin_m) / map_.resolution_m - Vector2d(cell(at).x, cell(at).y);
  return (in_cell.array() - 0.5).abs().maxCoeff() <= 0.5 + kMargin_cells;
}

/// The corner between two lines, if the cells of the positions agree with it.
std::optional<Vector2d> LinePieces::cornerOf(const Line& before, const Line& after, int first,
                                             int last) const {
  const std::optional<Vector2d> corner_m = intersection(before, after);
  for (int i = first; corner_m && i <= last; ++i)
    if (!agrees(i, before, after, *corner_m)) return std::nullopt;
  return corner_m;
}

/// Replaces the corners number … number + run by one.
void LinePieces::replaceCorners(int number, int run, int at) {
  const int beyond = std::max(0, number + run + 1 - corners());  // of a ring: at its beginning
  const auto from = corners_.begin() + number;
  corners_.erase(from + 1, from + 1 + run - beyond);
  corners_[static_cast<std::size_t>(number)] = at;
  corners_.erase(corners_.begin(), corners_.begin() + beyond);
  if (at >= size_) {
    corners_.back() = at - size_;
    std::rotate(corners_.begin(), corners_.end() - 1, corners_.end());
  }
}

void LinePieces::sharpenCorners() {
  constexpr int kMostPieces = 3, kMostCells = 4;
  for (int number = stretch_.is_ring ? 0 : 1; number < corners(); ++number) {
    for (int run = kMostPieces; run >= 1; --run) {
      // Corners number … number + run become one; each neighbour has a cell of its own.
      if (corners() < run + 3 || (!stretch_.is_ring && number + run > corners() - 2)) continue;
      const int first = corner(number), last = corner(number + run);
      if (last - first > kMostCells || first - corner(number - 1) < 2 || corner(number + run + 1) - last < 2)
        continue;
      const std::optional<Vector2d> corner_m =
          cornerOf(lineOf(number - 1), lineOf(number + run), first, last);
      if (!corner_m) continue;
      int nearest = first;
      for (int i = first; i <= last; ++i)
        if ((mean(i) - *corner_m).norm() < (mean(nearest) - *corner_m).norm()) nearest = i;
      replaceCorners(number, run, nearest);
      break;
    }
  }
}

Vector2d LinePieces::vertexAt(int number, const std::vector<Line>& lines) const {
  const Vector2d& at = mean(corner(number));
  if (isEnd(corner(number))) return (number == 0 ? lines.front() : lines.back()).projected(at);
  const Line& before = lines[static_cast<std::size_t>((number + pieces() - 1) % pieces())];
  const Line& after = lines[static_cast<std::size_t>(number)];
  const std::optional<Vector2d> corner_m = intersection(before, after);
  const bool is_near = corner_m && (*corner_m - at).norm() <= kReach_cells * map_.resolution_m;
  return is_near ? *corner_m : Vector2d(0.5 * (before.projected(at) + after.projected(at)));
}

std::vector<Vector2d> LinePieces::vertices() const {
  std::vector<Line> lines;
  for (int k = 0; k < pieces(); ++k) lines.push_back(lineOf(k));
  std::vector<Vector2d> found;
  for (int k = 0; k < corners(); ++k) found.push_back(vertexAt(k, lines));
  return found;
}

}  // namespace

std::vector<Vector2d> verticesOf(const Stretch& stretch, const SurfaceMap& map,
                                 const PolylineOptions& options) {
  LinePieces pieces(stretch, map, options);
  pieces.findCorners();
  pieces.mergePieces();
  pieces.sharpenCorners();
  pieces.mergePieces();
  return pieces.vertices();
}

}  // namespace omnifleet::structure::detail
