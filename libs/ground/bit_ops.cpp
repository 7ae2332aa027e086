#include "ground/bit_ops.h"

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

/// 256 pixels of a row.
using Quad = std::uint64_t __attribute__((vector_size(32)));

/// A quad with the words before and behind each of its words, because neighbouring pixels cross word borders.
struct Neighbourhood {
  Quad before, here, behind;

  static OMNIFLEET_INLINE Neighbourhood at(const BitMask::Word* words) {
    return {lanes::load<Quad>(words - 1), lanes::load<Quad>(words), lanes::load<Quad>(words + 1)};
  }
  /// The quad shifted by k pixels, so that each pixel takes the value of its left or right neighbour; 0 < k <
  /// 64.
  OMNIFLEET_INLINE Quad left(int k) const { return here << k | before >> (BitMask::kBits - k); }
  OMNIFLEET_INLINE Quad right(int k) const { return here >> k | behind << (BitMask::kBits - k); }
};

struct Any {
  static OMNIFLEET_INLINE Quad of(const Quad& a, const Quad& b) { return a | b; }
};
struct All {
  static OMNIFLEET_INLINE Quad of(const Quad& a, const Quad& b) { return a & b; }
};

/// Combines (any or all) the square of side 2·radius + 1: first its columns, then the columns side by side.
template <typename Join>
OMNIFLEET_INLINE Quad joinSquare(const BitMask::Word* words, std::ptrdiff_t step, int radius) {
  Neighbourhood column = Neighbourhood::at(words);
  for (int k = 1; k <= radius; ++k) {
    const Neighbourhood above = Neighbourhood::at(words - k * step),
                        below = Neighbourhood::at(words + k * step);
    column = {Join::of(column.before, Join::of(above.before, below.before)),
              Join::of(column.here, Join::of(above.here, below.here)),
              Join::of(column.behind, Join::of(above.behind, below.behind))};
  }
  Quad joined = column.here;
  for (int k = 1; k <= radius; ++k) joined = Join::of(joined, Join::of(column.left(k), column.right(k)));
  return joined;
}

/// Two binary digits of the number of set bits.
struct Digits {
  Quad ones, twos;
};
OMNIFLEET_INLINE Digits count(const Quad& a, const Quad& b, const Quad& c) {
  const Quad differ = a ^ b;
  return {differ ^ c, (a & b) | (differ & c)};
}
OMNIFLEET_INLINE Digits count(const Quad& a, const Quad& b) {
  return {a ^ b, a & b};
}

/// Number of set pixels among five pixels of a column, in binary: one Neighbourhood per digit.
struct ColumnCount {
  Neighbourhood ones, twos, fours;

  static OMNIFLEET_INLINE ColumnCount at(const BitMask::Word* words, std::ptrdiff_t step) {
    ColumnCount count;
    count.take(words - 1, step, count.ones.before, count.twos.before, count.fours.before);
    count.take(words, step, count.ones.here, count.twos.here, count.fours.here);
    count.take(words + 1, step, count.ones.behind, count.twos.behind, count.fours.behind);
    return count;
  }

 private:
  OMNIFLEET_INLINE void take(const BitMask::Word* words, std::ptrdiff_t step, Quad& one, Quad& two,
                             Quad& four) {
    const auto row = [words, step](int k) { return lanes::load<Quad>(words + k * step); };
    const Digits three = count(row(-2), row(-1), row(0)), five = count(three.ones, row(1), row(2)),
                 carried = count(three.twos, five.twos);
    one = five.ones;
    two = carried.ones;
    four = carried.twos;
  }
};

/// Majority of 5×5 pixels: adds the counts of five columns digit by digit and tests for at least 13.
OMNIFLEET_INLINE Quad mostOfSquare(const BitMask::Word* words, std::ptrdiff_t step) {
  const ColumnCount c = ColumnCount::at(words, step);
  const Digits one_a = count(c.ones.left(2), c.ones.left(1), c.ones.here),
               one = count(one_a.ones, c.ones.right(1), c.ones.right(2));
  const Digits two_a = count(c.twos.left(2), c.twos.left(1), c.twos.here),
               two_b = count(c.twos.right(1), c.twos.right(2), one_a.twos),
               two = count(two_a.ones, two_b.ones, one.twos);
  const Digits four_a = count(c.fours.left(2), c.fours.left(1), c.fours.here),
               four_b = count(c.fours.right(1), c.fours.right(2), two_a.twos),
               four_c = count(four_a.ones, four_b.ones, two_b.twos), four = count(four_c.ones, two.twos);
  const Digits eight_a = count(four_a.twos, four_b.twos, four_c.twos), eight = count(eight_a.ones, four.twos);
  const Quad sixteen = eight_a.twos | eight.twos;
  return sixteen | (eight.ones & four.ones & (two.ones | one.ones));
}

/// Calls compute(row, word) for each quad of the area and stores the result within the strips.
template <typename Compute>
OMNIFLEET_INLINE void overArea(const BitArea& area, BitMask& out, Compute compute) {
  for (const BitArea::Span& span : area.spans()) {
    const BitMask::Word* selected = area.selectedBits(span.cell_row);
    for (int y = span.cell_row * FloorView::kCell; y < (span.cell_row + 1) * FloorView::kCell; ++y) {
      BitMask::Word* to = out.row(y);
      for (int k = span.begin; k < span.end; k += BitMask::kQuad) {
        const auto here = lanes::load<Quad>(selected + k);
        lanes::store((compute(y, k) & here) | (lanes::load<Quad>(to + k) & ~here), to + k);
      }
    }
  }
}

template <typename Join>
OMNIFLEET_INLINE void joinSquares(const BitArea& area, int radius, const BitMask& in, BitMask& out) {
  const std::ptrdiff_t step = in.step();
  overArea(
      area, out, [&](int y, int k) __attribute__((always_inline)) {
        return joinSquare<Join>(in.row(y) + k, step, radius);
      });
}

}  // namespace

OMNIFLEET_WIDE void erode(const BitArea& area, int radius, const BitMask& in, BitMask& out) {
  joinSquares<All>(area, radius, in, out);
}

OMNIFLEET_WIDE void dilate(const BitArea& area, int radius, const BitMask& in, BitMask& out) {
  joinSquares<Any>(area, radius, in, out);
}

OMNIFLEET_WIDE void growWithin(const BitArea& area, const BitMask& in, const BitMask& within, BitMask& out) {
  overArea(
      area, out, [&](int y, int k) __attribute__((always_inline)) {
        return joinSquare<Any>(in.row(y) + k, in.step(), 1) & lanes::load<Quad>(within.row(y) + k);
      });
}

OMNIFLEET_WIDE void takeMedian(const BitArea& area, const BitMask& in, BitMask& out) {
  overArea(
      area, out, [&](int y, int k) __attribute__((always_inline)) {
        return mostOfSquare(in.row(y) + k, in.step());
      });
}

OMNIFLEET_WIDE void regrowCorners(const BitArea& area, const BitMask& before, const BitMask& median,
                                  BitMask& out) {
  overArea(
      area, out, [&](int y, int k) __attribute__((always_inline)) {
        const Quad near = joinSquare<Any>(median.row(y) + k, median.step(), 1);
        return (near & lanes::load<Quad>(before.row(y) + k)) | lanes::load<Quad>(median.row(y) + k);
      });
}

}  // namespace omnifleet::ground
