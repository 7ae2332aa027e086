#include "ground/blob_splitter.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

const cv::Point kAround[4] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
constexpr int kMaxPieces = 200;  // more is texture
constexpr double kBow_px = 0.4;  // by which straight edges on the floor bow inward in the image, and rounding

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
  canvas_.create(rect_.size());
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
  inside_.create(rect_.size());
  inside_.setTo(0);
  chroma_.create(rect_.size());
  for (const Run& run : blob.runs)
    std::fill(inside_.ptr(run.row - rect_.y) + run.begin - rect_.x,
              inside_.ptr(run.row - rect_.y) + run.end - rect_.x, std::uint8_t{1});
  for (const Run& run : blob.runs) {
    const int y = run.row - rect_.y;
    for (int x = run.begin - rect_.x; x < run.end - rect_.x; ++x) {
      int b = 0, g = 0, r = 0;
      for (int dy = std::max(-1, -y); dy <= 1 && y + dy < rect_.height; ++dy) {
        for (int dx = std::max(-1, -x); dx <= 1 && x + dx < rect_.width; ++dx) {
          if (inside_(y + dy, x + dx) == 0) continue;
          const auto& p = image.at<cv::Vec3b>(rect_.y + y + dy, rect_.x + x + dx);
          b += p[0], g += p[1], r += p[2];
        }
      }
      const float sum = static_cast<float>(std::max(1, b + g + r));
      chroma_(y, x) = cv::Vec2f(static_cast<float>(r) / sum, static_cast<float>(g) / sum);
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
  class_.create(rect_.size());
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
  class_.copyTo(spare_);
  for (int y = 0; y < rect_.height; ++y) {
    for (int x = 0; x < rect_.width; ++x) {
      if (class_(y, x) == 0) continue;
      int count[kMaxColours + 1] = {};
      for (int v = std::max(0, y - 2); v <= std::min(rect_.height - 1, y + 2); ++v)
        for (int u = std::max(0, x - 2); u <= std::min(rect_.width - 1, x + 2); ++u) ++count[spare_(v, u)];
      std::uint8_t best = spare_(y, x);
      for (std::uint8_t k = 1; k <= kMaxColours; ++k)
        if (count[k] > count[best]) best = k;
      class_(y, x) = best;
    }
  }
}

void BlobSplitter::findPieces() {
  piece_.create(rect_.size());
  piece_.setTo(0);
  pieces_.assign(1, Piece{});
  for (int y = 0; y < rect_.height; ++y)
    for (int x = 0; x < rect_.width; ++x)
      if (class_(y, x) != 0 && piece_(y, x) == 0) growPiece({x, y});
  for (Piece& piece : pieces_) piece.shared.assign(pieces_.size(), 0);
  if (pieces_.size() > kMaxPieces) return;
  for (int y = 0; y < rect_.height; ++y) {
    for (int x = 0; x < rect_.width; ++x) {
      if (piece_(y, x) == 0) continue;
      Piece& own = pieces_[static_cast<std::size_t>(piece_(y, x))];
      for (const cv::Point& step : kAround) {
        const cv::Point p = cv::Point(x, y) + step;
        const int other = contains(piece_, p) ? piece_(p) : 0;
        if (other == 0) ++own.outside;
        if (other != 0 && other != piece_(y, x)) ++own.shared[static_cast<std::size_t>(other)];
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
    int shared = 0;
    for (const int n : piece.shared) shared += n;
    if (piece.area == 0 || shared == 0) continue;
    const bool thing =
        piece.area >= least && piece.outside >= options_.min_outline * (piece.outside + shared);
    if (!thing && (which == 0 || piece.area < pieces_[which].area)) which = i;
  }
  if (which == 0) return false;
  Piece& piece = pieces_[which];
  const auto into = static_cast<std::size_t>(std::max_element(piece.shared.begin(), piece.shared.end()) -
                                             piece.shared.begin());
  Piece& other = pieces_[into];
  other.area += piece.area;
  other.outside += piece.outside;
  for (std::size_t k = 1; k < pieces_.size(); ++k) {
    if (k == into || k == which) continue;
    other.shared[k] += piece.shared[k];
    pieces_[k].shared[into] += pieces_[k].shared[which];
    pieces_[k].shared[which] = 0;
  }
  other.shared[which] = 0;
  piece = Piece{0, 0, std::vector<int>(pieces_.size(), 0)};
  piece_.setTo(static_cast<int>(into), piece_ == static_cast<int>(which));
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
  for (const Run& run : blob.runs) {
    const int* row = piece_.ptr<int>(run.row - rect_.y) - rect_.x;
    for (int x = run.begin; x < run.end;) {
      int end = x;
      while (end < run.end && row[end] == row[x]) ++end;
      const int part = part_of[static_cast<std::size_t>(row[x])];
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
