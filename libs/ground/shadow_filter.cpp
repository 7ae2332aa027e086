#include "ground/shadow_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "geometry/wide.h"
#include "ground/hue_test.h"
#include "ground/otsu_threshold.h"
#include "ground/sharp_outline.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kMinCore_px = 16;         // minimum number of pixels of an object that are not shadow
constexpr float kMinCoreShare = 0.08f;  // minimum share of the region for these pixels
constexpr float kFaintShare = 0.75f;    // share of a region from which it may be the floor's own pattern
constexpr int kPatternRegions = 3;      // this number of faint regions at once is a pattern
constexpr int kStrongPatternRegions =
    4;  // so is this number of regions of a pattern's contrast, including faint ones
constexpr float kTileShare =
    0.4f;  // share of a region that is little off the floor, from which it may be tiles and joints
constexpr float kLightTile =
    0.1f;  // share of a region that is lighter than a floor's pattern, from which it is no tile
constexpr float kLightShare =
    0.15f;  // share of a region that is lighter than the floor, from which it may be a top
constexpr float kFaintFringe =
    0.06f;                           // share of a region from which faint pixels are more than its mixed edge
constexpr float kFaces = 2.0f;       // greatest ratio of brightness between faces of one grey object
constexpr float kVagueShare = 0.1f;  // sharp share of a side's outline, below which it is certainly a shadow
constexpr float kSharpLight = 0.5f;  // sharp share of a lighter region's outline, above which it is an object
constexpr float kLeastTop =
    0.15f;  // share of the outline along plainly lighter pixels, from which they are a top
constexpr float kSharpTop =
    0.8f;  // sharp share of that part, from which it is an object whose side resembles the floor
constexpr float kVagueLight =
    0.25f;  // sharp share of the outline, below which the region is certainly a patch of light
constexpr int kMinVague_px = 100;   // smaller regions have too little outline to be vague
constexpr float kSharpSide = 0.4f;  // sharp share of the outline, from which a side is no shadow

constexpr float kLeastCaster = 0.25f;  // minimum share of the object in a region of an object and its shadow
constexpr float kMostInFront =
    0.5f;  // share of a region's shadow in front of the core, from which it is the shadow at its foot
constexpr int kBeside_px = 6;  // bearings beside the core that the shadow at its foot reaches
constexpr float kNone_px = 1e9f;
constexpr int kMinFoot_px =
    48;  // minimum number of pixels of a shadow at a foot; fewer are mixed pixels of an outline
constexpr float kFading = 0.25f;     // minimum share of that shadow that is hardly darker than the floor
constexpr float kLeastFace = 0.02f;  // minimum share of a region for a face of the object

// Marks of a region's pixels. Bit 0 is set for the core.
constexpr std::uint8_t kCore = 1, kShadow = HueWindow::kCounts, kHued = kShadow | kCore;

constexpr int kChunk_px = 32;

/// Marks the pixels of a region where the mask is set: kShadow for shadow (by the region's limit) and a faint
/// pattern, else kCore.
OMNIFLEET_WIDE void splitShadow(const Blob& blob, Appearance first, Appearance last, const cv::Mat1b& mask,
                                const cv::Mat1b& appearances, cv::Mat1b& marks) {
  for (const Run& run : blob.runs) {
    const std::uint8_t *set = mask.ptr(run.row), *appearance = appearances.ptr(run.row);
    std::uint8_t* to = marks.ptr(run.row);
    inChunks<kChunk_px>(
        run.begin, run.end, [=](int x) __attribute__((always_inline)) {
          const std::uint8_t mark = (appearance[x] >= first) & (appearance[x] <= last) ? kShadow : kCore;
          to[x] = set[x] != 0 ? mark : 0;
        });
  }
}

