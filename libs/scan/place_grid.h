#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::scan {

/// What a set of scans knows about space, and its upper bounds over square windows (Hess et al. 2016, section
/// V-B: precomputed grids). The value of a cell is, in units of 1/kUnit:
///  - near a surface: the likelihood that a beam ends there, exp(−½(max(0, d − cell/2)/σ)²) with the distance
///  d
///    and σ² = (1.25·cell)² + (σ_s·r²)²; 0 beyond cell/2 + 2σ;
///  - elsewhere in space that a scan has seen as free: minus the free weight;
///  - in space that no scan has seen: unknown.
/// The bounds hold for each cell, called the corner of the window, the largest value in
/// [x, x + w) × [y, y + w), and whether all of the window is known. The widths w of windows number 0, 1, 2, …
/// are 1, –, 2, 3, 4, 6, 8, 12, … cells; number 1 is a copy of number 0.
class PlaceGrid {
 public:
  static constexpr int kUnit = 63;
  /// Codes from here on: every cell of the window is known, the largest value is code − kZero. Codes below:
  /// some cell is unknown, the code is the largest value or 0.
  static constexpr int kKnown = 64, kZero = 128;
  static constexpr int kSurface = 57;  ///< least value of a surface

  /// @param levels of the search tree; the widest window has 4·2^(levels − 1) cells
  /// @param free_weight 0..1 @param max_range_m longer beams are left out
  /// The cell is doubled until the grid has at most four million cells.
  void build(const std::vector<Reference>& references, double cell_m, int levels, double free_weight,
             double max_range_m);

  bool empty() const { return cells_.empty(); }
  double cell() const { return cell_m_; }
  /// Coordinates in cells, counted from the corner of the grid.
  Eigen::Vector2d inCells(const Eigen::Vector2d& map_m) const { return (map_m - corner_m_) / cell_m_; }
  /// Extent of all surfaces and scanners, in cells.
  const Eigen::Vector2i& low() const { return low_; }
  const Eigen::Vector2i& high() const { return high_; }
  /// 0 outside the grid: unknown.
  std::uint8_t code(int window, int x, int y) const {
    if (static_cast<unsigned>(x) >= width_ || static_cast<unsigned>(y) >= height_) return 0;
    return cells_[static_cast<std::size_t>(window) * size_ + static_cast<std::size_t>(y) * width_ +
                  static_cast<unsigned>(x)];
  }

  /// True if some cell of the window with this code belongs to a surface.
  static bool hasSurface(int code) { return (code < kKnown ? code : code - kZero) >= kSurface; }
  unsigned width() const { return width_; }
  unsigned height() const { return height_; }
  /// All codes of windows of one width, row by row.
  const std::uint8_t* codes(int window) const {
    return cells_.data() + static_cast<std::size_t>(window) * size_;
  }

  /// True if some scanner saw a cell of the window of 2^level × 2^level cells as free, or stood close to it.
  bool hasFree(int level, int x, int y) const {
    if (static_cast<unsigned>(x) >= width_ || static_cast<unsigned>(y) >= height_) return false;
    return free_[static_cast<std::size_t>(level) * size_ + static_cast<std::size_t>(y) * width_ +
                 static_cast<unsigned>(x)] != 0;
  }

  /// False for a beam without a range, beyond `max_range_m`, or with a range uncertainty above three cells.
  static bool usable(const LineScan::Beam& beam, double max_range_m, double cell_m);

 private:
  struct Point {
    Eigen::Vector2d map_m;
    double sigma_m;
  };
  struct Kernel {
    int radius = 0;
    std::vector<std::uint8_t> values;
  };
  void findSurfaces(const Reference& reference, double max_range_m);
  void layOut(const std::vector<Reference>& references, int margin);
  void makeKernels();
  void stamp(const Point& point);
  void markFree(const Reference& reference, double max_range_m);
  void markBody(const Reference& reference);
  void combine(double free_weight);
  template <typename Merge>
  void reduce(std::vector<std::uint8_t>& cells, int from, int to, int step, const Merge& merge) const;
  void reduceAll(int levels);

  double cell_m_ = 0.0;
  Eigen::Vector2d corner_m_ = Eigen::Vector2d::Zero();
  Eigen::Vector2i low_ = Eigen::Vector2i::Zero(), high_ = Eigen::Vector2i::Zero();
  unsigned width_ = 0, height_ = 0;
  std::size_t size_ = 0;
  std::vector<std::uint8_t> cells_;  ///< windows × height × width
  std::vector<std::uint8_t> free_;   ///< levels × height × width
  // Buffers of build().
  std::vector<Kernel> kernels_;
  std::vector<Point> points_;
  std::vector<std::uint8_t> stamped_;
  std::vector<Eigen::Vector2d> outline_;
  std::vector<std::pair<int, float>> crossings_;  ///< row and column, in cells
};

}  // namespace omnifleet::scan
