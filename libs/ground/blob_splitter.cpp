#include "ground/blob_splitter.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

const cv::Point kAround[4] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
constexpr int kMaxPieces = 200;  // more is texture
constexpr double kBow_px = 0.4;  // by which straight edges on the floor bow inward in the image, and rounding

/// Sums of 3×3 pixels; rows of interleaved colours with one pixel of margin to each side.
OMNIFLEET_WIDE void sumNine(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* below,
                            int width, std::uint16_t* sums) {
#pragma GCC ivdep
  for (int i = 0; i < 3 * (width + 2); ++i)
    sums[i] = static_cast<std::uint16_t>(above[i] + here[i] + below[i]);
#pragma GCC ivdep
  for (int i = 0; i < 3 * width; ++i)
    sums[i] = static_cast<std::uint16_t>(sums[i] + sums[i + 3] + sums[i + 6]);
}

/// The commonest class of the 5×5 neighbourhood, a pixel's own among equals. Rows of classes with two pixels
/// of margin to each side; n sums per class are scratch.
OMNIFLEET_WIDE void takeCommonest(const std::uint8_t* const* rows, int width, int classes,
                                  std::uint8_t* scratch, std::uint8_t* counts, std::uint8_t* out) {
  const std::uint8_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4];
  const std::uint8_t* own = c + 2;
  std::uint8_t* own_count = counts + (classes + 1) * width;
  for (int k = 1; k <= classes; ++k) {
    const auto which = static_cast<std::uint8_t>(k);
#pragma GCC ivdep
    for (int x = 0; x < width + 4; ++x) {
      scratch[x] = static_cast<std::uint8_t>((a[x] == which) + (b[x] == which) + (c[x] == which) +
                                             (d[x] == which) + (e[x] == which));
    }
    std::uint8_t* count = counts + k * width;
#pragma GCC ivdep
    for (int x = 0; x < width; ++x) {
      count[x] = static_cast<std::uint8_t>(scratch[x] + scratch[x + 1] + scratch[x + 2] + scratch[x + 3] +
                                           scratch[x + 4]);
      own_count[x] = own[x] == which ? count[x] : own_count[x];
    }
  }
#pragma GCC ivdep
  for (int x = 0; x < width; ++x) out[x] = own[x];
  for (int k = 1; k <= classes; ++k) {
    const auto which = static_cast<std::uint8_t>(k);
    const std::uint8_t* count = counts + k * width;
#pragma GCC ivdep
    for (int x = 0; x < width; ++x) {
      const bool more = (count[x] > own_count[x]) & (own[x] != 0);
      out[x] = more ? which : out[x];
      own_count[x] = more ? count[x] : own_count[x];
    }
  }
}

/// A matrix of that size over storage that only ever grows.
template <typename T>
void shape(cv::Size size, std::vector<T>& storage, cv::Mat_<T>& mat) {
  storage.resize(std::max(storage.size(), static_cast<std::size_t>(size.area())));
  mat = cv::Mat_<T>(size.height, size.width, storage.data());
}

bool contains(const cv::Mat& mat, cv::Point p) {
  return p.x >= 0 && p.y >= 0 && p.x < mat.cols && p.y < mat.rows;
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
  assign();
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

/// Adds the hull of a region to the canvas.
void BlobSplitter::paintHull(const Blob& blob) {
  corners_.clear();
  for (const Run& run : blob.runs) {
    corners_.emplace_back(run.begin - rect_.x, run.row - rect_.y);
    corners_.emplace_back(run.end - 1 - rect_.x, run.row - rect_.y);
  }
  cv::convexHull(corners_, hull_);
  cv::fillConvexPoly(canvas_, hull_, 1);
}

/// Pixels of the canvas that are not of the region.
int BlobSplitter::countNotches() const {
  int count = 0;
  for (int y = 0; y < rect_.height; ++y)
    for (int x = 0; x < rect_.width; ++x) count += canvas_(y, x) != 0 && inside_(y, x) == 0 ? 1 : 0;
  return count;
}

/// Things that stand before one another leave notches where their outlines meet; marks on one thing do not.
/// Where one part bites into another it stands before it: that is no notch.
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
  shape(rect_.size(), inside_store_, inside_);
  shape(rect_.size(), chroma_store_, chroma_);
  shape({3 * (rect_.width + 2), rect_.height + 2}, masked_store_, masked_);
  inside_.setTo(0);
  masked_.setTo(0);
  sums_.resize(static_cast<std::size_t>(masked_.cols));
  for (const Run& run : blob.runs) {
    const int y = run.row - rect_.y, x = run.begin - rect_.x;
    const auto length = static_cast<std::size_t>(run.end - run.begin);
    std::memset(inside_.ptr(y) + x, 1, length);
    std::memcpy(masked_.ptr(y + 1) + 3 * (x + 1), image.ptr(run.row) + 3 * run.begin, 3 * length);
  }
  int summed = -1;
  for (const Run& run : blob.runs) {
    const int y = run.row - rect_.y;
    if (y != summed)
      sumNine(masked_.ptr(y), masked_.ptr(y + 1), masked_.ptr(y + 2), rect_.width, sums_.data());
    summed = y;
    cv::Vec2f* chroma = chroma_.ptr<cv::Vec2f>(y);
    for (int x = run.begin - rect_.x; x < run.end - rect_.x; ++x) {
      const std::uint16_t* c = sums_.data() + 3 * x;
      const float sum = static_cast<float>(std::max(1, c[0] + c[1] + c[2]));
      chroma[x] = cv::Vec2f(static_cast<float>(c[2]) / sum, static_cast<float>(c[1]) / sum);
    }
  }
}

