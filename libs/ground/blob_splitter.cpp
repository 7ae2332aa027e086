#include "ground/blob_splitter.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

constexpr int kChunk = 32;
constexpr int kSpare = 16;       // elements behind a row that vectors may read
constexpr int kMaxPieces = 200;  // more pieces mean texture
constexpr double kBow_px = 0.4;  // inward bow of straight floor edges in the image, plus rounding

/// Sums of 3×3 pixels. Rows hold interleaved colours with a margin of one pixel on each side.
OMNIFLEET_WIDE void sumNine(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
                            int width, std::uint16_t* sums) {
  inChunks<kChunk>(
      0, 3 * (width + 2), [=](int i) __attribute__((always_inline)) {
        sums[i] = static_cast<std::uint16_t>(above[i] + here[i] + below[i]);
      });
#pragma GCC ivdep
  for (int i = 0; i < 3 * width; ++i)
    sums[i] = static_cast<std::uint16_t>(sums[i] + sums[i + 3] + sums[i + 6]);
}

/// Most frequent class in the 5×5 neighbourhood; on a tie, the pixel's own class. Rows hold classes with a
/// margin of two pixels on each side. `counts` is scratch memory for n sums per class.
OMNIFLEET_WIDE void takeCommonest(const std::uint8_t* const* rows, int width, int classes,
                                  std::uint8_t* scratch, std::uint8_t* counts, std::uint8_t* out) {
  const std::uint8_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4];
  const std::uint8_t* own = c + 2;
  std::uint8_t* own_count = counts + (classes + 1) * width;
  for (int k = 1; k <= classes; ++k) {
    const auto which = static_cast<std::uint8_t>(k);
    inChunks<kChunk>(
        0, width + 4, [=](int x) __attribute__((always_inline)) {
          scratch[x] = static_cast<std::uint8_t>((a[x] == which) + (b[x] == which) + (c[x] == which) +
                                                 (d[x] == which) + (e[x] == which));
        });
    std::uint8_t* count = counts + k * width;
    inChunks<kChunk>(
        0, width, [=](int x) __attribute__((always_inline)) {
          count[x] = static_cast<std::uint8_t>(scratch[x] + scratch[x + 1] + scratch[x + 2] + scratch[x + 3] +
                                               scratch[x + 4]);
          own_count[x] = own[x] == which ? count[x] : own_count[x];
        });
  }
  std::copy(own, own + width, out);
  for (int k = 1; k <= classes; ++k) {
    const auto which = static_cast<std::uint8_t>(k);
    const std::uint8_t* count = counts + k * width;
    inChunks<kChunk>(
        0, width, [=](int x) __attribute__((always_inline)) {
          const bool more = (count[x] > own_count[x]) & (own[x] != 0);
          out[x] = more ? which : out[x];
          own_count[x] = more ? count[x] : own_count[x];
        });
  }
}

/// Shares of red and green in n sums of interleaved colours. Reads and writes up to one vector more.
void takeShares(const std::uint16_t* sums, int n, float* red, float* green) {
  constexpr int kLanes = 8;
  const auto half = [](const cv::v_uint32x4& v) { return cv::v_cvt_f32(cv::v_reinterpret_as_s32(v)); };
  const cv::v_float32x4 one = cv::v_setall_f32(1.0f);
  for (int x = 0; x < n; x += kLanes) {
    cv::v_uint16x8 b, g, r;
    cv::v_load_deinterleave(sums + 3 * x, b, g, r);
    cv::v_uint32x4 all[2], greens[2], reds[2];
    cv::v_expand(b + g + r, all[0], all[1]);
    cv::v_expand(g, greens[0], greens[1]);
    cv::v_expand(r, reds[0], reds[1]);
    for (int k = 0; k < 2; ++k) {
      const cv::v_float32x4 sum = cv::v_max(half(all[k]), one);
      cv::v_store(red + x + 4 * k, half(reds[k]) / sum);
      cv::v_store(green + x + 4 * k, half(greens[k]) / sum);
    }
  }
}

/// Index (from 1) of the nearest colour for each of n pixels; the first one on a tie.
OMNIFLEET_WIDE void takeNearest(const float* red, const float* green, int n, const float* reds,
                                const float* greens, int colours, float* nearest, std::int32_t* which,
                                std::uint8_t* out) {
  for (int k = 0; k < colours; ++k) {
    const float r = reds[k], g = greens[k];
#pragma GCC ivdep
    for (int x = 0; x < n; ++x) {
      const float dr = red[x] - r, dg = green[x] - g, distance = dr * dr + dg * dg;
      const bool nearer = (k == 0) | (distance < nearest[x]);
      which[x] = nearer ? k + 1 : which[x];
      nearest[x] = nearer ? distance : nearest[x];
    }
  }
#pragma GCC ivdep
  for (int x = 0; x < n; ++x) out[x] = static_cast<std::uint8_t>(which[x]);
}

