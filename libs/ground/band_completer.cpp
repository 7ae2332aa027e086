#include "ground/band_completer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "geometry/wide.h"
#include "ground/look.h"

namespace omnifleet::ground {

namespace {

constexpr int kMostShare = 64;      // of the image's width: how wide what lies between bands is
constexpr int kMostBand = 2;        // times that: bands, of which two may have run together
constexpr int kLongest = 12;        // times that: how long bands are
constexpr int kLeast_px = 2;        // narrower pieces are noise along an outline
constexpr int kLeastPieces = 3;     // shadows and things one behind the other leave two
constexpr int kLeastLines = 6;      // side by side that show the same
constexpr int kSlender = 3;         // and no fewer than so many times that make what they cross
constexpr int kSteepest = 1;        // pixels that gaps may go aside from one line to the next
constexpr int kRagged_px = 1;       // and their ends
constexpr float kSameGaps = 0.66f;  // of the gaps do so, or it is another thing
constexpr int kMissed = 2;          // of them one after another may not
constexpr int kThin = 2;            // bands are no thinner than so many would fill: lines of a grid are
constexpr int kFarthest = 8;        // times as wide as bands may be, that is looked for more of them
constexpr int kUneven = 2;          // between gaps the widest is at most so many times the least …
constexpr int kUneven_px = 2;       // … and so much more

using Word = BitMask::Word;
constexpr int kBits = BitMask::kBits;

/// Which of the pixels are no shade.
OMNIFLEET_WIDE Word unshaded(const Look* looks) {
  constexpr Look kFirst = greyLook(kDeepestShade), kLast = greyLook(1.0f + kFaintContrast);
  constexpr Word kGather = 0x0102040810204080U;  // the lowest bits of eight bytes, to the highest byte
  constexpr int kBytes = 8;
  std::array<std::uint8_t, kBits> is_core;
  for (std::size_t i = 0; i < is_core.size(); ++i)
    is_core[i] = static_cast<std::uint8_t>((looks[i] < kFirst) | (looks[i] > kLast));
  Word bits = 0;
  for (int k = 0; k < kBits / kBytes; ++k) {
    Word eight;
    std::memcpy(&eight, &is_core[static_cast<std::size_t>(kBytes * k)], sizeof eight);
    bits |= (eight * kGather >> (kBits - kBytes)) << (kBytes * k);
  }
  return bits;
}

Word unshadedAt(const cv::Mat1b& looks, int word, int y) {
  const Look* at = looks.ptr(y) + word * kBits;
  if ((word + 1) * kBits <= looks.cols) return unshaded(at);
  std::array<Look, kBits> rest{};
  std::copy(at, looks.ptr(y) + looks.cols, rest.begin());
  return unshaded(rest.data());
}

/// The bits of a row's word that lie in these columns.
Word within(int word, const cv::Rect& columns) {
  const int first = std::max(0, columns.x - word * kBits),
            end = std::min(kBits, columns.br().x - word * kBits);
  return (~Word{0} << first) & (~Word{0} >> (kBits - end));
}

cv::Rect innerOf(const cv::Size& image) {
  return {1, 1, image.width - 2, image.height - 2};
}

/// Where a row's bits differ from the one before.
Word changesAlong(const Word* row, int word, Word before) {
  return row[word] ^ (row[word] << 1U | before >> (kBits - 1U));
}

}  // namespace

BandCompleter::BandCompleter(cv::Size image)
    : core_(image),
      marks_(image, std::uint8_t{0}),
      columns_(static_cast<std::size_t>(image.width)),
      most_px_(image.width / kMostShare) {}

const std::vector<Run>& BandCompleter::find(const Blob& region, const Seen& seen) {
  found_.clear();
  for (int beside_px = (isBand(region) ? 2 : 1) * most_px_; beside_px <= kFarthest * most_px_;
       beside_px *= 2) {
    lookAround(region.rect, beside_px);
    if (!findCore(seen)) return found_;
    bands_.clear();
    followRows();
    followColumns();
    if (!goesOn()) break;
  }
  if (bands_.empty()) return found_;
  for (const cv::Rect& band : bands_) marks_(band) = 1;
  fillThings();
  for (int y = around_.y; y < around_.br().y; ++y) {
    std::uint8_t* mark = marks_.ptr(y);
    for (int x = around_.x; x < around_.br().x; ++x) {
      if (mark[x] == 0) continue;
      const int begin = x;
      while (x < around_.br().x && mark[x] != 0) mark[x++] = 0;
      found_.push_back({y, begin, x});
    }
  }
  return found_;
}

void BandCompleter::lookAround(const cv::Rect& region, int beside_px) {
  around_ = cv::Rect(region.x - beside_px, region.y - beside_px, region.width + 2 * beside_px,
                     region.height + 2 * beside_px) &
            innerOf(marks_.size());
}

bool BandCompleter::isBand(const Blob& region) const {
  const int length = std::max(region.rect.width, region.rect.height);
  return length <= kLongest * most_px_ && region.area_px <= kMostBand * most_px_ * length;
}

/// Along every row and column of a compact thing pixels begin once and end once.
bool BandCompleter::isRagged(const Blob& region, const BitMask& left) {
  const cv::Rect& r = region.rect;
  int changes = 0;
  for (int w = r.x / kBits; w * kBits < r.br().x; ++w) {
    const Word in = within(w, r);
    Word above = 0;
    for (int y = r.y; y < r.br().y; ++y) {
      const Word *row = left.row(y), here = row[w] & in;
      changes += __builtin_popcountll(here ^ above);
      changes += __builtin_popcountll(changesAlong(row, w, row[w - 1]) & in);
      above = here;
    }
    changes += __builtin_popcountll(above);
  }
  return changes >= 2 * (r.width + r.height) + 2 * kLeastLines;
}

/// @return whether there is any
bool BandCompleter::findCore(const Seen& seen) {
  Word any = 0;
  for (int y = around_.y; y < around_.br().y; ++y) {
    const Word *cleaned = seen.cleaned.row(y), *raw = seen.raw.row(y);
    Word* core = core_.row(y);
    for (int w = around_.x / kBits; w * kBits < around_.br().x; ++w) {
      core[w] = cleaned[w] & raw[w] & within(w, around_);
      if (core[w] != 0) core[w] &= unshadedAt(seen.looks, w, y);
      any |= core[w];
    }
  }
  return any != 0;
}

/// Pieces along the rows.
void BandCompleter::followRows() {
  along_.clear();
  for (int y = around_.y; y < around_.br().y; ++y) {
    const Word* core = core_.row(y);
    Follower row;
    Word before = 0;
    for (int w = around_.x / kBits; w * kBits < around_.br().x; ++w) {
      for (Word changes = changesAlong(core, w, before); changes != 0; changes &= changes - 1)
        follow(row, y, w * kBits + __builtin_ctzll(changes));
      before = core[w];
    }
    if (row.is_piece) follow(row, y, around_.br().x);
    take(row, y);
  }
  keepBands(false);
}

/// Pieces along the columns.
void BandCompleter::followColumns() {
  along_.clear();
  std::fill(columns_.begin() + around_.x, columns_.begin() + around_.br().x, Follower{});
  for (int w = around_.x / kBits; w * kBits < around_.br().x; ++w) {
    Word above = 0;
    for (int y = around_.y; y < around_.br().y; ++y) {
      const Word here = core_.row(y)[w];
      for (Word changes = here ^ above; changes != 0; changes &= changes - 1) {
        const int x = w * kBits + __builtin_ctzll(changes);
        follow(columns_[static_cast<std::size_t>(x)], x, y);
      }
      above = here;
    }
  }
  for (int x = around_.x; x < around_.br().x; ++x) {
    Follower& column = columns_[static_cast<std::size_t>(x)];
    if (column.is_piece) follow(column, x, around_.br().y);
    take(column, x);
  }
  std::sort(along_.begin(), along_.end(), [](const Line& a, const Line& b) {
    return std::tie(a.line, a.chain.begin_px) < std::tie(b.line, b.chain.begin_px);
  });
  keepBands(true);
}

/// A piece begins there, or ends.
void BandCompleter::follow(Follower& along, int line, int at_px) {
  along.is_piece = !along.is_piece;
  if (along.is_piece) {
    along.piece_px = at_px;
    return;
  }
  const int begin = along.piece_px, width = at_px - begin;
  if (width < kLeast_px) return;
  Chain& chain = along.chain;
  const int gap = begin - chain.last_px;
  const bool is_band = width <= kMostBand * most_px_;
  if (chain.pieces > 0 && gap >= kLeast_px && gap <= most_px_)
    chain.add(begin, gap);
  else
    take(along, line);
  if (chain.pieces == 0) chain.begin_px = is_band ? begin : at_px;
  ++chain.pieces;
  chain.bands_px += is_band ? width : 0;
  chain.last_px = at_px;
  chain.end_px = is_band ? at_px : begin;
  if (is_band || chain.pieces == 1) return;
  take(along, line);  // what is wider than a band may be the last of them, and the first of the next
  chain.pieces = 1;
  chain.begin_px = chain.last_px = chain.end_px = at_px;
}

/// What was followed so far is bands, or is not; what comes now is others.
void BandCompleter::take(Follower& along, int line) {
  if (along.chain.areBands()) along_.push_back({line, along.chain, 1, 1});
  along.chain = {};
}

void BandCompleter::Chain::add(int piece_px, int gap_px) {
  gaps[static_cast<std::size_t>(pieces - 1) % gaps.size()] = piece_px - gap_px / 2;
  least_gap_px = pieces == 1 ? gap_px : std::min(least_gap_px, gap_px);
  most_gap_px = std::max(most_gap_px, gap_px);
  gaps_px += gap_px;
}

bool BandCompleter::Chain::areBands() const {
  return pieces >= kLeastPieces && pieces <= kMostPieces &&
         most_gap_px <= kUneven * least_gap_px + kUneven_px && kThin * bands_px >= gaps_px;
}

void BandCompleter::keepBands(bool columns) {
  countBeside();
  for (const auto& [line, chain, before, after] : along_) {
    const int lines = before + after - 1, length = chain.end_px - chain.begin_px;
    if (lines < kLeastLines || kSlender * lines < length) continue;
    bands_.push_back(columns ? cv::Rect(line, chain.begin_px, 1, length)
                             : cv::Rect(chain.begin_px, line, length, 1));
  }
}

/// Some bands may have more beyond what was looked at, but not beyond the image.
bool BandCompleter::goesOn() const {
  const cv::Rect all = innerOf(marks_.size());
  const auto beside = [this](bool ends) { return ends ? 0 : most_px_; };
  const cv::Point first(beside(around_.x == all.x), beside(around_.y == all.y)),
      last(beside(around_.br().x == all.br().x), beside(around_.br().y == all.br().y));
  const cv::Rect within(around_.tl() + first, around_.br() - last);
  return std::any_of(bands_.begin(), bands_.end(),
                     [&](const cv::Rect& band) { return (band & within) != band; });
}

/// Things with bands are convex: to what lies between bands the pieces of theirs come that lie mostly in it.
void BandCompleter::fillThings() {
  cv::Mat1b marks = marks_(around_);
  cv::Mat1b core(marks.size());
  for (int y = 0; y < core.rows; ++y)
    for (int x = 0; x < core.cols; ++x) core(y, x) = core_.at(around_.x + x, around_.y + y) ? 1 : 0;
  cv::Mat1i thing, piece;
  cv::Mat stats, centroids;
  cv::Mat1b joined;  // some lines in between show nothing
  cv::dilate(marks, joined, cv::Mat(most_px_, most_px_, CV_8U, cv::Scalar(1)));
  const int things = cv::connectedComponents(joined, thing),
            pieces = cv::connectedComponentsWithStats(core, piece, stats, centroids);
  for (int i = 1; i < things; ++i) {
    const cv::Mat1b is_thing = (thing == i) & (marks != 0);
    std::vector<cv::Point> points, hull;
    cv::findNonZero(is_thing, points);
    cv::convexHull(points, hull);
    cv::Mat1b inner(marks.size(), std::uint8_t{0});
    cv::fillConvexPoly(inner, hull, cv::Scalar(1));
    std::vector<int> inside(static_cast<std::size_t>(pieces));
    for (int y = 0; y < marks.rows; ++y)
      for (int x = 0; x < marks.cols; ++x) inside[static_cast<std::size_t>(piece(y, x))] += inner(y, x);
    for (int y = 0; y < marks.rows; ++y)
      for (int x = 0; x < marks.cols; ++x) {
        const int k = piece(y, x);
        if (k > 0 && 2 * inside[static_cast<std::size_t>(k)] > stats.at<int>(k, cv::CC_STAT_AREA))
          points.emplace_back(x, y);
      }
    cv::convexHull(points, hull);
    cv::fillConvexPoly(marks, hull, cv::Scalar(1));
  }
}

/// Most of their gaps lie side by side.
bool BandCompleter::showTheSame(const Line& a, const Line& b) {
  const int most_px = kSteepest * std::abs(a.line - b.line) + kRagged_px;
  int same = 0;
  for (int i = 0; i + 1 < a.chain.pieces; ++i)
    for (int j = 0; j + 1 < b.chain.pieces; ++j)
      same += std::abs(a.chain.gaps[static_cast<std::size_t>(i)] -
                       b.chain.gaps[static_cast<std::size_t>(j)]) <= most_px
                  ? 1
                  : 0;
  return a.line != b.line && kSameGaps * static_cast<float>(std::max(a.chain.pieces, b.chain.pieces) - 1) <=
                                 static_cast<float>(same);
}

/// How many lines before and after each show the same beside it.
void BandCompleter::countBeside() {
  const std::size_t n = along_.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i; j-- > 0 && along_[i].line - along_[j].line <= 1 + kMissed;)
      if (showTheSame(along_[i], along_[j]))
        along_[i].before = std::max(along_[i].before, along_[j].before + 1);
  for (std::size_t i = n; i-- > 0;)
    for (std::size_t j = i + 1; j < n && along_[j].line - along_[i].line <= 1 + kMissed; ++j)
      if (showTheSame(along_[i], along_[j])) along_[i].after = std::max(along_[i].after, along_[j].after + 1);
}

}  // namespace omnifleet::ground
