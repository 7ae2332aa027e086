#include "outline/vertices.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "outline/convex_hull.h"

namespace omnifleet::outline {
namespace {

constexpr int kBins = 192;
constexpr int kMaxArc = 85;  // bins, 160°: the sharpest possible corner has 20°
constexpr double kRidge =
    25.0;  // 1/(0.2 m)²: an arc too narrow to determine its vertex puts it nearest to the centre

/// Normal equations of n·p = h.
struct Sums {
  double xx = 0.0, xy = 0.0, yy = 0.0, xh = 0.0, yh = 0.0, hh = 0.0;

  Sums& operator+=(const Sums& o) {
    xx += o.xx, xy += o.xy, yy += o.yy, xh += o.xh, yh += o.yh, hh += o.hh;
    return *this;
  }
  /// A sample relative to a point.
  static Sums of(const SupportSample& sample, const Eigen::Vector2d& centre) {
    const double c = std::cos(sample.angle_rad), s = std::sin(sample.angle_rad), w = sample.weight;
    const double h = sample.support_m - c * centre.x() - s * centre.y();
    return {w * c * c, w * c * s, w * s * s, w * c * h, w * s * h, w * h * h};
  }
  Sums minus(const Sums& o) const {
    return {xx - o.xx, xy - o.xy, yy - o.yy, xh - o.xh, yh - o.yh, hh - o.hh};
  }
  Eigen::Vector2d solve() const {
    const double a = xx + kRidge, c = yy + kRidge, determinant = a * c - xy * xy;
    return {(c * xh - xy * yh) / determinant, (a * yh - xy * xh) / determinant};
  }
  double cost() const {
    const Eigen::Vector2d p = solve();
    return std::max(hh - p.x() * xh - p.y() * yh, 0.0);
  }
};

class Cutter {
 public:
  Cutter(const std::vector<SupportSample>& samples, const Eigen::Vector2d& centre, double penalty)
      : prefix_(2 * kBins + 1), penalty_(penalty) {
    std::vector<Sums> bins(kBins);
    for (const auto& sample : samples) {
      const double turns = sample.angle_rad / (2.0 * M_PI);
      const auto bin = static_cast<std::size_t>((turns - std::floor(turns)) * kBins) % kBins;
      bins[bin] += Sums::of(sample, centre);
    }
    for (std::size_t i = 0; i < 2 * kBins; ++i) {
      prefix_[i + 1] = prefix_[i];
      prefix_[i + 1] += bins[i % kBins];
    }
  }

  /// Cuts of minimum cost of one turn that begins with a cut at bin `start`: ascending, from `start` to start
  /// + kBins.
  std::vector<int> cutsFrom(int start) const {
    std::vector<double> best(kBins + 1, std::numeric_limits<double>::infinity());
    std::vector<int> from(kBins + 1, 0);
    best[0] = 0.0;
    for (int end = 1; end <= kBins; ++end) {
      for (int begin = std::max(0, end - kMaxArc); begin < end; ++begin) {
        const double cost =
            best[static_cast<std::size_t>(begin)] + penalty_ + arc(start + begin, start + end).cost();
        if (cost >= best[static_cast<std::size_t>(end)]) continue;
        best[static_cast<std::size_t>(end)] = cost;
        from[static_cast<std::size_t>(end)] = begin;
      }
    }
    std::vector<int> cuts{start + kBins};
    for (int at = kBins; at > 0; at = from[static_cast<std::size_t>(at)]) {
      cuts.push_back(start + from[static_cast<std::size_t>(at)]);
    }
    return {cuts.rbegin(), cuts.rend()};
  }

  Sums arc(int begin, int end) const {
    return prefix_[static_cast<std::size_t>(end)].minus(prefix_[static_cast<std::size_t>(begin)]);
  }

 private:
  std::vector<Sums> prefix_;
  double penalty_;
};

/// Groups the samples by the vertex that supports each. A bin may contain the normal of an edge; a sample
/// does not.
std::vector<Sums> shares(const std::vector<SupportSample>& samples, const Polygon& vertices,
                         const Eigen::Vector2d& centre) {
  std::vector<Sums> shared(vertices.size());
  for (const auto& sample : samples) {
    const Eigen::Vector2d n(std::cos(sample.angle_rad), std::sin(sample.angle_rad));
    std::size_t best = 0;
    for (std::size_t v = 1; v < vertices.size(); ++v) {
      if (n.dot(vertices[v]) > n.dot(vertices[best])) best = v;
    }
    shared[best] += Sums::of(sample, centre);
  }
  return shared;
}

/// Merges neighbours as long as a vertex saves less than the penalty, starting with the smallest saving.
void mergeNeighbours(std::vector<Sums>& shared, double penalty) {
  while (shared.size() > 3) {
    double least = penalty;
    std::size_t where = shared.size();
    for (std::size_t v = 0; v < shared.size(); ++v) {
      const Sums &a = shared[v], &b = shared[(v + 1) % shared.size()];
      Sums both = a;
      both += b;
      const double saved = both.cost() - a.cost() - b.cost();
      if (saved < least) least = saved, where = v;
    }
    if (where == shared.size()) return;
    shared[where] += shared[(where + 1) % shared.size()];
    shared.erase(shared.begin() + static_cast<std::ptrdiff_t>((where + 1) % shared.size()));
  }
}

Polygon settle(const std::vector<SupportSample>& samples, Polygon vertices, const Eigen::Vector2d& centre,
               double penalty) {
  for (int round = 0; round < 3 && vertices.size() >= 3; ++round) {
    std::vector<Sums> shared = shares(samples, vertices, centre);
    mergeNeighbours(shared, penalty);
    vertices.clear();
    for (const auto& sums : shared) vertices.push_back(centre + sums.solve());
    vertices = convexHull(vertices);
  }
  return vertices;
}

}  // namespace

Polygon polygonOfSamples(const std::vector<SupportSample>& samples, const Eigen::Vector2d& centre,
                         double penalty) {
  const Cutter cutter(samples, centre, penalty);
  // The first turn must begin with an arbitrary cut. The second turn begins with the cut farthest from it.
  const std::vector<int> first = cutter.cutsFrom(0);
  const int middle = *std::min_element(first.begin(), first.end(), [](int a, int b) {
    return std::abs(a - kBins / 2) < std::abs(b - kBins / 2);
  });
  const std::vector<int> cuts = cutter.cutsFrom(middle % kBins);
  Polygon vertices;
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    vertices.push_back(centre + cutter.arc(cuts[i], cuts[i + 1]).solve());
  }
  const Polygon hull = settle(samples, convexHull(vertices), centre, penalty);
  return hull.size() < 3 ? Polygon{} : hull;
}

}  // namespace omnifleet::outline
