#include "scan/map_overlap.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

namespace omnifleet::scan {
namespace {

enum class Says { kNothing, kAgrees, kDenies };

/// A scan with its inverse pose, to look up bearings.
struct Viewer {
  const LineScan* scan;
  Pose2 scan_from_map;
};

double rangeSigma(const LineScan::Beam& beam) {
  return static_cast<double>(beam.sigma) / (static_cast<double>(beam.s) * static_cast<double>(beam.s));
}

/// What one scan says about a surface at a place whose range along the line of sight has the σ.
Says ask(const Viewer& viewer, const Eigen::Vector2d& map_m, double sigma_m, const OverlapOptions& o) {
  const Eigen::Vector2d at = viewer.scan_from_map * map_m;
  const double range_m = at.norm();
  const auto& beams = viewer.scan->beams();
  const auto n = static_cast<int>(beams.size());
  if (n == 0 || !(range_m > 0)) return Says::kNothing;
  const int middle = static_cast<int>(std::lround(std::atan2(at.y(), at.x()) * n / (2.0 * M_PI)));
  bool all_pass = true;
  for (int i = middle - o.neighbours; i <= middle + o.neighbours; ++i) {
    const LineScan::Beam& beam = beams[static_cast<std::size_t>(((i % n) + n) % n)];
    if (!(beam.s > 0) || !(beam.sigma > 0)) {
      all_pass = false;
      continue;
    }
    const double other_m = 1.0 / static_cast<double>(beam.s),
                 margin_m = o.sigmas * std::hypot(sigma_m, rangeSigma(beam));
    if (std::abs(other_m - range_m) < o.agree_m + margin_m) return Says::kAgrees;
    all_pass = all_pass && other_m > range_m + o.through_m + margin_m;
  }
  return all_pass ? Says::kDenies : Says::kNothing;
}

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

void compare(const std::vector<Reference>& shown, const std::vector<Viewer>& viewers, const OverlapOptions& o,
             Overlap& overlap) {
  std::map<std::pair<int, int>, Cell> cells;
  for (const Reference& reference : shown) {
    const Eigen::Matrix2d rotation = reference.map_from_scan.rotation();
    const auto& beams = reference.scan->beams();
    const std::size_t step = std::max<std::size_t>(1, beams.size() / static_cast<std::size_t>(o.beams));
    for (std::size_t i = 0; i < beams.size(); i += step) {
      const LineScan::Beam& beam = beams[i];
      if (!beam.has_line || !(beam.s > 0)) continue;
      const double sigma_m = rangeSigma(beam);
      if (!(sigma_m < o.most_sigma_m)) continue;
      const Eigen::Vector2d at = reference.map_from_scan * beam.point_m.cast<double>();
      Cell& cell = cells[{static_cast<int>(std::floor(at.x() / o.cell_m)),
                          static_cast<int>(std::floor(at.y() / o.cell_m))}];
      const Eigen::Vector2d normal = rotation * beam.line.cast<double>().normalized();
      for (const Viewer& viewer : viewers) {
        const Says says = ask(viewer, at, sigma_m, o);
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

std::vector<Viewer> viewersOf(const std::vector<Reference>& references) {
  std::vector<Viewer> viewers;
  for (const Reference& r : references) viewers.push_back({r.scan, r.map_from_scan.inverse()});
  return viewers;
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
