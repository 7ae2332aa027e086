#include "ground/band_completer.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"
#include "ground/look.h"

namespace omnifleet::ground {

namespace {

constexpr int kMostShare = 64;      // of the image's width: how wide what lies between bands is
constexpr int kMostBand = 2;        // times that: bands, of which two may have run together
constexpr int kLeast_px = 2;        // narrower pieces are noise along an outline
constexpr int kLeastPieces = 3;     // shadows and things one behind the other leave two
constexpr int kLeastLines = 6;      // side by side that show the same
constexpr int kSteepest = 1;        // pixels that gaps may go aside from one line to the next
constexpr int kRagged_px = 1;       // and their ends
constexpr float kSameGaps = 0.66f;  // of the gaps do so, or it is another thing
constexpr int kMissed = 2;          // of them one after another may not
constexpr int kThin = 2;            // bands are no thinner than so many would fill: lines of a grid are
constexpr int kFarthest = 8;        // times as wide as bands may be, that is looked for more of them
constexpr int kUneven = 2;          // between gaps the widest is at most so many times the least …
constexpr int kUneven_px = 2;       // … and so much more

/// A row of what is no shade and no floor; counts the pieces that begin along each column.
/// @return how many begin along the row
OMNIFLEET_WIDE int findCoreOfRow(const std::uint8_t* raw, const std::uint8_t* looks,
                                 const std::uint8_t* above, int n, std::uint8_t* core, std::uint8_t* begins) {
  constexpr Look kFirst = greyLook(kDeepestShade), kLast = greyLook(1.0f + kFaintContrast);
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const std::uint8_t other = (looks[i] < kFirst) | (looks[i] > kLast);
    core[i] = raw[i] & other;
    begins[i] = static_cast<std::uint8_t>(begins[i] + (core[i] & (above[i] ^ 1)));
  }
  int pieces = n > 0 ? core[0] : 0;
#pragma GCC ivdep
  for (int i = 1; i < n; ++i) pieces += core[i] & (core[i - 1] ^ 1);
  return pieces;
}

}  // namespace

BandCompleter::BandCompleter(cv::Size image)
    : core_(image, std::uint8_t{0}),
      marks_(image, std::uint8_t{0}),
      begins_(static_cast<std::size_t>(image.width)),
      most_px_(image.width / kMostShare) {}

