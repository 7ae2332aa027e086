#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "ground/horizon.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// The lines along which walls that are lit like the floor stand on it. Neither hue nor brightness
/// distinguishes such a wall from the floor. Where they resolveCorners there is an intensity edge of one sign
/// along one wall. Single bearings show little of it, all bearings together enough. Walls are straight, so a
/// line at distance d in direction α is seen at tan ψ = H/d·cos(φ − α) below the horizon at bearing φ. The
/// edges are summed along each such line (Hough 1962; Duda and Hart 1972). The strongest line is taken
/// together with the bearings that confirm it, and the next one is searched for in the others. Beyond the
/// foot of a wall there is only the wall. Where another line lies beyond, as on a floor of tiles, the farther
/// line is taken.
class WallFoot {
 public:
  static constexpr int kBearings = 360;  ///< of the full turn

  WallFoot(const lens::Camera& camera, const FloorView& floor_view);

  /// By Horizon sector, from 1: does the floor seem to extend up to the horizon, and what is above it down
  /// into the floor?
  using Sectors = std::array<std::uint8_t, Horizon::kSectors + 1>;
  /// @param image CV_8UC3 or CV_8UC1 of the view's size @param objects 0 where nothing occludes the view
  /// @param leaked sectors in which lines are searched for
  void find(const cv::Mat& image, const cv::Mat1b& objects, const Sectors& leaked);
  void forget() { any_ = false; }
  bool any() const { return any_; }
  /// Distance of the line, metres from the camera foot, by bearing 2πk/kBearings in base_link; infinite where
  /// none is found.
  const std::vector<float>& range_m() const { return range_m_; }
  /// Does the cell show what lies beyond the line?
  bool isBehind(const cv::Point& cell) const;

 private:
  static constexpr int kWide =
      75;  ///< bearings to either side of a line's own, over which it is searched for
  struct Step {
    std::int16_t u, v;  ///< u < 0 where the view shows no floor
  };
  /// Cumulative sums over the steps of a bearing, before each step.
  struct Sum {
    float brightness, count, hidden;
  };
  struct Line {
    int direction2 = 0;  ///< bearings times two
    int step2 = 0;       ///< step at which it is seen in that direction, times two
    float score = 0.0f;  ///< σ; negative where the wall is darker
  };
  void layOutSteps(const lens::Camera& camera, const FloorView& floor_view);
  void layOutLines();
  void layOutCells(const lens::Camera& camera, const FloorView& floor_view);
  void readSteps(const cv::Mat& image, const cv::Mat1b& objects);
  float stepBetween(int bearing, int at, int from, int to) const;
  float contrastAt(int bearing, int step) const;
  bool measureContrasts();
  const float* curve(int beside2) const { return curves_.data() + std::abs(beside2) * 2 * steps_; }
  float stepOf(const Line& line, int bearing) const;
  float evidenceOf(const Line& line, int bearing) const;
  float scoreOf(const Line& line) const;
  void sumAlongLines(int direction);
  Line findLine();
  Line outermost(Line line) const;
  float rangeOf(const Line& line, int bearing) const;
  bool accept(const Line& line);
  void resolveCorners();

  double height_m_;
  double step_rad_ = 0.0;
  int steps_ = 0, window_ = 0;  ///< steps per bearing; half of what is compared on either side of a step
  std::vector<Step> pixels_;    ///< by bearing, then from the foot outward
  std::vector<std::uint8_t> sector_;  ///< by bearing
  cv::Mat_<cv::Vec2s> places_;        ///< by cell: bearing (negative: none), step
  std::vector<float>
      curves_;             ///< step of a line, by half bearings beside the line's own and by half steps there
  std::vector<Sum> sums_;  ///< steps_ + 1 per bearing
  std::vector<float> contrast_;  ///< by bearing and step, σ; 0 where unknown
  std::vector<float> sorted_, scores_;
  std::vector<std::uint8_t> open_;  ///< by bearing: a line is searched for there
  std::vector<Line> lines_;
  std::vector<int> line_of_;  ///< by bearing, the index of its line; negative: none
  std::vector<float> range_m_;
  bool any_ = false;
};

}  // namespace omnifleet::ground
