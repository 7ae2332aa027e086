#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/strip.h"

namespace omnifleet::ground {

/// A mask of one bit per pixel: bit x % 64 of a row's word x / 64. Around it lie zeros, as far as the
/// functions of bit_ops.h look.
class BitMask {
 public:
  using Word = std::uint64_t;
  static constexpr int kBits = 64;
  static constexpr int kQuad = 4;        ///< words that are handled at once: a row has a multiple of them
  static constexpr int kMargin = 8;      ///< rows above and below
  static constexpr int kBeside = kQuad;  ///< words to each side

  explicit BitMask(cv::Size image);

  cv::Size image() const { return image_; }
  std::ptrdiff_t step() const { return step_; }  ///< words from row to row
  Word* row(int y) { return words_.data() + (y + kMargin) * step_ + kBeside; }
  const Word* row(int y) const { return words_.data() + (y + kMargin) * step_ + kBeside; }
  bool at(int x, int y) const { return (row(y)[x / kBits] >> (x % kBits) & 1U) != 0; }

  /// All of it.
  void clear() { std::fill(words_.begin(), words_.end(), Word{0}); }
  /// Clears columns [begin, end) of a row.
  void clear(int y, int begin, int end);
  void set(int y, int begin, int end);
  /// Clears what is not in `other`, likewise.
  void keep(int y, int begin, int end, const BitMask& other);
  /// Sets what is not in `other`, likewise.
  void setWithout(int y, int begin, int end, const BitMask& other);

 private:
  template <typename Change>
  void change(int y, int begin, int end, Change change);

  cv::Size image_;
  std::ptrdiff_t step_;
  std::vector<Word> words_;
};

/// The strips as words.
class BitArea {
 public:
  /// Words [begin, end) of the rows of a row of cells; multiples of BitMask::kQuad.
  struct Span {
    int cell_row, begin, end;
  };

  explicit BitArea(cv::Size image) : looked_at_({image.width, image.height / FloorView::kCell}) {}

  /// By rows of cells from top to bottom, left to right.
  void cover(const std::vector<Strip>& strips);
  const std::vector<Span>& spans() const { return spans_; }
  /// Bits of a row of cells that belong to the strips; in the spans.
  const BitMask::Word* lookedAt(int cell_row) const { return looked_at_.row(cell_row); }

 private:
  BitMask looked_at_;  ///< a row per row of cells
  std::vector<Span> spans_;
};

/// Bits of the pixels that are not 0, where the area was cleared before.
void pack(const std::vector<Strip>& strips, const cv::Mat1b& mask, BitMask& bits);
/// 0 or 255 for each pixel of the strips.
void unpack(const std::vector<Strip>& strips, const BitMask& bits, cv::Mat1b& mask);
/// Sets all bits of the area to 0.
void clear(const BitArea& area, BitMask& bits);

}  // namespace omnifleet::ground