/// Keeps only the bit of the core: 1 for the core, 0 for all others.
OMNIFLEET_WIDE void keepCore(const Blob& blob, cv::Mat1b& marks) {
  for (const Run& run : blob.runs) {
    std::uint8_t* mark = marks.ptr(run.row);
    inChunks<kChunk_px>(
        run.begin, run.end, [=](int x) __attribute__((always_inline)) { mark[x] &= kCore; });
  }
}

/// The first x of [begin, end) with that mark; end where there is none.
int nextMark(const std::uint8_t* row, int begin, int end, std::uint8_t mark) {
  const void* found = std::memchr(row + begin, mark, static_cast<std::size_t>(end - begin));
  return found == nullptr ? end : static_cast<int>(static_cast<const std::uint8_t*>(found) - row);
}

/// Are these pixels of a region, which are not shadow, enough for an object?
bool isCore(int pixels, const Blob& blob) {
  return pixels >= kMinCore_px &&
         static_cast<float>(pixels) >= kMinCoreShare * static_cast<float>(blob.area_px);
}

/// Extends the values to neighbouring bearings.
void spreadOver(std::vector<float>& bearings) {
  const auto spread = [](auto begin, auto end) {
    int since = kBeside_px;
    float last = kNone_px;
    for (auto at = begin; at != end; ++at) {
      since = *at != kNone_px ? 0 : since + 1;
      if (since == 0) last = *at;
      if (since > 0 && since <= kBeside_px) *at = last;
    }
  };
  spread(bearings.begin(), bearings.end());
  spread(bearings.rbegin(), bearings.rend());
}

bool isOfShadow(Appearance appearance, Appearance shadow_limit) {
  return appearance >= shadow_limit && gainOf(appearance) < 1.0f;
}

}  // namespace

void ShadowFilter::clear() {
  clearStrips(core_strips_, bare_);
  ground::clear(core_area_, bare_bits_);
  ground::clear(core_area_, core_);
  undecided_.clear();
  vague_.clear();
  boards_.clear();
  faces_.clear();
  sides_.clear();
  lights_.clear();
  objects_.clear();
}

void ShadowFilter::markUndecided(const Blob& region) {
  const auto isIt = [&](const Blob& blob) { return blob.label == region.label && blob.rect == region.rect; };
  if (std::none_of(undecided_.begin(), undecided_.end(), isIt)) undecided_.push_back(region);
}

void ShadowFilter::decide(const BitMask& found) {
  const auto isFound = [&](const Blob& blob) {
    int in = 0;
    for (const Run& run : blob.runs)
      for (int x = run.begin; x < run.end; ++x) in += found.at(x, run.row) ? 1 : 0;
    return 2 * in > blob.area_px;
  };
  for (std::vector<Blob>* blobs : {&undecided_, &vague_})
    blobs->erase(std::remove_if(blobs->begin(), blobs->end(), isFound), blobs->end());
}

ShadowFilter::Census ShadowFilter::count(const Blob& blob, const cv::Mat1b& appearances) {
  // Histogram of appearances, in four partial counts: neighbouring pixels have equal values, and increments
  // of the same counter wait for each other.
  constexpr int kParts = 4;
  std::array<std::array<int, 256>, kParts> parts{};
  for (const Run& run : blob.runs) {
    const Appearance* row = appearances.ptr(run.row);
    int x = run.begin;
    for (; x + kParts <= run.end; x += kParts)
      for (int k = 0; k < kParts; ++k) ++parts[k][row[x + k]];
    for (; x < run.end; ++x) ++parts[0][row[x]];
  }
  std::array<int, 256>& pixels = parts[0];
  for (int k = 1; k < kParts; ++k)
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] += parts[k][i];
  Census census;
  census.coloured = pixels[kColourAppearance];
  census.shadow_limit = greyAppearance(kDeepestShadow);
  // Some pixels must be darker than any shadow; otherwise two kinds of floor would make an object.
  const int darkest =
      std::accumulate(pixels.begin() + kColourAppearance + 1, pixels.begin() + census.shadow_limit, 0);
  const Appearance threshold =
      isCore(darkest, blob) && 2 * census.coloured < blob.area_px ? otsuThreshold(pixels) : kFloorAppearance;
  if (threshold != kFloorAppearance) census.shadow_limit = threshold;
  for (int i = 0; i < 256; ++i) {
    const auto appearance = static_cast<Appearance>(i);
    const int n = pixels[appearance];
    if (n == 0 || !isGrey(appearance)) continue;
    const float gain = gainOf(appearance);
    if (isFaint(appearance)) census.faint += n;
    if (isOfPattern(appearance)) census.patterned += n;
    if (gain >= 1.0f + kPatternContrast) census.light += n;
    if (appearance >= census.shadow_limit && gain < 1.0f) {
      census.shadowed += n;
      census.shadowed_gain += static_cast<float>(n) * gain;
    } else if (gain < 1.0f) {
      census.dark += n;
      census.dark_gain += static_cast<float>(n) * gain;
    } else {
      census.bright += n;
    }
  }
  census.shadowed_gain /= static_cast<float>(std::max(1, census.shadowed));
  census.dark_gain /= static_cast<float>(std::max(1, census.dark));
  return census;
}