/// Bins of a 2-D histogram of the two shares, with `bins` bins per axis.
OMNIFLEET_WIDE void takeBins(const float* red, const float* green, int n, int bins, std::int32_t* out) {
#pragma GCC ivdep
  for (int x = 0; x < n; ++x) {
    const auto r = static_cast<std::int32_t>(red[x] * static_cast<float>(bins)),
               g = static_cast<std::int32_t>(green[x] * static_cast<float>(bins));
    out[x] = (r < bins ? r : bins - 1) * bins + (g < bins ? g : bins - 1);
  }
}

OMNIFLEET_WIDE int countOutside(const std::uint8_t* canvas, const std::uint8_t* inside, int n) {
  int count = 0;
  for (int x = 0; x < n; ++x) count += (canvas[x] != 0) & (inside[x] == 0) ? 1 : 0;
  return count;
}

/// Resizes a matrix over storage that only grows.
template <typename T>
void shape(cv::Size size, std::vector<T>& storage, cv::Mat_<T>& mat) {
  storage.resize(std::max(storage.size(), static_cast<std::size_t>(size.area())));
  mat = cv::Mat_<T>(size.height, size.width, storage.data());
}

}  // namespace

SplitOptions SplitOptions::read(const options::Section& section) {
  SplitOptions o;
  section.read("enabled", o.enabled);
  section.read("max_solidity", o.max_solidity, {0.0, 1.0});
  section.read("hue_step", o.hue_step, {0.01, 1.0});
  section.read("min_share", o.min_share, {0.0, 0.5});
  section.read("min_area_px", o.min_area_px, {4, 1000000});
  section.read("min_gain", o.min_gain, {-10.0, 1.0});
  section.read("min_outline", o.min_outline, {0.0, 1.0});
  section.finish();
  return o;
}

BlobSplitter::BlobSplitter(cv::Size image, const SplitOptions& options)
    : options_(options), mask_(image, std::uint8_t{0}) {}

const std::vector<Blob>& BlobSplitter::split(const cv::Mat& image, const Blob& blob) {
  clearMask();
  if (!options_.enabled || image.channels() != 3 || blob.area_px < 2 * options_.min_area_px) return parts_;
  rect_ = blob.rect;
  gather(image, blob);
  findColours(blob.area_px);
  if (colours_.size() < 2) return parts_;
  assign(blob);
  takeMajority();
  findPieces();
  mergeSmall(blob.area_px);
  write(blob);
  if (!parts_.empty() && !isMoreConvex(blob)) clearMask();
  return parts_;
}

void BlobSplitter::clearMask() {
  for (const Blob& part : parts_)
    for (const Run& run : part.runs)
      std::fill(mask_.ptr(run.row) + run.begin, mask_.ptr(run.row) + run.end, std::uint8_t{0});
  parts_.clear();
}

/// Draws the convex hull of a region on the canvas.
void BlobSplitter::paintHull(const Blob& blob) {
  corners_.clear();
  for (const Run& run : blob.runs) {
    corners_.emplace_back(run.begin - rect_.x, run.row - rect_.y);
    corners_.emplace_back(run.end - 1 - rect_.x, run.row - rect_.y);
  }
  cv::convexHull(corners_, hull_);
  cv::fillConvexPoly(canvas_, hull_, 1);
}

/// Number of canvas pixels that do not belong to the region.
int BlobSplitter::countNotches() const {
  int count = 0;
  for (int y = 0; y < rect_.height; ++y) count += countOutside(canvas_.ptr(y), inside_.ptr(y), rect_.width);
  return count;
}

/// Objects that occlude one another leave concave notches where their outlines meet. Marks on one object
/// leave none. A concavity where another part occludes this one does not count as a notch.
bool BlobSplitter::isMoreConvex(const Blob& blob) {
  shape(rect_.size(), canvas_store_, canvas_);
  canvas_.setTo(0);
  for (const Blob& part : parts_) paintHull(part);
  const int left = countNotches();
  paintHull(blob);
  const double bow = kBow_px * cv::arcLength(hull_, true);
  const double notches = countNotches() - bow, still = std::max(0.0, left - bow);
  return notches >= 0.5 * (1.0 - options_.max_solidity) * blob.area_px &&
         notches - still >= options_.min_gain * notches;
}