const std::vector<Run>& BandCompleter::find(const Blob& region, const Seen& seen) {
  found_.clear();
  for (int beside_px = 2 * most_px_; beside_px <= kFarthest * most_px_; beside_px *= 2) {
    lookAround(region.rect, beside_px);
    if (!findCore(seen)) return found_;
    findBands();
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
            cv::Rect(1, 1, core_.cols - 2, core_.rows - 2);
}

/// @return whether enough lines have pieces enough
bool BandCompleter::findCore(const Seen& seen) {
  std::fill_n(core_.ptr(around_.y - 1) + around_.x, around_.width, std::uint8_t{0});
  std::fill_n(begins_.begin(), around_.width, std::uint8_t{0});
  int rows = 0;
  for (int y = around_.y; y < around_.br().y; ++y) {
    const int pieces =
        findCoreOfRow(seen.raw.ptr(y) + around_.x, seen.looks.ptr(y) + around_.x,
                      core_.ptr(y - 1) + around_.x, around_.width, core_.ptr(y) + around_.x, begins_.data());
    rows += pieces >= kLeastPieces ? 1 : 0;
  }
  const auto columns = std::count_if(begins_.begin(), begins_.begin() + around_.width,
                                     [](std::uint8_t begins) { return begins >= kLeastPieces; });
  if (std::max(rows, static_cast<int>(columns)) < kLeastLines) return false;
  for (int y = around_.y; y < around_.br().y; ++y)
    for (int x = around_.x; x < around_.br().x; ++x)
      if (core_(y, x) != 0 && !seen.cleaned.at(x, y)) core_(y, x) = 0;
  return true;
}

/// Calls take(chain) for what the pieces of a line show to be bands.
template <typename IsCore, typename Take>
void BandCompleter::followLine(int length, IsCore isCore, Take take) const {
  Chain chain;
  const auto end = [&] {
    if (chain.areBands()) take(chain);
    chain = {};
  };
  for (int i = 0; i < length; ++i) {
    if (!isCore(i)) continue;
    const int begin = i;
    while (i < length && isCore(i)) ++i;
    if (i - begin < kLeast_px) continue;
    const int gap = begin - chain.last_px;
    const bool is_band = i - begin <= kMostBand * most_px_;
    if (chain.pieces > 0 && gap >= kLeast_px && gap <= most_px_)
      chain.add(begin, gap);
    else
      end();
    if (chain.pieces == 0) chain.begin_px = is_band ? begin : i;
    ++chain.pieces;
    chain.bands_px += is_band ? i - begin : 0;
    chain.last_px = i;
    chain.end_px = is_band ? i : begin;
    if (is_band || chain.pieces == 1) continue;
    end();  // what is wider than a band may be the last of them, and the first of the next
    chain.pieces = 1;
    chain.begin_px = chain.last_px = chain.end_px = i;
  }
  end();
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

void BandCompleter::findBands() {
  bands_.clear();
  for (const bool columns : {false, true}) {
    along_.clear();
    const int count = columns ? around_.width : around_.height,
              length = columns ? around_.height : around_.width;
    for (int k = 0; k < count; ++k) {
      const auto isCore = [&](int i) {
        return (columns ? core_(around_.y + i, around_.x + k) : core_(around_.y + k, around_.x + i)) != 0;
      };
      followLine(length, isCore, [&](const Chain& chain) { along_.push_back({k, chain, 1, 1}); });
    }
    countBeside();
    for (const auto& [line, chain, before, after] : along_) {
      if (before + after - 1 < kLeastLines) continue;
      const cv::Rect band = columns ? cv::Rect(line, chain.begin_px, 1, chain.end_px - chain.begin_px)
                                    : cv::Rect(chain.begin_px, line, chain.end_px - chain.begin_px, 1);
      bands_.push_back(band + around_.tl());
    }
  }
}

/// Some bands may have more beyond what was looked at.
bool BandCompleter::goesOn() const {
  const cv::Rect within(around_.tl() + cv::Point(most_px_, most_px_),
                        around_.br() - cv::Point(most_px_, most_px_));
  return std::any_of(bands_.begin(), bands_.end(),
                     [&](const cv::Rect& band) { return (band & within) != band; });
}

/// Things with bands are convex: to what lies between bands the pieces of theirs come that lie mostly in it.
void BandCompleter::fillThings() {
  cv::Mat1b marks = marks_(around_);
  cv::Mat1i thing, piece;
  cv::Mat stats, centroids;
  cv::Mat1b joined;  // some lines in between show nothing
  cv::dilate(marks, joined, cv::Mat(most_px_, most_px_, CV_8U, cv::Scalar(1)));
  const int things = cv::connectedComponents(joined, thing),
            pieces = cv::connectedComponentsWithStats(core_(around_), piece, stats, centroids);
  for (int i = 1; i < things; ++i) {
    const cv::Mat1b is_thing = (thing == i) & (marks != 0);
    std::vector<cv::Point> points, hull;
    cv::findNonZero(is_thing, points);
    cv::convexHull(points, hull);
    cv::Mat1b within(marks.size(), std::uint8_t{0});
    cv::fillConvexPoly(within, hull, cv::Scalar(1));
    std::vector<int> inside(static_cast<std::size_t>(pieces));
    for (int y = 0; y < marks.rows; ++y)
      for (int x = 0; x < marks.cols; ++x) inside[static_cast<std::size_t>(piece(y, x))] += within(y, x);
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