/// Entirely of the floor's hue and nearly of its brightness.
bool ShadowFilter::isFloorLike(const Blob& blob, const Census& c) {
  return static_cast<float>(c.faint) >= kFaintShare * static_cast<float>(blob.area_px);
}

/// May be pieces of tiles with joints between them: of the floor's hue, and much of it of nearly its
/// brightness.
bool ShadowFilter::isTile(const Blob& blob, const Census& c) {
  const auto share = static_cast<float>(c.patterned) / static_cast<float>(blob.area_px);
  const auto light = static_cast<float>(c.light) / static_cast<float>(blob.area_px);
  return share >= kTileShare && light < kLightTile && !isCore(c.coloured + c.dark, blob);
}

/// Mostly of the floor's hue and in less light, and nothing of it is plainly an object.
bool ShadowFilter::isSide(const Blob& blob, const Census& c) {
  return 2 * c.shadowed > blob.area_px && !isCore(c.coloured + c.dark, blob);
}

/// More shadow than an object of the remaining size casts. The rest may be a small piece of another object
/// beside it.
bool ShadowFilter::isMostlyShadow(const Blob& blob, const Census& c) {
  const auto share = static_cast<float>(c.coloured + c.dark) / static_cast<float>(blob.area_px);
  return 2 * c.shadowed > blob.area_px && share < kLeastCaster;
}

/// Of the floor's hue, and partly in more light.
bool ShadowFilter::isLight(const Blob& blob, const Census& c) {
  return static_cast<float>(c.bright) >= kLightShare * static_cast<float>(blob.area_px) &&
         !isCore(c.coloured + c.dark, blob);
}

/// Finds the distance of the core's nearest pixel by bearing, in nearest_px_. Bearings right beside the core
/// take its value.
/// @return false where the region is too close for that
bool ShadowFilter::findNearest(const Blob& blob, Appearance shadow_limit, const Frame& frame,
                               const cv::Mat1b& appearances) {
  constexpr float kNear =
      0.6f;  // multiple of the size; at this distance or less part of the region is on the other side
  ahead_ = 0.5f * cv::Point2f(blob.rect.tl() + blob.rect.br()) - frame.foot_px;
  const float size = std::hypot(static_cast<float>(blob.rect.width), static_cast<float>(blob.rect.height));
  if (std::sqrt(ahead_.dot(ahead_)) <= kNear * size) return false;
  const auto half = static_cast<std::size_t>(std::ceil(2.0f * size));
  nearest_px_.assign(2 * half + 1, kNone_px);
  forBearings(blob, frame, appearances,
              [&](Appearance appearance, std::size_t k, float radius2, const cv::Point&) {
                if (appearance == kColourAppearance || (isGrey(appearance) && appearance < shadow_limit))
                  nearest_px_[k] = std::min(nearest_px_[k], radius2);
              });
  const auto isCore = [](float px) { return px != kNone_px; };
  core_begin_ = static_cast<std::size_t>(std::find_if(nearest_px_.begin(), nearest_px_.end(), isCore) -
                                         nearest_px_.begin());
  core_end_ = static_cast<std::size_t>(nearest_px_.rend() -
                                       std::find_if(nearest_px_.rbegin(), nearest_px_.rend(), isCore));
  spreadOver(nearest_px_);
  return core_begin_ < core_end_;
}