/// Modes of the histogram of chromaticities, the fullest first.
void BlobSplitter::findColours(int area) {
  histogram_.fill(0);
  const auto bin = [](float v) { return std::min(kBins - 1, static_cast<int>(v * kBins)); };
  for (int y = 0; y < rect_.height; ++y)
    for (int x = 0; x < rect_.width; ++x)
      if (inside_(y, x) != 0)
        ++histogram_[static_cast<std::size_t>(bin(chroma_(y, x)[0]) * kBins + bin(chroma_(y, x)[1]))];
  const int least = std::max(options_.min_area_px, static_cast<int>(options_.min_share * area)) / 2;
  const auto step = static_cast<float>(options_.hue_step);
  colours_.clear();
  while (static_cast<int>(colours_.size()) < kMaxColours) {
    int best = 0;
    Colour colour{0, 0};
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
        if (count <= best) continue;
        const Colour here{r / static_cast<float>(count), g / static_cast<float>(count)};
        const bool taken = std::any_of(colours_.begin(), colours_.end(), [&](const Colour& c) {
          return std::hypot(c.r - here.r, c.g - here.g) < step;
        });
        if (taken) continue;
        best = count;
        colour = here;
      }
    }
    if (best < least) return;
    colours_.push_back(colour);
  }
}

void BlobSplitter::assign() {
  shape(rect_.size(), class_store_, class_);
  for (int y = 0; y < rect_.height; ++y) {
    for (int x = 0; x < rect_.width; ++x) {
      class_(y, x) = 0;
      if (inside_(y, x) == 0) continue;
      float nearest = 1e9f;
      for (std::size_t k = 0; k < colours_.size(); ++k) {
        const float dr = chroma_(y, x)[0] - colours_[k].r, dg = chroma_(y, x)[1] - colours_[k].g;
        if (dr * dr + dg * dg >= nearest) continue;
        nearest = dr * dr + dg * dg;
        class_(y, x) = static_cast<std::uint8_t>(k + 1);
      }
    }
  }
}

/// Each pixel takes the commonest class of its 5×5 neighbourhood, its own among equals: mixed pixels along
/// outlines have colours of their own.
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

void BlobSplitter::findPieces() {
  shape(rect_.size(), piece_store_, piece_);
  piece_.setTo(0);
  pieces_.assign(1, Piece{});
  for (int y = 0; y < rect_.height; ++y)
    for (int x = 0; x < rect_.width; ++x)
      if (class_(y, x) != 0 && piece_(y, x) == 0) growPiece({x, y});
  joined_.resize(pieces_.size());
  for (std::size_t i = 0; i < joined_.size(); ++i) joined_[i] = i;
  if (pieces_.size() > kMaxPieces) return;
  shared_.assign(pieces_.size() * pieces_.size(), 0);
  for (int y = 0; y < rect_.height; ++y) {
    for (int x = 0; x < rect_.width; ++x) {
      if (piece_(y, x) == 0) continue;
      Piece& own = pieces_[static_cast<std::size_t>(piece_(y, x))];
      for (const cv::Point& step : kAround) {
        const cv::Point p = cv::Point(x, y) + step;
        const int other = contains(piece_, p) ? piece_(p) : 0;
        if (other == 0) ++own.outside;
        if (other == 0 || other == piece_(y, x)) continue;
        ++shared(static_cast<std::size_t>(piece_(y, x)), static_cast<std::size_t>(other));
        ++own.shared;
      }
    }
  }
}

void BlobSplitter::growPiece(cv::Point start) {
  const int id = static_cast<int>(pieces_.size());
  pieces_.emplace_back();
  piece_(start) = id;
  stack_.assign(1, start);
  while (!stack_.empty()) {
    const cv::Point at = stack_.back();
    stack_.pop_back();
    ++pieces_.back().area;
    for (const cv::Point& step : kAround) {
      const cv::Point p = at + step;
      if (!contains(piece_, p) || piece_(p) != 0 || class_(p) != class_(at)) continue;
      piece_(p) = id;
      stack_.push_back(p);
    }
  }
}

/// The smallest piece that is no thing joins the neighbour with which it shares most; false when all are.
bool BlobSplitter::mergeOne(int area) {
  const int least = std::max(options_.min_area_px, static_cast<int>(options_.min_share * area));
  std::size_t which = 0;
  for (std::size_t i = 1; i < pieces_.size(); ++i) {
    const Piece& piece = pieces_[i];
    if (piece.area == 0 || piece.shared == 0) continue;
    const bool thing =
        piece.area >= least && piece.outside >= options_.min_outline * (piece.outside + piece.shared);
    if (!thing && (which == 0 || piece.area < pieces_[which].area)) which = i;
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
  for (const Run& run : blob.runs) {
    const int* row = piece_.ptr<int>(run.row - rect_.y) - rect_.x;
    for (int x = run.begin; x < run.end;) {
      const int part = part_of[static_cast<std::size_t>(row[x])];
      int end = x + 1;
      while (end < run.end && part_of[static_cast<std::size_t>(row[end])] == part) ++end;
      Blob& to = parts_[static_cast<std::size_t>(part)];
      const cv::Rect here(x, run.row, end - x, 1);
      to.rect = to.runs.empty() ? here : to.rect | here;
      to.runs.push_back({run.row, x, end});
      std::fill(mask_.ptr(run.row) + x, mask_.ptr(run.row) + end, static_cast<std::uint8_t>(part + 1));
      x = end;
    }
  }
}

}  // namespace omnifleet::ground
