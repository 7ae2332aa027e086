#include "ground/shade_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "geometry/wide.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kMinRegion_px = 12;       // smaller ones are noise, whatever they are
constexpr int kMinCore_px = 16;         // fewer pixels that are no shade make no thing
constexpr float kMinCoreShare = 0.08f;  // of the region, likewise
constexpr float kFaintShare = 0.75f;    // of a region, from which it may be the floor's own pattern
constexpr int kPatternRegions = 3;      // that many faint ones at once are a pattern
constexpr float kFaintFringe = 0.06f;   // of a region, from which faint pixels are more than its mixed edge
constexpr float kFaces = 2.0f;       // faces of one grey thing differ less in brightness than by this factor
constexpr int kStep_px = 3;          // to each side of an outline, where the brightness is compared
constexpr float kSharpShare = 0.5f;  // of the region's difference from the floor, reached within these steps

/// The looks of a floor in shadow or with a faint pattern are consecutive.
struct FloorLooks {
  Look first = 255, last = 0;
  FloorLooks() {
    for (int look = 0; look < 256; ++look) {
      if (!isShade(static_cast<Look>(look)) && !isFaint(static_cast<Look>(look))) continue;
      first = std::min(first, static_cast<Look>(look));
      last = static_cast<Look>(look);
    }
  }
};

/// bare = 1 where the mask is set by something that is neither shade nor a faint pattern, else 0.
OMNIFLEET_WIDE void takeFloorOut(const Strip* strips, std::size_t count, const FloorLooks& floor,
                                 const cv::Mat1b& mask, const cv::Mat1b& looks, cv::Mat1b& bare) {
  const Look first = floor.first, last = floor.last;
  for (const Strip* strip = strips; strip != strips + count; ++strip) {
    const int begin = strip->begin_px, end = strip->end_px, top = strip->cell_row * kCell;
    for (int y = top; y < top + kCell; ++y) {
      const std::uint8_t *set = mask.ptr(y), *look = looks.ptr(y);
      std::uint8_t* to = bare.ptr(y);
#pragma GCC ivdep
      for (int x = begin; x < end; ++x)
        to[x] = (set[x] != 0) & !((look[x] >= first) & (look[x] <= last)) ? 1 : 0;
    }
  }
}

/// Masks of 0 and 255.
OMNIFLEET_WIDE void keepWithin(const std::uint8_t* allowed, std::size_t n, std::uint8_t* mask) {
#pragma GCC ivdep
  for (std::size_t x = 0; x < n; ++x) mask[x] = static_cast<std::uint8_t>(mask[x] & allowed[x]);
}

float gainAt(const ShadeFilter::Frame& frame, int x, int y) {
  x = std::clamp(x, 0, frame.image.cols - 1);
  y = std::clamp(y, 0, frame.image.rows - 1);
  const auto& p = frame.image.at<cv::Vec3b>(y, x);
  const cv::Vec3f& r =
      frame.floor(std::min(y / kCell, frame.floor.rows - 1), std::min(x / kCell, frame.floor.cols - 1));
  const float rr = std::max(1.0f, r.dot(r));
  return (static_cast<float>(p[0]) * r[0] + static_cast<float>(p[1]) * r[1] +
          static_cast<float>(p[2]) * r[2]) /
         rr;
}

/// Mean over three pixels across the step's direction.
float meanGain(const ShadeFilter::Frame& frame, int x, int y, int across_x, int across_y) {
  return (gainAt(frame, x, y) + gainAt(frame, x + across_x, y + across_y) +
          gainAt(frame, x - across_x, y - across_y)) /
         3.0f;
}

}  // namespace

ShadeFilter::ShadeFilter(cv::Size image) : bare_(image, std::uint8_t{0}), core_(image, std::uint8_t{0}) {}

void ShadeFilter::clear() {
  clearStrips(core_strips_, bare_);
  clearStrips(core_strips_, core_);
  core_strips_.clear();
  undecided_.clear();
}

ShadeFilter::Census ShadeFilter::count(const Blob& blob, const cv::Mat1b& looks) {
  std::array<int, 256> pixels{}, others{};  // of each look; in two parts, as equal looks wait for each other
  for (const Run& run : blob.runs) {
    const Look* row = looks.ptr(run.row);
    int x = run.begin;
    for (; x + 1 < run.end; x += 2) {
      ++pixels[row[x]];
      ++others[row[x + 1]];
    }
    if (x < run.end) ++pixels[row[x]];
  }
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] += others[i];
  Census census;
  census.coloured = pixels[kColourLook];
  for (int i = 0; i < 256; ++i) {
    const auto look = static_cast<Look>(i);
    const int n = pixels[look];
    if (n == 0 || !isGrey(look)) continue;
    const float gain = gainOf(look);
    if (isFaint(look)) census.faint += n;
    if (isOfPattern(look)) census.patterned += n;
    if (isShade(look)) {
      census.shaded += n;
      census.shaded_gain += static_cast<float>(n) * gain;
    } else if (gain < 1.0f) {
      census.dark += n;
      census.dark_gain += static_cast<float>(n) * gain;
    } else {
      census.bright += n;
    }
  }
  census.shaded_gain /= static_cast<float>(std::max(1, census.shaded));
  census.dark_gain /= static_cast<float>(std::max(1, census.dark));
  return census;
}

