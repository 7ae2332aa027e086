#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/strip.h"

namespace omnifleet::ground {

/// A mask with one bit per pixel: bit x % 64 of word x / 64 of a row. It is surrounded by zeros, as far as
/// the functions of bit_ops.h read.
class BitMask {
 public:
  using Word = std::uint64_t;
  static constexpr int kBits = 64;
  static constexpr int kQuad = 4;        ///< words processed at once; rows hold a multiple of them
  static constexpr int kMargin = 8;      ///< zero rows above and below
  static constexpr int kBeside = kQuad;  ///< zero words on each side

  explicit BitMask(cv::Size image);

  cv::Size image() const { return image_; }
  std::ptrdiff_t step() const { return step_; }  ///< words from row to row
  Word* row(int y) { return words_.data() + (y + kMargin) * step_ + kBeside; }
  const Word* row(int y) const { return words_.data() + (y + kMargin) * step_ + kBeside; }
  bool at(int x, int y) const { return (row(y)[x / kBits] >> (x % kBits) & 1U) != 0; }

  /// Clears the whole mask.
  void clear() { std::fill(words_.begin(), words_.end(), Word{0}); }
  /// Clears columns [begin, end) of a row.
  void clear(int y, int begin, int end);
  void set(int y, int begin, int end);
  /// Clears the pixels of columns [begin, end) of a row that are not set in `other`.
  void keep(int y, int begin, int end, const BitMask& other);
  /// Sets the pixels of columns [begin, end) of a row that are not set in `other`.
  void setWithout(int y, int begin, int end, const BitMask& other);

 private:
  template <typename Change>
  void change(int y, int begin, int end, Change change);

  cv::Size image_;
  std::ptrdiff_t step_;
  std::vector<Word> words_;
};

/// The strips of a frame as spans of words.
class BitArea {
 public:
  /// Words [begin, end) of the pixel rows of one row of cells; multiples of BitMask::kQuad.
  struct Span {
    int cell_row, begin, end;
  };

  explicit BitArea(cv::Size image) : selected_({image.width, image.height / FloorView::kCell}) {}

  /// @param strips ordered by rows of cells from top to bottom, then from left to right
  void cover(const std::vector<Strip>& strips);
  const std::vector<Span>& spans() const { return spans_; }
  /// Bits that belong to the strips in a row of cells. Valid within the spans.
  const BitMask::Word* selectedBits(int cell_row) const { return selected_.row(cell_row); }

 private:
  BitMask selected_;  ///< one row per row of cells
  std::vector<Span> spans_;
};

/// Sets the bits of the pixels that are not 0. The area must have been cleared before.
void pack(const std::vector<Strip>& strips, const cv::Mat1b& mask, BitMask& bits);
/// Writes 0 or 255 to each pixel of the strips.
void unpack(const std::vector<Strip>& strips, const BitMask& bits, cv::Mat1b& mask);
/// Sets all bits of the area to 0.
void clear(const BitArea& area, BitMask& bits);

}  // namespace omnifleet::ground
