#include "scan/map_overlap.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "scan/surface_viewer.h"

namespace omnifleet::scan {
namespace {

struct Cell {
  int agree = 0, deny = 0, seen = 0;
  Eigen::Matrix2d normals = Eigen::Matrix2d::Zero();
};

/// Surfaces collected by the straight lines that they lie on.
class Lines {
 public:
  explicit Lines(const OverlapOptions& options) : o_(options) {}

  void add(const Eigen::Vector2d& at, const Eigen::Matrix2d& normals) {
    const Eigen::Vector2d normal =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(normals).eigenvectors().col(1);
    for (Line& line : lines_) {
      if (std::abs(line.normal.dot(normal)) < kParallel) continue;
      if (std::abs(line.normal.dot(at - line.at)) > kOffsetCells * o_.cell_m) continue;
      line.length_m += o_.cell_m;
      return;
    }
    lines_.push_back({at, normal, o_.cell_m});
  }

  double distinct_m() const {
    double sum_m = 0.0;
    for (const Line& line : lines_) sum_m += std::min(line.length_m, o_.line_m);
    return sum_m;
  }

 private:
  static constexpr double kParallel = 0.966;   // cosine of 15°
  static constexpr double kOffsetCells = 1.5;  // of one line: a line across cells is as thick
  struct Line {
    Eigen::Vector2d at, normal;
    double length_m;
  };
  const OverlapOptions& o_;
  std::vector<Line> lines_;
};

void compare(const std::vector<View>& shown, const std::vector<Viewer>& viewers, const OverlapOptions& o,
             Overlap& overlap) {
  std::map<std::pair<int, int>, Cell> cells;
  for (const View& view : shown) {
    const Reference& reference = view.reference;
    const Eigen::Matrix2d rotation = reference.map_from_scan.rotation();
    const auto& beams = reference.scan->beams();
    const std::size_t stride = strideOf(*reference.scan, o);
    for (std::size_t i = 0; i < beams.size(); i += stride) {
      const LineScan::Beam& beam = beams[i];
      if (!showsSurface(beam, o) || (view.transient != nullptr && (*view.transient)[i] != 0)) continue;
      const double sigma_m = rangeSigma(beam);
      const Eigen::Vector2d at = reference.map_from_scan * beam.point_m.cast<double>();
      Cell& cell = cells[{static_cast<int>(std::floor(at.x() / o.cell_m)),
                          static_cast<int>(std::floor(at.y() / o.cell_m))}];
      const Eigen::Vector2d normal = rotation * beam.line.cast<double>().normalized();
      for (const Viewer& viewer : viewers) {
        const Says says = viewer.about(at, sigma_m, o);
        cell.agree += says == Says::kAgrees ? 1 : 0;
        cell.deny += says == Says::kDenies ? 1 : 0;
      }
      cell.normals += normal * normal.transpose();
      ++cell.seen;
    }
  }
  Lines agreeing(o), denied(o);
  for (const auto& [at, cell] : cells) {
    if (cell.agree == 0 && cell.deny == 0) continue;
    const Eigen::Vector2d middle = o.cell_m * Eigen::Vector2d(at.first + 0.5, at.second + 0.5);
    if (cell.agree >= cell.deny) {
      overlap.agree_m += o.cell_m;
      overlap.normals += cell.normals / cell.seen;
      agreeing.add(middle, cell.normals);
    } else {
      overlap.contradict_m += o.cell_m;
      denied.add(middle, cell.normals);
    }
  }
  overlap.distinct_agree_m += agreeing.distinct_m();
  overlap.distinct_contradict_m += denied.distinct_m();
}

std::vector<Viewer> viewersOf(const std::vector<View>& views) {
  std::vector<Viewer> viewers;
  for (const View& view : views) viewers.emplace_back(view.reference);
  return viewers;
}

std::vector<View> viewsOf(const std::vector<Reference>& references) {
  std::vector<View> views;
  for (const Reference& reference : references) views.push_back({reference});
  return views;
}

}  // namespace

OverlapOptions OverlapOptions::read(const options::Section& section) {
  OverlapOptions o;
  section.read("cell_m", o.cell_m, {0.01, 1.0});
  section.read("agree_m", o.agree_m, options::kPositive);
  section.read("through_m", o.through_m, options::kPositive);
  section.read("sigmas", o.sigmas, options::kNotNegative);
  section.read("most_sigma_m", o.most_sigma_m, options::kPositive);
  section.read("beams", o.beams, {10, 1440});
  section.read("line_m", o.line_m, options::kPositive);
  section.read("neighbours", o.neighbours, {0, 100});
  section.finish();
  return o;
}

Overlap overlapOf(const std::vector<Reference>& a, const std::vector<Reference>& b, const OverlapOptions& o) {
  return overlapOf(viewsOf(a), viewsOf(b), o);
}

Overlap overlapOf(const std::vector<View>& a, const std::vector<View>& b, const OverlapOptions& o) {
  Overlap overlap;
  compare(a, viewersOf(b), o, overlap);
  compare(b, viewersOf(a), o, overlap);
  const double cells = overlap.agree_m / o.cell_m;
  if (cells > 0) overlap.normals /= cells;
  overlap.agree_m *= 0.5;  // both directions count the same surfaces
  overlap.contradict_m *= 0.5;
  overlap.distinct_agree_m *= 0.5;
  overlap.distinct_contradict_m *= 0.5;
  return overlap;
}

}  // namespace omnifleet::scan
