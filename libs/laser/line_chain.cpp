#include "laser/line_chain.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::laser {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Splits at the beam farthest from the chord until all lie within the tolerance.
void split(const Beams& beams, const Segment& segment, std::size_t first, std::size_t last,
           double tolerance_m, std::vector<Piece>& pieces) {
  const Eigen::Vector2d a = beams.at(segment.first + first).point_m,
                        b = beams.at(segment.first + last).point_m;
  const Eigen::Vector2d along = (b - a).stableNormalized();
  std::size_t farthest = first;
  double most = tolerance_m;
  for (std::size_t i = first + 1; i < last; ++i) {
    const Eigen::Vector2d to = beams.at(segment.first + i).point_m - a;
    const double off = along.isZero() ? to.norm() : std::abs(cross(along, to));
    if (off <= most) continue;
    most = off;
    farthest = i;
  }
  if (farthest == first) {
    Piece piece;
    piece.first = first;
    piece.last = last;
    pieces.push_back(piece);
    return;
  }
  split(beams, segment, first, farthest, tolerance_m, pieces);
  split(beams, segment, farthest, last, tolerance_m, pieces);
}

/// Total least squares in closed form.
void fit(const Beams& beams, const Segment& segment, Piece& piece) {
  const auto n = static_cast<double>(piece.count());
  piece.mean_m.setZero();
  for (std::size_t i = piece.first; i <= piece.last; ++i)
    piece.mean_m += beams.at(segment.first + i).point_m / n;
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (std::size_t i = piece.first; i <= piece.last; ++i) {
    const Eigen::Vector2d d = beams.at(segment.first + i).point_m - piece.mean_m;
    xx += d.x() * d.x(), xy += d.x() * d.y(), yy += d.y() * d.y();
  }
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
  piece.along = {std::cos(angle), std::sin(angle)};
  const Eigen::Vector2d chord =
      beams.at(segment.first + piece.last).point_m - beams.at(segment.first + piece.first).point_m;
  if (piece.along.dot(chord) < 0.0) piece.along = -piece.along;
  const double most = piece.along.dot(Eigen::Vector2d(xx * piece.along.x() + xy * piece.along.y(),
                                                      xy * piece.along.x() + yy * piece.along.y()));
  piece.spread_m2 = most;
  piece.squares_m2 = std::max(0.0, xx + yy - most);
}

/// Removes pieces of two beams between longer ones: they define no line of their own. Their beams belong to
/// the corner of the neighbours.
void dropShort(std::vector<Piece>& pieces) {
  for (std::size_t i = 1; i + 1 < pieces.size();) {
    if (pieces[i].count() > 2) {
      ++i;
      continue;
    }
    pieces[i - 1].last = pieces[i].last;
    pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

}  // namespace

void lineChain(const Beams& beams, const Segment& segment, double tolerance_m, std::vector<Piece>& pieces) {
  pieces.clear();
  if (segment.count == 0) return;
  split(beams, segment, 0, segment.count - 1, tolerance_m, pieces);
  dropShort(pieces);
  for (Piece& piece : pieces) fit(beams, segment, piece);
}

double bulge(const Piece& before, const Piece& after) {
  return std::atan2(-cross(before.along, after.along), before.along.dot(after.along));
}

double bulgeSigma(const Piece& before, const Piece& after, double range_sigma_m) {
  constexpr double kLeast_m2 = 1e-9;
  return range_sigma_m *
         std::sqrt(1.0 / std::max(kLeast_m2, before.spread_m2) + 1.0 / std::max(kLeast_m2, after.spread_m2));
}

Eigen::Vector2d corner(const Beams& beams, const Segment& segment, const Piece& before, const Piece& after) {
  constexpr double kParallel = 0.15;  // sine of the angle below which the intersection is unreliable
  constexpr double kFar_m = 0.05;     // m, largest distance of the intersection from the shared beam
  const Eigen::Vector2d shared = beams.at(segment.first + before.last).point_m;
  const double sine = cross(before.along, after.along);
  const double reach =
      std::abs(sine) < kParallel ? 0.0 : cross(after.mean_m - before.mean_m, after.along) / sine;
  const Eigen::Vector2d crossing = before.mean_m + reach * before.along;
  if (std::abs(sine) < kParallel || (crossing - shared).norm() > kFar_m) {
    const Eigen::Vector2d on_first = before.mean_m + before.along * before.along.dot(shared - before.mean_m);
    const Eigen::Vector2d on_second = after.mean_m + after.along * after.along.dot(shared - after.mean_m);
    return 0.5 * (on_first + on_second);
  }
  return crossing;
}

}  // namespace omnifleet::laser
