#include "ground/bit_mask.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

namespace omnifleet::ground {

namespace {

constexpr int kBits = BitMask::kBits;
constexpr int kPiece_px = 16;  // pixels in a vector

int quadsFor(int columns) {
  constexpr int kQuadBits = kBits * BitMask::kQuad;
  return (columns + kQuadBits - 1) / kQuadBits;
}

/// Eight pixels of 0 or 255 for each value of a byte of bits.
struct Bytes {
  std::array<std::array<std::uint8_t, 8>, 256> of{};
  Bytes() {
    for (std::size_t bits = 0; bits < of.size(); ++bits)
      for (std::size_t k = 0; k < 8; ++k) of[bits][k] = (bits >> k & 1U) != 0 ? 255 : 0;
  }
};

/// Bits [begin, end) of a word, 0 ≤ begin < end ≤ 64.
BitMask::Word bitsBetween(int begin, int end) {
  const BitMask::Word up_to_end = ~BitMask::Word{0} >> (kBits - end);
  return up_to_end & (~BitMask::Word{0} << begin);
}

}  // namespace

BitMask::BitMask(cv::Size image)
    : image_(image),
      step_(quadsFor(image.width) * kQuad + 2 * kBeside),
      words_(static_cast<std::size_t>(step_) * static_cast<std::size_t>(image.height + 2 * kMargin), 0) {}

template <typename Change>
void BitMask::change(int y, int begin, int end, Change change) {
  Word* words = row(y);
  for (int k = begin / kBits; k * kBits < end; ++k)
    change(words[k], k, bitsBetween(std::max(0, begin - k * kBits), std::min(kBits, end - k * kBits)));
}

void BitMask::clear(int y, int begin, int end) {
  change(y, begin, end, [](Word& word, int, Word which) { word &= ~which; });
}

void BitMask::set(int y, int begin, int end) {
  change(y, begin, end, [](Word& word, int, Word which) { word |= which; });
}

void BitMask::keep(int y, int begin, int end, const BitMask& other) {
  const Word* kept = other.row(y);
  change(y, begin, end, [kept](Word& word, int k, Word which) { word &= kept[k] | ~which; });
}

void BitMask::setWithout(int y, int begin, int end, const BitMask& other) {
  const Word* left_out = other.row(y);
  change(y, begin, end, [left_out](Word& word, int k, Word which) { word |= which & ~left_out[k]; });
}

void BitArea::cover(const std::vector<Strip>& strips) {
  for (const Span& span : spans_)
    std::fill(selected_.row(span.cell_row) + span.begin, selected_.row(span.cell_row) + span.end,
              BitMask::Word{0});
  spans_.clear();
  constexpr int kQuadBits = kBits * BitMask::kQuad;
  for (const Strip& strip : strips) {
    if (strip.begin_px >= strip.end_px) continue;
    const int begin = strip.begin_px / kQuadBits * BitMask::kQuad,
              end = quadsFor(strip.end_px) * BitMask::kQuad;
    if (!spans_.empty() && spans_.back().cell_row == strip.cell_row && spans_.back().end >= begin)
      spans_.back().end = std::max(end, spans_.back().end);
    else
      spans_.push_back({strip.cell_row, begin, end});
    BitMask::Word* words = selected_.row(strip.cell_row);
    for (int k = strip.begin_px / kBits; k * kBits < strip.end_px; ++k)
      words[k] |=
          bitsBetween(std::max(0, strip.begin_px - k * kBits), std::min(kBits, strip.end_px - k * kBits));
  }
}

void pack(const std::vector<Strip>& strips, const cv::Mat1b& mask, BitMask& bits) {
  const cv::v_uint8x16 zero = cv::v_setzero_u8();
  for (const Strip& strip : strips) {
    for (int y = strip.cell_row * FloorView::kCell; y < (strip.cell_row + 1) * FloorView::kCell; ++y) {
      const std::uint8_t* pixels = mask.ptr(y);
      BitMask::Word* words = bits.row(y);
      const auto packOne = [&](int x) { words[x / kBits] |= BitMask::Word{pixels[x] != 0} << (x % kBits); };
      int x = strip.begin_px;
      for (; x < strip.end_px && x % kPiece_px != 0; ++x) packOne(x);
      for (; x + kPiece_px <= strip.end_px; x += kPiece_px) {
        const auto set = static_cast<BitMask::Word>(cv::v_signmask(cv::v_load(pixels + x) != zero));
        words[x / kBits] |= set << (x % kBits);
      }
      for (; x < strip.end_px; ++x) packOne(x);
    }
  }
}

void unpack(const std::vector<Strip>& strips, const BitMask& bits, cv::Mat1b& mask) {
  static const Bytes kBytes;
  for (const Strip& strip : strips) {
    for (int y = strip.cell_row * FloorView::kCell; y < (strip.cell_row + 1) * FloorView::kCell; ++y) {
      std::uint8_t* pixels = mask.ptr(y);
      const BitMask::Word* words = bits.row(y);
      int x = strip.begin_px;
      for (; x < strip.end_px && x % 8 != 0; ++x) pixels[x] = bits.at(x, y) ? 255 : 0;
      for (; x + 8 <= strip.end_px; x += 8)
        std::memcpy(pixels + x, kBytes.of[words[x / kBits] >> (x % kBits) & 255U].data(), 8);
      for (; x < strip.end_px; ++x) pixels[x] = bits.at(x, y) ? 255 : 0;
    }
  }
}

void clear(const BitArea& area, BitMask& bits) {
  for (const BitArea::Span& span : area.spans())
    for (int y = span.cell_row * FloorView::kCell; y < (span.cell_row + 1) * FloorView::kCell; ++y)
      std::fill(bits.row(y) + span.begin, bits.row(y) + span.end, BitMask::Word{0});
}

}  // namespace omnifleet::ground
