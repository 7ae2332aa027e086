#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::flow {

/// Mean colours of an image's cells of kSide × kSide pixels.
struct CellColours {
  static constexpr int kSide = 4;
  const cv::Mat3f& means;
  const std::vector<cv::Range>& known;  ///< columns of each row of cells that hold something
};

/// Grey image pyramid, each level half the size of the one before: bit by bit what cv::pyrDown gives, at a
/// third of its time, and only where it is asked for. Where an image's cells are known, the level of their
/// size is made of them. Buffers are reused.
class Pyramid {
 public:
  explicit Pyramid(int levels = 4) : levels_(static_cast<std::size_t>(levels)) {}

  /// All of an image.
  /// @param image CV_8UC3 (BGR) or CV_8UC1; copied
  void build(const cv::Mat& image);
  /// What lies in some rectangles within the image; a level needs two pixels of the one below around its own,
  /// so that the coarser ones reach less far (lossOf()). Elsewhere the levels keep what they held.
  void build(const cv::Mat& image, const std::vector<cv::Rect>& where);
  /// The same, from level kCellLevel on from the image's cells: no pixel is looked at for it.
  /// @param where for the levels below it. @param around for it and those above
  void build(const cv::Mat& image, const std::vector<cv::Rect>& where, const CellColours& cells,
             const std::vector<cv::Rect>& around);
  static constexpr int kCellLevel = 2;
  /// Pixel x of a level lies at x · 2^level + offset_px(level) of the finest, in both directions.
  float offset_px(int level) const { return of_cells_ && level >= kCellLevel ? kCellOffset_px : 0.0f; }
  /// Pixels of the finest level by which the coarsest of so many may hold less, to each side that is not the
  /// image's.
  static int lossOf(int levels) { return 3 * ((1 << (levels - 1)) - 1); }

  int size() const { return static_cast<int>(levels_.size()); }
  const cv::Mat1b& level(int k) const { return levels_[static_cast<std::size_t>(k)]; }
  const cv::Mat1b& grey() const { return levels_.front(); }

 private:
  static constexpr float kCellOffset_px = 0.5f * (CellColours::kSide - 1);

  void create(cv::Size size);
  void build(const cv::Mat& image, const std::vector<cv::Rect>& where, std::size_t levels);
  void takeGreysOf(const cv::Mat& image, const cv::Rect& rect);
  cv::Rect takeCells(const CellColours& cells, const cv::Rect& around);
  cv::Rect halve(const cv::Mat1b& fine, const cv::Rect& where, cv::Mat1b& coarse);

  std::vector<cv::Mat1b> levels_;
  bool of_cells_ = false;
  std::vector<std::uint16_t> rows_;  ///< the last five, smoothed
};

}  // namespace omnifleet::flow