/// Chromaticity of the mean over the 3×3 pixels that belong to the region.
void BlobSplitter::gather(const cv::Mat& image, const Blob& blob) {
  const int stride = rect_.width + kSpare;
  shape(rect_.size(), inside_store_, inside_);
  shape({stride, rect_.height}, red_store_, red_);
  shape({stride, rect_.height}, green_store_, green_);
  shape({3 * (rect_.width + 2), rect_.height + 2}, masked_store_, masked_);
  inside_.setTo(0);
  masked_.setTo(0);
  sums_.resize(static_cast<std::size_t>(masked_.cols + 3 * kSpare));
  bins_.resize(static_cast<std::size_t>(stride));
  histogram_.fill(0);
  for (const Run& run : blob.runs) {
    const int y = run.row - rect_.y, x = run.begin - rect_.x;
    const auto length = static_cast<std::size_t>(run.end - run.begin);
    std::memset(inside_.ptr(y) + x, 1, length);
    std::memcpy(masked_.ptr(y + 1) + 3 * (x + 1), image.ptr(run.row) + 3 * run.begin, 3 * length);
  }
  int summed = -1;
  for (const Run& run : blob.runs) {
    const int y = run.row - rect_.y, x = run.begin - rect_.x, n = run.end - run.begin;
    if (y != summed) {
      sumNine(masked_.ptr(y), masked_.ptr(y + 1), masked_.ptr(y + 2), rect_.width, sums_.data());
      takeShares(sums_.data(), rect_.width, red_.ptr<float>(y), green_.ptr<float>(y));
    }
    summed = y;
    takeBins(red_.ptr<float>(y) + x, green_.ptr<float>(y) + x, n, kBins, bins_.data());
    for (int i = 0; i < n; ++i) ++histogram_[static_cast<std::size_t>(bins_[static_cast<std::size_t>(i)])];
  }
}

/// Modes of the chromaticity histogram, the fullest first.
void BlobSplitter::findColours(int area) {
  modes_.clear();
  for (int i = 1; i + 1 < kBins; ++i) {
    for (int j = 1; j + 1 < kBins; ++j) {
      int count = 0;
      float r = 0, g = 0;
      for (int di = -1; di <= 1; ++di) {
        for (int dj = -1; dj <= 1; ++dj) {
          const int n = histogram_[static_cast<std::size_t>((i + di) * kBins + j + dj)];
          count += n;
          r += static_cast<float>(n) * (static_cast<float>(i + di) + 0.5f) / kBins;
          g += static_cast<float>(n) * (static_cast<float>(j + dj) + 0.5f) / kBins;
        }
      }
      if (count > 0)
        modes_.push_back({count, {r / static_cast<float>(count), g / static_cast<float>(count)}});
    }
  }
  const int least = std::max(options_.min_area_px, static_cast<int>(options_.min_share * area)) / 2;
  const auto step = static_cast<float>(options_.hue_step);
  colours_.clear();
  while (static_cast<int>(colours_.size()) < kMaxColours) {
    const Mode* best = nullptr;
    for (const Mode& mode : modes_) {
      if (best != nullptr && mode.count <= best->count) continue;
      const bool taken = std::any_of(colours_.begin(), colours_.end(), [&](const Colour& c) {
        return std::hypot(c.r - mode.colour.r, c.g - mode.colour.g) < step;
      });
      if (!taken) best = &mode;
    }
    if (best == nullptr || best->count < least) return;
    colours_.push_back(best->colour);
  }
}

void BlobSplitter::assign(const Blob& blob) {
  shape(rect_.size(), class_store_, class_);
  class_.setTo(0);
  float reds[kMaxColours], greens[kMaxColours];
  for (std::size_t k = 0; k < colours_.size(); ++k) {
    reds[k] = colours_[k].r;
    greens[k] = colours_[k].g;
  }
  nearest_.resize(static_cast<std::size_t>(rect_.width));
  for (const Run& run : blob.runs) {
    const int y = run.row - rect_.y, x = run.begin - rect_.x;
    takeNearest(red_.ptr<float>(y) + x, green_.ptr<float>(y) + x, run.end - run.begin, reds, greens,
                static_cast<int>(colours_.size()), nearest_.data(), bins_.data(), class_.ptr(y) + x);
  }
}