template <typename Visit>
void ShadowFilter::forBearings(const Blob& blob, const Frame& frame, const cv::Mat1b& appearances,
                               Visit visit) {
  const float distance = std::sqrt(ahead_.dot(ahead_));
  const auto half = static_cast<int>(nearest_px_.size() / 2);
  for (const Run& run : blob.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      const cv::Point2f to = cv::Point2f(static_cast<float>(x), static_cast<float>(run.row)) - frame.foot_px;
      const auto k = static_cast<int>(std::lround(distance * ahead_.cross(to) / ahead_.dot(to)));
      visit(appearances(run.row, x), static_cast<std::size_t>(std::clamp(k, -half, half) + half), to.dot(to),
            cv::Point(x, run.row));
    }
  }
}

/// Most of the shadow lies in front of the core, on the core's own bearings or at its foot.
bool ShadowFilter::liesInFront(const Blob& blob, const Census& c, const Frame& frame,
                               const cv::Mat1b& appearances) {
  if (!findNearest(blob, c.shadow_limit, frame, appearances)) return false;
  int before = 0;
  forBearings(
      blob, frame, appearances, [&](Appearance appearance, std::size_t k, float radius2, const cv::Point&) {
        before +=
            isOfShadow(appearance, c.shadow_limit) && nearest_px_[k] != kNone_px && radius2 < nearest_px_[k]
                ? 1
                : 0;
      });
  return static_cast<float>(before) >= kMostInFront * static_cast<float>(c.shadowed);
}

/// Place of a shadow pixel at that bearing and squared distance.
ShadowFilter::Place ShadowFilter::placeOf(std::size_t k, float radius2) const {
  if (k < core_begin_) return kToOneSide;
  if (k >= core_end_) return kToOtherSide;
  return radius2 < nearest_px_[k] ? kInFront : kWithin;
}

/// Does the shadow around the core fade gradually into the floor's brightness? No side of an object does.
bool ShadowFilter::findFading(const Blob& blob, const Census& c, const Frame& frame,
                              const cv::Mat1b& appearances) {
  fades_.fill(false);
  if (c.patterned < kMinFoot_px || !findNearest(blob, c.shadow_limit, frame, appearances)) return false;
  std::array<int, kPlaces> all{}, light{};
  forBearings(blob, frame, appearances,
              [&](Appearance appearance, std::size_t k, float radius2, const cv::Point&) {
                if (!isOfShadow(appearance, c.shadow_limit)) return;
                const Place place = placeOf(k, radius2);
                ++all[place];
                light[place] += isOfPattern(appearance) ? 1 : 0;
              });
  const auto fades = [&](Place place) {
    return static_cast<float>(light[place]) >= kFading * static_cast<float>(all[place]);
  };
  const int face = std::max(kMinFoot_px, static_cast<int>(kLeastFace * static_cast<float>(blob.area_px)));
  for (const Place place : {kInFront, kToOneSide, kToOtherSide})
    fades_[place] = all[place] < face || fades(place);
  if (!fades_[kInFront]) fades_.fill(false);
  fades_[kWithin] =
      fades_[kInFront] && !fades(kWithin);  // the object's top, with some shadow beside its edges
  return fades_[kInFront];
}

