#include "ground/band_completer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "geometry/wide.h"
#include "ground/appearance_class.h"

namespace omnifleet::ground {

namespace {

constexpr int kUnitsPerWidth = 64;     // a unit is 1/64 of the image width: maximum gap between bands
constexpr int kMaxBand = 2;            // units: maximum width of a band (two may have merged)
constexpr int kMaxLength = 12;         // units: maximum length of a band
constexpr int kMinPiece_px = 2;        // narrower pieces are noise along an outline
constexpr int kMinPieces = 3;          // shadows and objects behind one another leave only two
constexpr int kMinLines = 6;           // adjacent lines with the same gaps
constexpr int kSlender = 3;            // times the number of these lines is the maximum extent across them
constexpr int kMaxSlope = 1;           // pixels by which gaps may shift from one line to the next
constexpr int kRagged_px = 1;          // tolerance of the gap positions
constexpr float kMinSameGaps = 0.66f;  // minimum share of matching gaps
constexpr int kMaxMissed = 2;          // consecutive lines without a match
constexpr int kThin = 2;               // bands cover at least 1/2 of the gaps; grid lines are thinner
constexpr int kMaxSearch = 8;          // units: maximum search distance
constexpr int kUneven = 2;             // the widest gap is at most this × the narrowest plus kUneven_px
constexpr int kUneven_px = 2;          // see kUneven

using Word = BitMask::Word;
constexpr int kBits = BitMask::kBits;

/// Bits of the pixels that cannot be shadow: coloured, darker than the deepest shadow, or brighter than the
/// floor's pattern.
OMNIFLEET_WIDE Word unshadowed(const Appearance* appearances) {
  constexpr Appearance kFirst = greyAppearance(kDeepestShadow), kLast = greyAppearance(1.0f + kFaintContrast);
  constexpr Word kGather = 0x0102040810204080U;  // moves the lowest bits of eight bytes to the highest byte
  constexpr int kBytes = 8;
  std::array<std::uint8_t, kBits> is_core;
  for (std::size_t i = 0; i < is_core.size(); ++i)
    is_core[i] = static_cast<std::uint8_t>((appearances[i] < kFirst) | (appearances[i] > kLast));
  Word bits = 0;
  for (int k = 0; k < kBits / kBytes; ++k) {
    Word eight;
    std::memcpy(&eight, &is_core[static_cast<std::size_t>(kBytes * k)], sizeof eight);
    bits |= (eight * kGather >> (kBits - kBytes)) << (kBytes * k);
  }
  return bits;
}

Word unshadowedAt(const cv::Mat1b& appearances, int word, int y) {
  const Appearance* at = appearances.ptr(y) + word * kBits;
  if ((word + 1) * kBits <= appearances.cols) return unshadowed(at);
  std::array<Appearance, kBits> rest{};
  std::copy(at, appearances.ptr(y) + appearances.cols, rest.begin());
  return unshadowed(rest.data());
}

/// Bits of one word of a row that lie in these columns.
Word within(int word, const cv::Rect& columns) {
  const int first = std::max(0, columns.x - word * kBits),
            end = std::min(kBits, columns.br().x - word * kBits);
  return (~Word{0} << first) & (~Word{0} >> (kBits - end));
}

cv::Rect innerOf(const cv::Size& image) {
  return {1, 1, image.width - 2, image.height - 2};
}

/// Bits where a row differs from its previous pixel.
Word changesAlong(const Word* row, int word, Word before) {
  return row[word] ^ (row[word] << 1U | before >> (kBits - 1U));
}

}  // namespace

BandCompleter::BandCompleter(cv::Size image)
    : core_(image),
      marks_(image, std::uint8_t{0}),
      columns_(static_cast<std::size_t>(image.width)),
      unit_px_(image.width / kUnitsPerWidth) {}

const std::vector<Run>& BandCompleter::find(const Blob& region, const Input& input) {
  found_.clear();
  for (int beside_px = (isBand(region) ? 2 : 1) * unit_px_; beside_px <= kMaxSearch * unit_px_;
       beside_px *= 2) {
    setSearchArea(region.rect, beside_px);
    if (!findCore(input)) return found_;
    bands_.clear();
    followRows();
    followColumns();
    if (!continuesBeyondSearch()) break;
  }
  if (bands_.empty()) return found_;
  for (const cv::Rect& band : bands_) marks_(band) = 1;
  fillObjects();
  for (int y = search_area_.y; y < search_area_.br().y; ++y) {
    std::uint8_t* mark = marks_.ptr(y);
    for (int x = search_area_.x; x < search_area_.br().x; ++x) {
      if (mark[x] == 0) continue;
      const int begin = x;
      while (x < search_area_.br().x && mark[x] != 0) mark[x++] = 0;
      found_.push_back({y, begin, x});
    }
  }
  return found_;
}

void BandCompleter::setSearchArea(const cv::Rect& region, int beside_px) {
  search_area_ = cv::Rect(region.x - beside_px, region.y - beside_px, region.width + 2 * beside_px,
                          region.height + 2 * beside_px) &
                 innerOf(marks_.size());
}

bool BandCompleter::isBand(const Blob& region) const {
  const int length = std::max(region.rect.width, region.rect.height);
  return length <= kMaxLength * unit_px_ && region.area_px <= kMaxBand * unit_px_ * length;
}

/// True if the region has more transitions than a compact object, which begins and ends once in every row and
/// column.
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
  return changes >= 2 * (r.width + r.height) + 2 * kMinLines;
}