/// Assigns to each pixel the most frequent class of its 5×5 neighbourhood, or its own on a tie. Mixed pixels
/// along outlines would otherwise form classes of their own.
void BlobSplitter::takeMajority() {
  constexpr int kReach = 2;
  shape({rect_.width + 2 * kReach, rect_.height + 2 * kReach}, spare_store_, spare_);
  spare_.setTo(0);
  class_.copyTo(spare_(cv::Rect(kReach, kReach, rect_.width, rect_.height)));
  const auto width = static_cast<std::size_t>(rect_.width);
  line_.resize(width + 2 * kReach);
  counts_.assign((kMaxColours + 2) * width, 0);
  for (int y = 0; y < rect_.height; ++y) {
    const std::uint8_t* rows[2 * kReach + 1];
    for (int k = 0; k <= 2 * kReach; ++k) rows[k] = spare_.ptr(y + k);
    takeCommonest(rows, rect_.width, static_cast<int>(colours_.size()), line_.data(), counts_.data(),
                  class_.ptr(y));
  }
}

/// Finds the runs of one class in each row of the rectangle.
void BlobSplitter::findRuns() {
  runs_.clear();
  row_begin_.clear();
  for (int y = 0; y < rect_.height; ++y) {
    row_begin_.push_back(runs_.size());
    const std::uint8_t* row = class_.ptr(y);
    for (int x = 0; x < rect_.width;) {
      int end = x + 1;
      while (end < rect_.width && row[end] == row[x]) ++end;
      if (row[x] != 0) runs_.push_back({x, end, runs_.size(), row[x]});
      x = end;
    }
  }
  row_begin_.push_back(runs_.size());
}

/// Calls visit(above, below, pixels) for each pair of runs in neighbouring rows that touch vertically.
/// `pixels` is the length of the contact.
template <typename Visit>
void BlobSplitter::forTouchingRows(Visit visit) {
  for (std::size_t row = 1; row + 1 < row_begin_.size(); ++row) {
    std::size_t above = row_begin_[row - 1];
    for (std::size_t here = row_begin_[row]; here < row_begin_[row + 1]; ++here) {
      while (above < row_begin_[row] && runs_[above].end <= runs_[here].begin) ++above;
      for (std::size_t k = above; k < row_begin_[row] && runs_[k].begin < runs_[here].end; ++k)
        visit(k, here, std::min(runs_[k].end, runs_[here].end) - std::max(runs_[k].begin, runs_[here].begin));
    }
  }
}

std::size_t BlobSplitter::leader(std::size_t run) {
  for (; runs_[run].piece != run; run = runs_[run].piece) runs_[run].piece = runs_[runs_[run].piece].piece;
  return run;
}

/// Finds connected pixels (4 neighbours) of one class. Pieces are numbered by their first pixel in reading
/// order.
void BlobSplitter::findPieces() {
  findRuns();
  forTouchingRows([&](std::size_t above, std::size_t below, int) {
    if (runs_[above].colour != runs_[below].colour) return;
    const std::size_t a = leader(above), b = leader(below);
    runs_[std::max(a, b)].piece = std::min(a, b);
  });
  for (std::size_t i = 0; i < runs_.size(); ++i) runs_[i].piece = leader(i);
  pieces_.assign(1, Piece{});
  for (std::size_t i = 0; i < runs_.size(); ++i) {  // the leader of a set precedes its members
    if (runs_[i].piece == i) {
      runs_[i].piece = pieces_.size();
      pieces_.emplace_back();
    } else {
      runs_[i].piece = runs_[runs_[i].piece].piece;
    }
    pieces_[runs_[i].piece].area += runs_[i].end - runs_[i].begin;
  }
  joined_.resize(pieces_.size());
  for (std::size_t i = 0; i < joined_.size(); ++i) joined_[i] = i;
  if (pieces_.size() <= kMaxPieces) measureBorders();
}

/// Every pixel has four edges. An edge without a pixel of the region behind it is an outside edge.
void BlobSplitter::measureBorders() {
  shared_.assign(pieces_.size() * pieces_.size(), 0);
  const auto meet = [&](std::size_t a, std::size_t b, int edges) {
    for (const std::size_t piece : {a, b}) pieces_[piece].outside -= edges;
    if (a == b) return;
    shared(a, b) += edges;
    shared(b, a) += edges;
    for (const std::size_t piece : {a, b}) pieces_[piece].shared += edges;
  };
  for (const ClassRun& run : runs_) pieces_[run.piece].outside += 2 * (run.end - run.begin) + 2;
  forTouchingRows([&](std::size_t above, std::size_t below, int edges) {
    meet(runs_[above].piece, runs_[below].piece, edges);
  });
  for (std::size_t row = 0; row + 1 < row_begin_.size(); ++row)
    for (std::size_t i = row_begin_[row] + 1; i < row_begin_[row + 1]; ++i)
      if (runs_[i - 1].end == runs_[i].begin) meet(runs_[i - 1].piece, runs_[i].piece, 1);
}

