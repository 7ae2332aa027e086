#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Detects objects that are patterned all over, such as printed or chequered boxes. Their dark patches belong
/// to them and are no shadow on the floor. Along a line through a shadow, or through an object of plain faces
/// and its shadow, the brightness rises and falls once or twice. Along a line through a pattern it does so
/// repeatedly.
class Pattern {
 public:
  explicit Pattern(cv::Size image);

  /// Finds where the brightness turns along the rows and columns of a region, by more than kStep of the
  /// floor's brightness and more than the noise.
  void find(const Blob& region, const FloorFrame& frame);
  /// Number of turns per line of the last region: mean weighted by line length, over the rows or over the
  /// columns, whichever is less.
  float turns() const { return turns_; }
  /// Is the whole of the last region patterned?
  bool isAllOver() const { return turns_ >= kLeastTurns; }

  /// Sets the bits of `core` in pixels of a region that have the mark `shadow` and belong to a pattern, both
  /// along the row and along the column. Such pixels lie between or right beside consecutive edges up and
  /// down that are as far apart as patches are wide. Narrower patches are the texture of a floor.
  /// @param marks of the region's pixels; changed
  void fill(const Blob& region, const FloorFrame& frame, std::uint8_t core, std::uint8_t shadow,
            cv::Mat1b& marks);

 private:
  static constexpr float kLeastTurns = 1.5f;
  static constexpr int kLeastShare = 160,
                       kMostShare = 32;  ///< image width ÷ these: limits of the width of a patch
  static constexpr int kNoStep = -1;

  /// Intensity edges along a line, alternately rising and falling.
  struct Steps {
    int begin = 0;  ///< of the line
    int taken = 0;
    std::array<int, 4> last = {kNoStep, kNoStep, kNoStep,
                               kNoStep};  ///< two objects side by side in one shadow make three

    void add(int at_px);
    int turns() const { return std::max(0, taken - 1); }
    /// The range in which the last edges show patches of a pattern, of such widths; empty where they do not.
    cv::Range patches(int least_px, int most_px) const;
  };
  /// Lines along the columns of the image, updated row by row. Values of neighbouring columns lie side by
  /// side.
  struct Columns {
    explicit Columns(int width);
    std::vector<std::int16_t> requested;  ///< not 0 for requested columns
    std::vector<std::int16_t> low, high, direction, end, patched_end;
    std::vector<std::int16_t> last_step,
        in_a_row;                       ///< row of the last edge; number of consecutive patches so far
    std::vector<std::int16_t> patched;  ///< not 0 where there were enough consecutive patches
    std::vector<Steps> steps;
  };
  /// Mean over all lines so far.
  struct Mean {
    float sum = 0.0f, weight = 0.0f;
    void add(const Steps& line, int end) {
      const auto length = static_cast<float>(end - line.begin);
      sum += static_cast<float>(line.turns()) * length;
      weight += length;
    }
    float value() const { return weight > 0.0f ? sum / weight : 0.0f; }
  };

  int stepOf(const Blob& region, const FloorFrame& frame) const;
  const std::int16_t* brightnessOf(const FloorFrame& frame, const Run& run);
  Steps findAlongRow(const Run& run, const FloorFrame& frame, int step);
  template <typename Visit>
  void forRows(const Blob& region, const FloorFrame& frame, int step, const cv::Range& columns, Visit visit);
  cv::Range requestPatched(const Blob& region, const FloorFrame& frame, int step);
  cv::Range requestedIn(const cv::Range& columns) const;
  Mean findAlongColumns(const Blob& region, const FloorFrame& frame, int step, const cv::Range& requested);
  void takeEvents(const Run& run, Mean& mean);

  cv::Mat1b lines_;  ///< pixels of the last region: kAlongRow, kAlongColumn where they belong to a pattern
  Columns columns_;
  std::vector<std::int16_t> brightness_, events_;  ///< per pixel of a run
  int least_px_, most_px_;
  float turns_ = 0.0f;
};

}  // namespace omnifleet::ground