/// Keeps marks of shadow only where the shadow fades. The others become part of the core.
void ShadowFilter::keepFading(const Blob& blob, const Judged& judged, const Frame& frame,
                              const cv::Mat1b& appearances) {
  if (!findNearest(blob, judged.shadow_limit, frame, appearances)) return;
  forBearings(blob, frame, appearances,
              [&](Appearance appearance, std::size_t k, float radius2, const cv::Point& at) {
                const Place place = placeOf(k, radius2);
                const bool fades_here = judged.fades[place] && (place != kWithin || isOfPattern(appearance));
                if (bare_(at) == kShadow && !fades_here) bare_(at) = kHued;
              });
}

ShadowFilter::Verdict ShadowFilter::judge(const Blob& blob, const Census& c, const Frame& frame,
                                          const cv::Mat1b& appearances) {
  if (isFloorLike(blob, c)) return Verdict::kUndecided;
  const int core = c.coloured + c.dark + c.bright;
  const bool has_core = isCore(core, blob);
  const bool fringed = static_cast<float>(c.faint) > kFaintFringe * static_cast<float>(blob.area_px);
  const bool side = isSide(blob, c);
  if (!has_core || 2 * c.bright > blob.area_px) {
    const bool all_light = 4 * (c.coloured + c.dark) < blob.area_px;
    if (side) {
      const float sharp = deep_.sharpShare(blob, frame, appearances);
      if (sharp < kSharpSide)
        return sharp < kVagueShare || blob.area_px < kMinVague_px ? Verdict::kDrop : Verdict::kVague;
      return fringed ? Verdict::kKeepFirm : Verdict::kKeep;
    }
    if (!all_light) return Verdict::kKeep;
    const auto [sharp, light, sharp_of_light] = sharpnessOfOutline(blob, frame, appearances);
    const bool is_top = light >= kLeastTop && sharp_of_light >= kSharpTop;
    if (sharp > kSharpLight || is_top) return Verdict::kKeep;
    return sharp < kVagueLight || blob.area_px < kMinVague_px ? Verdict::kDrop : Verdict::kVague;
  }
  if ((side || isMostlyShadow(blob, c)) && deep_.sharpShare(blob, frame, appearances) >= kSharpSide)
    return Verdict::kKeepFirm;
  if (c.shadowed > 0 && (c.coloured > c.dark || c.shadowed_gain > kFaces * c.dark_gain))
    return Verdict::kKeepCore;
  if (c.shadow_limit > greyAppearance(kDeepestShadow) && c.shadowed < c.dark &&
      liesInFront(blob, c, frame, appearances))
    return Verdict::kKeepCore;
  if (isCore(c.dark, blob) && 2 * c.coloured < blob.area_px && findFading(blob, c, frame, appearances))
    return Verdict::kKeepUnfading;
  return fringed ? Verdict::kKeepFirm : Verdict::kKeep;
}

void ShadowFilter::apply(const Found& found, const Frame& frame, Despeckler& despeckler, BitMask& objects) {
  const std::vector<Blob>& blobs = found.regions;
  const cv::Mat1b& appearances = found.appearances;
  judgeAll(blobs, frame, appearances);
  findCoreStrips(found.strips, blobs);
  core_area_.cover(core_strips_);
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const Judged& judged = judged_[i];
    if (judged.verdict == Verdict::kKeepFirm) {
      splitShadow(blobs[i], judged.firm_limit, greyAppearance(1.0f + kFaintContrast), found.raw, appearances,
                  bare_);
      restorePattern(blobs[i], frame);
      keepCore(blobs[i], bare_);
    } else if (keepsCore(judged.verdict)) {
      splitShadow(blobs[i], judged.shadow_limit, greyAppearance(1.0f + kFaintContrast), found.raw,
                  appearances, bare_);
      restoreHued(blobs[i], frame, appearances);
      if (judged.verdict == Verdict::kKeepCore) restorePattern(blobs[i], frame);
      if (judged.verdict == Verdict::kKeepUnfading) keepFading(blobs[i], judged, frame, appearances);
      keepCore(blobs[i], bare_);
    }
  }
  pack(core_strips_, bare_, bare_bits_);
  despeckler.clean(core_area_, bare_bits_, core_);
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    applyVerdict(blobs[i], judged_[i].verdict, objects);
    if (!judged_[i].has_pieces || !keepsCore(judged_[i].verdict)) continue;
    pieces_.find(blobs[i], core_, core_area_, frame, appearances);
    for (const Blob* board : pieces_.boards()) boards_.push_back(*board);
    for (const Blob* face : pieces_.faces()) faces_.push_back(*face);
  }
}

