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

/// The lines along which walls stand on the floor that are lit as it is: neither hue nor brightness tells one
/// from the other, but where they meet there is a step, of one sign along one wall, of which single bearings
/// show little and all of them together enough. Walls are straight, so a line at the distance d in the
/// direction α is seen at tan ψ = H/d·cos(φ − α) below the horizon at the bearing φ; the steps are summed up
/// along each (Hough 1962; Duda and Hart 1972), the plainest line is taken with the bearings that bear it
/// out, and the next one is looked for in the others. Beyond a wall's foot there is nothing but the wall:
/// where another line lies beyond, as on a floor of tiles, that counts.
class WallFoot {
 public:
  static constexpr int kBearings = 360;  ///< of the full turn

  WallFoot(const lens::Camera& camera, const FloorView& floor_view);

  /// By sector of the Horizon, from 1: does the floor seem to go on up to the horizon, and what is above it
  /// down into the floor?
  using Sectors = std::array<std::uint8_t, Horizon::kSectors + 1>;
  /// @param image CV_8UC3 or CV_8UC1 of the view's size @param objects 0 where nothing is in the way
  /// @param climbed only there it is looked for lines
  void find(const cv::Mat& image, const cv::Mat1b& objects, const Sectors& climbed);
  void forget() { any_ = false; }
  bool any() const { return any_; }
  /// Metres from the camera's foot, by bearing 2πk/kBearings in base_link; infinite where none is found.
  const std::vector<float>& range_m() const { return range_m_; }
  /// What the cell shows lies beyond the line.
  bool isBehind(const cv::Point& cell) const;

 private:
  static constexpr int kWide = 75;  ///< bearings to either side of a line's own that it is looked for in
  struct Step {
    std::int16_t u, v;  ///< u < 0 where the view shows no floor
  };
  /// Sums over a bearing's steps before each.
  struct Sum {
    float brightness, count, hidden;
  };
  struct Line {
    int direction2 = 0;  ///< bearings, times two
    int step2 = 0;       ///< where it is seen in that direction, times two
    float score = 0.0f;  ///< σ, negative where the wall is darker
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
  void addUp(int direction);
  Line findLine();
  Line outermost(Line line) const;
  float rangeOf(const Line& line, int bearing) const;
  bool accept(const Line& line);
  void meet();

  double height_m_;
  double step_rad_ = 0.0;
  int steps_ = 0, window_ = 0;        ///< of a bearing; of either side of a step, half of it
  std::vector<Step> pixels_;          ///< by bearing, then from the foot outward
  std::vector<std::uint8_t> sector_;  ///< by bearing
  cv::Mat_<cv::Vec2s> places_;        ///< by cell: bearing (negative: none), step
  std::vector<float> curves_;    ///< by half bearings beside a line's own and its half steps there: its step
  std::vector<Sum> sums_;        ///< one more per bearing
  std::vector<float> contrast_;  ///< by bearing and step, in σ; 0 where it is not known
  std::vector<float> sorted_, scores_;
  std::vector<std::uint8_t> open_;  ///< by bearing: a line is looked for there
  std::vector<Line> lines_;
  std::vector<int> line_of_;  ///< by bearing, the index of its line; negative: none
  std::vector<float> range_m_;
  bool any_ = false;
};

}  // namespace omnifleet::ground