bool ShadeFilter::isSharp(const Blob& blob, const Frame& frame, const cv::Mat1b& looks) {
  float depth = 0.0f;
  int grey = 0;
  for (const Run& run : blob.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      if (!isGrey(looks(run.row, x))) continue;
      depth += std::abs(gainOf(looks(run.row, x)) - 1.0f);
      ++grey;
    }
  }
  depth /= static_cast<float>(std::max(1, grey));
  int sharp = 0, count = 0;
  for (const Run& run : blob.runs) {
    for (const int x : {run.begin, run.end - 1}) {
      const float across =
          meanGain(frame, x + kStep_px, run.row, 0, 1) - meanGain(frame, x - kStep_px, run.row, 0, 1);
      const float down =
          meanGain(frame, x, run.row + kStep_px, 1, 0) - meanGain(frame, x, run.row - kStep_px, 1, 0);
      sharp += std::max(std::abs(across), std::abs(down)) >= kSharpShare * depth ? 1 : 0;
      ++count;
    }
  }
  return 2 * sharp > count;
}

ShadeFilter::Verdict ShadeFilter::judge(const Blob& blob, const Census& c, const Frame& frame,
                                        const cv::Mat1b& looks) {
  if (static_cast<float>(c.faint) >= kFaintShare * static_cast<float>(blob.area_px))
    return Verdict::kUndecided;
  const int core = c.coloured + c.dark + c.bright;
  const bool has_core =
      core >= kMinCore_px && static_cast<float>(core) >= kMinCoreShare * static_cast<float>(blob.area_px);
  if (!has_core || 2 * c.bright > blob.area_px) {
    const bool all_light = 4 * (c.coloured + c.dark) < blob.area_px;
    return all_light && !isSharp(blob, frame, looks) ? Verdict::kDrop : Verdict::kKeep;
  }
  const bool fringed = static_cast<float>(c.faint) > kFaintFringe * static_cast<float>(blob.area_px);
  if (c.shaded > 0 && (c.coloured > c.dark || c.shaded_gain > kFaces * c.dark_gain))
    return Verdict::kKeepCore;
  return fringed ? Verdict::kKeepFirm : Verdict::kKeep;
}

void ShadeFilter::apply(const std::vector<Strip>& strips, const Frame& frame, const cv::Mat1b& looks,
                        const cv::Mat1b& raw, Despeckler& despeckler, cv::Mat1b& objects) {
  static const FloorLooks kFloorLooks;
  const std::vector<Blob>& blobs = labeller_.label(objects, strips, kMinRegion_px);
  judgeAll(blobs, frame, looks);
  findCoreStrips(strips, blobs);
  takeFloorOut(core_strips_.data(), core_strips_.size(), kFloorLooks, raw, looks, bare_);
  despeckler.clean(core_strips_, bare_, core_);
  for (std::size_t i = 0; i < blobs.size(); ++i) carryOut(blobs[i], judged_[i].verdict, looks, objects);
}

/// The strips around the regions of which only the core stays, with what despeckling looks at beside them.
void ShadeFilter::findCoreStrips(const std::vector<Strip>& strips, const std::vector<Blob>& blobs) {
  core_rects_.clear();
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const cv::Rect& r = blobs[i].rect;
    if (judged_[i].verdict == Verdict::kKeepCore)
      core_rects_.emplace_back(r.x - kCell, r.y - kCell, r.width + 2 * kCell, r.height + 2 * kCell);
  }
  core_strips_.clear();
  for (const Strip& strip : strips) {
    const cv::Rect here(strip.begin_px, strip.cell_row * kCell, strip.end_px - strip.begin_px, kCell);
    const auto meets = [&](const cv::Rect& rect) { return !(rect & here).empty(); };
    if (std::any_of(core_rects_.begin(), core_rects_.end(), meets)) core_strips_.push_back(strip);
  }
}

void ShadeFilter::judgeAll(const std::vector<Blob>& blobs, const Frame& frame, const cv::Mat1b& looks) {
  judged_.clear();
  int faint = 0;
  for (const Blob& blob : blobs) {
    const Census census = count(blob, looks);
    const auto least = static_cast<int>(kFaintShare * static_cast<float>(blob.area_px));
    judged_.push_back({judge(blob, census, frame, looks), census.patterned > least});
    faint += judged_.back().verdict == Verdict::kUndecided ? 1 : 0;
  }
  if (faint < kPatternRegions) return;
  for (Judged& judged : judged_) {
    if (judged.as_pattern && judged.verdict != Verdict::kDrop) judged.verdict = Verdict::kUndecided;
  }
}

void ShadeFilter::carryOut(const Blob& blob, Verdict verdict, const cv::Mat1b& looks, cv::Mat1b& objects) {
  if (verdict == Verdict::kKeep) return;
  if (verdict == Verdict::kUndecided) undecided_.push_back(blob);
  for (const Run& run : blob.runs) {
    std::uint8_t* to = objects.ptr(run.row);
    const std::uint8_t* core = core_.ptr(run.row);
    const Look* look = looks.ptr(run.row);
    const auto n = static_cast<std::size_t>(run.end - run.begin);
    if (verdict == Verdict::kKeepCore) {
      keepWithin(core + run.begin, n, to + run.begin);
    } else if (verdict == Verdict::kKeepFirm) {
      for (int x = run.begin; x < run.end; ++x)
        if (isFaint(look[x])) to[x] = 0;
    } else {
      std::memset(to + run.begin, 0, n);
    }
  }
}

}  // namespace omnifleet::ground