/// @return false if the search area holds no core pixel
bool BandCompleter::findCore(const Input& input) {
  Word any = 0;
  for (int y = search_area_.y; y < search_area_.br().y; ++y) {
    const Word *cleaned = input.cleaned.row(y), *raw = input.raw.row(y);
    Word* core = core_.row(y);
    for (int w = search_area_.x / kBits; w * kBits < search_area_.br().x; ++w) {
      core[w] = cleaned[w] & raw[w] & within(w, search_area_);
      if (core[w] != 0) core[w] &= unshadowedAt(input.appearances, w, y);
      any |= core[w];
    }
  }
  return any != 0;
}

/// Finds pieces along the rows.
void BandCompleter::followRows() {
  lines_.clear();
  for (int y = search_area_.y; y < search_area_.br().y; ++y) {
    const Word* core = core_.row(y);
    Follower row;
    Word before = 0;
    for (int w = search_area_.x / kBits; w * kBits < search_area_.br().x; ++w) {
      for (Word changes = changesAlong(core, w, before); changes != 0; changes &= changes - 1)
        follow(row, y, w * kBits + __builtin_ctzll(changes));
      before = core[w];
    }
    if (row.in_piece) follow(row, y, search_area_.br().x);
    closeChain(row, y);
  }
  keepBands(false);
}

/// Finds pieces along the columns.
void BandCompleter::followColumns() {
  lines_.clear();
  std::fill(columns_.begin() + search_area_.x, columns_.begin() + search_area_.br().x, Follower{});
  for (int w = search_area_.x / kBits; w * kBits < search_area_.br().x; ++w) {
    Word above = 0;
    for (int y = search_area_.y; y < search_area_.br().y; ++y) {
      const Word here = core_.row(y)[w];
      for (Word changes = here ^ above; changes != 0; changes &= changes - 1) {
        const int x = w * kBits + __builtin_ctzll(changes);
        follow(columns_[static_cast<std::size_t>(x)], x, y);
      }
      above = here;
    }
  }
  for (int x = search_area_.x; x < search_area_.br().x; ++x) {
    Follower& column = columns_[static_cast<std::size_t>(x)];
    if (column.in_piece) follow(column, x, search_area_.br().y);
    closeChain(column, x);
  }
  std::sort(lines_.begin(), lines_.end(), [](const Line& a, const Line& b) {
    return std::tie(a.line, a.chain.begin_px) < std::tie(b.line, b.chain.begin_px);
  });
  keepBands(true);
}

/// Handles the begin or the end of a piece.
void BandCompleter::follow(Follower& follower, int line, int at_px) {
  follower.in_piece = !follower.in_piece;
  if (follower.in_piece) {
    follower.piece_px = at_px;
    return;
  }
  const int begin = follower.piece_px, width = at_px - begin;
  if (width < kMinPiece_px) return;
  Chain& chain = follower.chain;
  const int gap = begin - chain.last_px;
  const bool is_band = width <= kMaxBand * unit_px_;
  if (chain.pieces > 0 && gap >= kMinPiece_px && gap <= unit_px_)
    chain.add(begin, gap);
  else
    closeChain(follower, line);
  if (chain.pieces == 0) chain.begin_px = is_band ? begin : at_px;
  ++chain.pieces;
  chain.bands_px += is_band ? width : 0;
  chain.last_px = at_px;
  chain.end_px = is_band ? at_px : begin;
  if (is_band || chain.pieces == 1) return;
  closeChain(follower, line);  // a wide piece may be the last band of this chain and the first of the next
  chain.pieces = 1;
  chain.begin_px = chain.last_px = chain.end_px = at_px;
}

