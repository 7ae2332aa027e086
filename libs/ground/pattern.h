#pragma once

#include <vector>

#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Things that are patterned all over, printed boxes as much as chequered ones: their dark patches are of
/// them, and no shade on the floor. The buffers are kept.
class Pattern {
 public:
  explicit Pattern(int image_width)
      : columns_(static_cast<std::size_t>(image_width)), reach_px_(image_width / kReachShare) {}

  /// Along a line through shade, or through a thing of plain faces with its shade, the brightness rises and
  /// falls once or twice, along one through a pattern again and again.
  bool isOn(const Blob& region, const FloorFrame& frame) { return turns(region, frame) >= kLeastTurns; }

  /// How often the brightness turns between rising and falling, by more than kStep of the floor's and than
  /// noise does: along the rows and along the columns of a region, whichever is less, a mean by length.
  float turns(const Blob& region, const FloorFrame& frame);

  /// Pixels of a region that have the mark `shade` get the bits of `core` too where along their row or along
  /// their column pixels lie to both sides that have these, no farther apart than patches of a pattern are
  /// wide.
  /// @param marks of the region's pixels; changed
  void fillBetween(const Blob& region, std::uint8_t core, std::uint8_t shade, cv::Mat1b& marks);

 private:
  static constexpr float kLeastTurns = 1.5f;
  static constexpr int kReachShare = 48;  ///< of the image's width: pixels from core to core

  /// Along one line.
  struct Line {
    int last = -1, length = 0, turns = 0, direction = 0;
    int low = 0, high = 0;

    void begin(int value) {
      length = turns = direction = 0;
      low = high = value;
    }
    void add(int value, int step);
  };
  /// Of all lines so far.
  struct Mean {
    float sum = 0.0f, weight = 0.0f;
    void add(const Line& line) {
      sum += static_cast<float>(line.turns * line.length);
      weight += static_cast<float>(line.length);
    }
    float value() const { return weight > 0.0f ? sum / weight : 0.0f; }
  };

  std::vector<Line> columns_;
  int reach_px_;
};

}  // namespace omnifleet::ground
