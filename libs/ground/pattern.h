#pragma once

#include <array>
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
  explicit Pattern(cv::Size image)
      : lines_(image, std::uint8_t{0}),
        columns_(static_cast<std::size_t>(image.width)),
        least_px_(image.width / kLeastShare),
        most_px_(image.width / kMostShare) {}

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

  /// Where the steps along a line are, rising and falling in turn.
  struct Line {
    int begin = -1, end = -1, turns = 0, direction = 0;
    int low = 0, high = 0;
    std::array<int, 4> steps = {kNoStep, kNoStep, kNoStep, kNoStep};  ///< the last ones: two things side by
    ///< side in one shadow make three
    int patched_end = 0;

    void start(int at_px, int value) {
      *this = {};
      begin = end = patched_end = at_px;
      low = high = value;
    }
    /// @return does a step begin here, the other way than the last?
    bool add(int at_px, int value, int step);
    /// What the last steps show to be patches of a pattern, of such widths; empty where they do not.
    cv::Range patches(int least_px, int most_px) const;
  };
  /// Of all lines so far.
  struct Mean {
    float sum = 0.0f, weight = 0.0f;
    void add(const Line& line) {
      const auto length = static_cast<float>(line.end - line.begin);
      sum += static_cast<float>(line.turns) * length;
      weight += length;
    }
    float value() const { return weight > 0.0f ? sum / weight : 0.0f; }
  };

  /// Only the rows and columns of `asked`.
  void find(const Blob& region, const FloorFrame& frame, const cv::Rect& asked);
  Line findAlongRow(const Run& run, const cv::Vec3b* pixel, int step);

  cv::Mat1b lines_;  ///< of the last region's pixels: kAlongRow, kAlongColumn where they are of a pattern
  std::vector<Line> columns_;
  int least_px_, most_px_;
  float turns_ = 0.0f;
};

}  // namespace omnifleet::ground
