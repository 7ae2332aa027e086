#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Things that are patterned all over, printed boxes as much as chequered ones: their dark patches are of
/// them, and no shade on the floor. Along a line through shade, or through a thing of plain faces with its
/// shade, the brightness rises and falls once or twice, along one through a pattern again and again.
class Pattern {
 public:
  explicit Pattern(cv::Size image);

  /// Looks where the brightness turns, by more than kStep of the floor's and than noise does, along the rows
  /// and the columns of a region.
  void find(const Blob& region, const FloorFrame& frame);
  /// How often it turns along a line of the last region: a mean by the lines' lengths, of the rows or of the
  /// columns, whichever is less.
  float turns() const { return turns_; }
  /// Is the whole of the last region patterned?
  bool isAllOver() const { return turns_ >= kLeastTurns; }

  /// Pixels of a region that have the mark `shade` get the bits of `core` too where they are of a
  /// pattern: between or right beside steps up and down that follow each other, as far apart as patches are
  /// wide (what is narrower is the grain of a floor), both along the row and along the column.
  /// @param marks of the region's pixels; changed
  void fill(const Blob& region, const FloorFrame& frame, std::uint8_t core, std::uint8_t shade,
            cv::Mat1b& marks);

 private:
  static constexpr float kLeastTurns = 1.5f;
  static constexpr int kLeastShare = 160, kMostShare = 32;  ///< of the image's width: how wide patches are
  static constexpr int kNoStep = -1;

  /// Where the brightness steps along a line, rising and falling in turn.
  struct Steps {
    int begin = 0;  ///< of the line
    int taken = 0;
    std::array<int, 4> last = {kNoStep, kNoStep, kNoStep, kNoStep};  ///< two things side by side in one
    ///< shadow make three

    void add(int at_px);
    int turns() const { return std::max(0, taken - 1); }
    /// What the last ones show to be patches of a pattern, of such widths; empty where they do not.
    cv::Range patches(int least_px, int most_px) const;
  };
  /// The lines along the columns of a row of pixels. What every pixel asks for lies side by side.
  struct Columns {
    explicit Columns(int width);
    std::vector<std::int16_t> asked;  ///< not 0 where one is
    std::vector<std::int16_t> low, high, direction, end, patched_end;
    std::vector<std::int16_t> last_step, in_a_row;  ///< its row; patches so far that follow one another
    std::vector<std::int16_t> patched;              ///< not 0 where there were enough of them
    std::vector<Steps> steps;
  };
  /// Of all lines so far.
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
  cv::Range askForPatched(const Blob& region, const FloorFrame& frame, int step);
  cv::Range askedIn(const cv::Range& columns) const;
  Mean findAlongColumns(const Blob& region, const FloorFrame& frame, int step, const cv::Range& asked);
  void takeNews(const Run& run, Mean& mean);

  cv::Mat1b lines_;  ///< of the last region's pixels: kAlongRow, kAlongColumn where they are of a pattern
  Columns columns_;
  std::vector<std::int16_t> brightness_, news_;  ///< of a run's pixels
  int least_px_, most_px_;
  float turns_ = 0.0f;
};

}  // namespace omnifleet::ground