/// Merges the smallest piece that does not qualify as an object into the neighbour with the longest common
/// border. Returns false if all pieces qualify.
bool BlobSplitter::mergeOne(int area) {
  const int least = std::max(options_.min_area_px, static_cast<int>(options_.min_share * area));
  std::size_t which = 0;
  for (std::size_t i = 1; i < pieces_.size(); ++i) {
    const Piece& piece = pieces_[i];
    if (piece.area == 0 || piece.shared == 0) continue;
    const bool object =
        piece.area >= least && piece.outside >= options_.min_outline * (piece.outside + piece.shared);
    if (!object && (which == 0 || piece.area < pieces_[which].area)) which = i;
  }
  if (which == 0) return false;
  Piece& piece = pieces_[which];
  const auto edges = shared_.begin() + static_cast<std::ptrdiff_t>(which * pieces_.size());
  const auto into = static_cast<std::size_t>(
      std::max_element(edges, edges + static_cast<std::ptrdiff_t>(pieces_.size())) - edges);
  Piece& other = pieces_[into];
  other.area += piece.area;
  other.outside += piece.outside;
  other.shared += piece.shared - 2 * shared(which, into);
  for (std::size_t k = 1; k < pieces_.size(); ++k) {
    if (k == into || k == which) continue;
    shared(into, k) += shared(which, k);
    shared(k, into) += shared(k, which);
    shared(k, which) = 0;
  }
  shared(into, which) = 0;
  std::fill(edges, edges + static_cast<std::ptrdiff_t>(pieces_.size()), 0);
  piece = Piece{};
  joined_[which] = into;
  return true;
}

void BlobSplitter::mergeSmall(int area) {
  if (pieces_.size() > kMaxPieces) {
    pieces_.clear();
    return;
  }
  while (mergeOne(area)) {
  }
  // A piece without a neighbour to join touches the region only at a corner, or was connected to it. Such a
  // piece is too small to be an object.
  for (Piece& piece : pieces_)
    if (piece.area < options_.min_area_px && piece.shared == 0) piece.area = 0;
}

void BlobSplitter::write(const Blob& blob) {
  std::vector<int> part_of(pieces_.size(), -1);
  for (std::size_t i = 1; i < pieces_.size(); ++i) {
    if (pieces_[i].area == 0) continue;
    part_of[i] = static_cast<int>(parts_.size());
    parts_.emplace_back();
    parts_.back().label = blob.label;
    parts_.back().area_px = pieces_[i].area;
  }
  if (parts_.size() < 2) {
    parts_.clear();
    return;
  }
  for (std::size_t i = 1; i < pieces_.size(); ++i) {
    std::size_t into = i;
    while (joined_[into] != into) into = joined_[into];
    part_of[i] = part_of[into];
  }
  for (int y = 0; y < rect_.height; ++y) {
    const auto row = static_cast<std::size_t>(y);
    for (std::size_t i = row_begin_[row]; i < row_begin_[row + 1];) {
      const int part = part_of[runs_[i].piece];
      const int begin = runs_[i].begin + rect_.x;
      int end = runs_[i].end + rect_.x;
      for (++i; i < row_begin_[row + 1] && runs_[i].begin + rect_.x == end && part_of[runs_[i].piece] == part;
           ++i)
        end = runs_[i].end + rect_.x;
      if (part >= 0) addRun({y + rect_.y, begin, end}, static_cast<std::size_t>(part));
    }
  }
}

void BlobSplitter::addRun(const Run& run, std::size_t part) {
  Blob& to = parts_[part];
  const cv::Rect here(run.begin, run.row, run.end - run.begin, 1);
  to.rect = to.runs.empty() ? here : to.rect | here;
  to.runs.push_back(run);
  std::fill(mask_.ptr(run.row) + run.begin, mask_.ptr(run.row) + run.end,
            static_cast<std::uint8_t>(part + 1));
}

}  // namespace omnifleet::ground