/// Stores the chain if it consists of bands, and starts a new one.
void BandCompleter::closeChain(Follower& follower, int line) {
  if (follower.chain.areBands()) lines_.push_back({line, follower.chain, 1, 1});
  follower.chain = {};
}

void BandCompleter::Chain::add(int piece_px, int gap_px) {
  gaps[static_cast<std::size_t>(pieces - 1) % gaps.size()] = piece_px - gap_px / 2;
  least_gap_px = pieces == 1 ? gap_px : std::min(least_gap_px, gap_px);
  most_gap_px = std::max(most_gap_px, gap_px);
  gaps_px += gap_px;
}

bool BandCompleter::Chain::areBands() const {
  return pieces >= kMinPieces && pieces <= kMaxPieces && most_gap_px <= kUneven * least_gap_px + kUneven_px &&
         kThin * bands_px >= gaps_px;
}

void BandCompleter::keepBands(bool columns) {
  countMatchingLines();
  for (const auto& [line, chain, before, after] : lines_) {
    const int lines = before + after - 1, length = chain.end_px - chain.begin_px;
    if (lines < kMinLines || kSlender * lines < length) continue;
    bands_.push_back(columns ? cv::Rect(line, chain.begin_px, 1, length)
                             : cv::Rect(chain.begin_px, line, length, 1));
  }
}

/// True if a band reaches the edge of the search area, except where the image ends there.
bool BandCompleter::continuesBeyondSearch() const {
  const cv::Rect all = innerOf(marks_.size());
  const auto beside = [this](bool ends) { return ends ? 0 : unit_px_; };
  const cv::Point first(beside(search_area_.x == all.x), beside(search_area_.y == all.y)),
      last(beside(search_area_.br().x == all.br().x), beside(search_area_.br().y == all.br().y));
  const cv::Rect within(search_area_.tl() + first, search_area_.br() - last);
  return std::any_of(bands_.begin(), bands_.end(),
                     [&](const cv::Rect& band) { return (band & within) != band; });
}

/// Fills the hull of each object, as objects with bands are convex. Pieces join an object if most of their
/// area lies in its hull.
void BandCompleter::fillObjects() {
  cv::Mat1b marks = marks_(search_area_);
  cv::Mat1b core(marks.size());
  for (int y = 0; y < core.rows; ++y)
    for (int x = 0; x < core.cols; ++x) core(y, x) = core_.at(search_area_.x + x, search_area_.y + y) ? 1 : 0;
  cv::Mat1i object, piece;
  cv::Mat stats, centroids;
  cv::Mat1b joined;  // bridges lines without bands
  cv::dilate(marks, joined, cv::Mat(unit_px_, unit_px_, CV_8U, cv::Scalar(1)));
  const int objects = cv::connectedComponents(joined, object),
            pieces = cv::connectedComponentsWithStats(core, piece, stats, centroids);
  for (int i = 1; i < objects; ++i) {
    const cv::Mat1b is_object = (object == i) & (marks != 0);
    std::vector<cv::Point> points, hull;
    cv::findNonZero(is_object, points);
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

/// True if most gaps of the two lines lie side by side.
bool BandCompleter::haveSameGaps(const Line& a, const Line& b) {
  const int most_px = kMaxSlope * std::abs(a.line - b.line) + kRagged_px;
  int same = 0;
  for (int i = 0; i + 1 < a.chain.pieces; ++i)
    for (int j = 0; j + 1 < b.chain.pieces; ++j)
      same += std::abs(a.chain.gaps[static_cast<std::size_t>(i)] -
                       b.chain.gaps[static_cast<std::size_t>(j)]) <= most_px
                  ? 1
                  : 0;
  return a.line != b.line &&
         kMinSameGaps * static_cast<float>(std::max(a.chain.pieces, b.chain.pieces) - 1) <=
             static_cast<float>(same);
}

/// Counts the lines before and after each line that have the same gaps.
void BandCompleter::countMatchingLines() {
  const std::size_t n = lines_.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i; j-- > 0 && lines_[i].line - lines_[j].line <= 1 + kMaxMissed;)
      if (haveSameGaps(lines_[i], lines_[j]))
        lines_[i].before = std::max(lines_[i].before, lines_[j].before + 1);
  for (std::size_t i = n; i-- > 0;)
    for (std::size_t j = i + 1; j < n && lines_[j].line - lines_[i].line <= 1 + kMaxMissed; ++j)
      if (haveSameGaps(lines_[i], lines_[j]))
        lines_[i].after = std::max(lines_[i].after, lines_[j].after + 1);
}

}  // namespace omnifleet::ground