/// Hue of the region's coloured pixels: their difference from the floor after scaling to its brightness, as a
/// share of that brightness. 0 without any.
cv::Vec3f ShadowFilter::hueOfCore(const Blob& blob, const Frame& frame, const cv::Mat1b& appearances) {
  constexpr int kEvery = 8;  // pixels
  cv::Vec3f colour, floor;
  for (const Run& run : blob.runs) {
    const Appearance* appearance = appearances.ptr(run.row);
    for (int x = run.begin + 3 * run.row % kEvery; x < run.end; x += kEvery) {
      if (appearance[x] != kColourAppearance) continue;
      colour += cv::Vec3f(frame.image.at<cv::Vec3b>(run.row, x));
      floor += floorAt(frame, x, run.row);
    }
  }
  const float rr = floor.dot(floor), gain = colour.dot(floor) / std::max(1.0f, rr);
  if (!(gain > 0.0f)) return {};
  return (colour / gain - floor) / std::sqrt(rr);
}

/// Restores pixels that are no shadow because their surroundings have another hue than the floor. The noise
/// hides the hue of the single pixel.
void ShadowFilter::restoreHued(const Blob& blob, const Frame& frame, const cv::Mat1b& appearances) {
  const cv::Vec3f core = hueOfCore(blob, frame, appearances);
  around_.begin();
  for (const Run& run : blob.runs) {
    const std::uint8_t* mark = bare_.ptr(run.row);
    const auto next = [&](int x) { return nextMark(mark, x, run.end, kShadow); };
    for (int begin = next(run.begin), end; begin < run.end; begin = next(end)) {
      for (end = begin + 1; end < run.end && mark[end] == kShadow;) ++end;
      restoreHued({run.row, begin, end}, core, frame);
    }
  }
}

/// @param shadow run of pixels with only that mark
void ShadowFilter::restoreHued(const Run& shadow, const cv::Vec3f& core_hue, const Frame& frame) {
  const auto nextCell = [](int x) {
    return (x / kCell + 1) * kCell;
  };  // the floor's colour is constant up to there
  int begin = shadow.begin;
  HueTest hasOtherHue(frame, core_hue, begin, shadow.row);
  while (!hasOtherHue.isNeeded()) {
    begin = nextCell(begin);
    if (begin >= shadow.end) return;
    hasOtherHue = HueTest(frame, core_hue, begin, shadow.row);
  }
  std::uint8_t* mark = bare_.ptr(shadow.row);
  int end = nextCell(begin);
  around_.slide({shadow.row, begin, shadow.end}, frame.image, bare_, [&](int x, HueWindow::Sum around) {
    if (x == end) {
      hasOtherHue = HueTest(frame, core_hue, x, shadow.row);
      end += kCell;
    }
    if (hasOtherHue.isNeeded() && hasOtherHue(around)) mark[x] = kHued;
  });
}

/// Restores patches of an object's pattern, which are no shadow.
void ShadowFilter::restorePattern(const Blob& blob, const Frame& frame) {
  pattern_.fill(blob, frame, kCore, kShadow, bare_);
}

bool ShadowFilter::isPatterned(const Blob& blob, const Frame& frame) {
  pattern_.find(blob, frame);
  return pattern_.isAllOver();
}

