#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace omnifleet::flow {

/// Mean colours of the cells (kSide × kSide pixels) of an image.
struct CellColours {
  static constexpr int kSide = 4;
  const cv::Mat3f& means;
  const std::vector<cv::Range>& known;  ///< columns of each row of cells that have a value
};

/// Grey image pyramid; each level has half the size of the one before. Bit by bit equal to cv::pyrDown, in a
/// third of the time, and only where requested. If the cells of an image are given, the level of their size
/// is made of them. Buffers are reused.
class Pyramid {
 public:
  explicit Pyramid(int levels = 4) : levels_(static_cast<std::size_t>(levels)) {}

  /// Builds all levels of the whole image.
  /// @param image CV_8UC3 (BGR) or CV_8UC1; copied
  void build(const cv::Mat& image);
  /// Builds all levels within the given rectangles. A level needs two pixels of the one below around its own,
  /// so coarser levels reach less far (lossOf()). Elsewhere the levels keep their previous content.
  void build(const cv::Mat& image, const std::vector<cv::Rect>& where);
  /// Builds level kCellLevel and above from the cells of the image, without reading its pixels.
  /// @param where rectangles for the levels below kCellLevel
  /// @param around rectangles for kCellLevel and the levels above
  void build(const cv::Mat& image, const std::vector<cv::Rect>& where, const CellColours& cells,
             const std::vector<cv::Rect>& around);
  static constexpr int kCellLevel = 2;
  /// Pixel x of a level corresponds to x · 2^level + offset_px(level) of the finest level, in both
  /// directions.
  float offset_px(int level) const { return of_cells_ && level >= kCellLevel ? kCellOffset_px : 0.0f; }
  /// Pixels of the finest level by which the coarsest of `levels` levels is smaller, on each side that is not
  /// an edge of the image.
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
  std::vector<std::uint16_t> rows_;  ///< the last five rows, smoothed
};

}  // namespace omnifleet::flow