/// Finds the strips around the regions of which only the core is kept, including the neighbourhood that
/// despeckling reads.
void ShadowFilter::findCoreStrips(const std::vector<Strip>& strips, const std::vector<Blob>& blobs) {
  core_rects_.clear();
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const cv::Rect& r = blobs[i].rect;
    if (keepsPart(judged_[i].verdict))
      core_rects_.emplace_back(r.x - kCell, r.y - kCell, r.width + 2 * kCell, r.height + 2 * kCell);
  }
  core_strips_.clear();
  for (const Strip& strip : strips) {
    const cv::Rect here(strip.begin_px, strip.cell_row * kCell, strip.end_px - strip.begin_px, kCell);
    const auto meets = [&](const cv::Rect& rect) { return !(rect & here).empty(); };
    if (std::any_of(core_rects_.begin(), core_rects_.end(), meets)) core_strips_.push_back(strip);
  }
}

void ShadowFilter::judgeAll(const std::vector<Blob>& blobs, const Frame& frame,
                            const cv::Mat1b& appearances) {
  judged_.clear();
  int faint = 0, patterned = 0, tiles = 0;
  for (const Blob& blob : blobs) {
    const Census census = count(blob, appearances);
    const auto least = static_cast<int>(kFaintShare * static_cast<float>(blob.area_px));
    const bool as_pattern = census.patterned > least, as_tile = isTile(blob, census);
    judged_.push_back({judge(blob, census, frame, appearances), as_pattern, isSide(blob, census), as_tile,
                       isLight(blob, census), isCore(census.coloured + census.dark, blob),
                       pieces_.mayBeIn(blob, census.shadowed), census.shadow_limit, kFloorAppearance,
                       fades_});
    Judged& judged = judged_.back();
    if (judged.verdict == Verdict::kKeepFirm)
      judged.firm_limit = judged.is_side || isMostlyShadow(blob, census)
                              ? deep_.foot(blob, frame, appearances)
                              : greyAppearance(1.0f - kFaintContrast);
    faint += isFloorLike(blob, census) ? 1 : 0;
    patterned += as_pattern && !isCore(census.coloured + census.dark, blob) ? 1 : 0;
    tiles += as_tile && !as_pattern ? 1 : 0;
  }
  const bool has_pattern = faint >= kPatternRegions || patterned >= kStrongPatternRegions;
  for (Judged& judged : judged_) {
    const bool of_floor = (has_pattern && judged.as_pattern) || (tiles >= kPatternRegions && judged.as_tile);
    const bool is_shadow = judged.verdict == Verdict::kDrop || judged.verdict == Verdict::kVague;
    if (of_floor && !is_shadow) judged.verdict = Verdict::kUndecided;
  }
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const bool stays = judged_[i].verdict == Verdict::kKeep || judged_[i].verdict == Verdict::kKeepFirm;
    const bool of_tiles = tiles >= kPatternRegions && judged_[i].as_tile;
    if (judged_[i].has_core && (stays || keepsCore(judged_[i].verdict))) objects_.push_back(&blobs[i]);
    const bool may_be_top = stays || (judged_[i].verdict == Verdict::kUndecided && !of_tiles);
    if (stays && judged_[i].is_side)
      sides_.push_back(&blobs[i]);
    else if (judged_[i].is_light && may_be_top && !(stays && isPatterned(blobs[i], frame)))
      lights_.push_back(&blobs[i]);
  }
}

void ShadowFilter::applyVerdict(const Blob& blob, Verdict verdict, BitMask& objects) {
  if (verdict == Verdict::kKeep) return;
  if (verdict == Verdict::kUndecided) undecided_.push_back(blob);
  if (verdict == Verdict::kVague) vague_.push_back(blob);
  for (const Run& run : blob.runs) {
    if (keepsPart(verdict)) {
      objects.keep(run.row, run.begin, run.end, core_);
    } else {
      objects.clear(run.row, run.begin, run.end);
    }
  }
}

}  // namespace omnifleet::ground
