#include "ground/shade_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "geometry/wide.h"
#include "ground/hue_test.h"
#include "ground/parting.h"
#include "ground/sharp_outline.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kMinCore_px = 16;           // fewer pixels that are no shade make no thing
constexpr float kMinCoreShare = 0.08f;    // of the region, likewise
constexpr float kFaintShare = 0.75f;      // of a region, from which it may be the floor's own pattern
constexpr int kPatternRegions = 3;        // that many faint ones at once are a pattern
constexpr int kStrongPatternRegions = 4;  // that many of a pattern's contrast, faint ones among them, too
constexpr float kTileShare =
    0.4f;  // of a region is little off the floor, from which it may be tiles and joints
constexpr float kLightTile = 0.1f;  // of a region is lighter than a floor's pattern, from which it is no tile
constexpr float kLightShare = 0.15f;   // of a region is lighter than the floor, from which it may be a top
constexpr float kFaintFringe = 0.06f;  // of a region, from which faint pixels are more than its mixed edge
constexpr float kFaces = 2.0f;       // faces of one grey thing differ less in brightness than by this factor
constexpr float kVagueShare = 0.1f;  // of a side's outline, below which it is surely a shadow's
constexpr float kSharpLight = 0.5f;  // of a lighter region's outline, beyond which it is a thing's
constexpr float kLeastTop = 0.15f;   // of it runs along what is plainly lighter, a top's,
constexpr float kSharpTop = 0.8f;  // and that much of this is sharp: a thing's, whose side is like the floor
constexpr float kVagueLight = 0.25f;  // below which it is surely a patch of light's
constexpr int kMinVague_px = 100;     // smaller regions have too little outline for that
constexpr float kSharpSide = 0.4f;    // of that outline, from which it is no shadow's

constexpr float kLeastCaster = 0.25f;  // of a region with a thing and its shadow, what is the thing
constexpr float kMostBefore = 0.5f;    // of a region's shade, from which it is the shadow at the core's foot
constexpr int kBeside_px = 6;          // bearings to the side of the core that its foot's shadow reaches
constexpr float kNone_px = 1e9f;
constexpr int kMinFoot_px = 48;      // pixels of a shadow at a foot: fewer are what is mixed along an outline
constexpr float kFading = 0.25f;     // of that shadow is hardly darker than the floor
constexpr float kLeastFace = 0.02f;  // of a region, else it is no face of the thing

// What a pixel of a region is: bit 0 where it is of the core.
constexpr std::uint8_t kCore = 1, kShade = HueWindow::kCounts, kHued = kShade | kCore;

constexpr int kChunk_px = 32;

/// Where the mask is set within a region: kShade for shade (of its own limit) and a faint pattern, else
/// kCore.
OMNIFLEET_WIDE void partShade(const Blob& blob, Look first, Look last, const cv::Mat1b& mask,
                              const cv::Mat1b& looks, cv::Mat1b& marks) {
  for (const Run& run : blob.runs) {
    const std::uint8_t *set = mask.ptr(run.row), *look = looks.ptr(run.row);
    std::uint8_t* to = marks.ptr(run.row);
    inChunks<kChunk_px>(
        run.begin, run.end, [=](int x) __attribute__((always_inline)) {
          const std::uint8_t mark = (look[x] >= first) & (look[x] <= last) ? kShade : kCore;
          to[x] = set[x] != 0 ? mark : 0;
        });
  }
}

/// Leaves 1 for the core, 0 for the rest.
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

/// So many pixels of a region that are no shade make a thing.
bool isCore(int pixels, const Blob& blob) {
  return pixels >= kMinCore_px &&
         static_cast<float>(pixels) >= kMinCoreShare * static_cast<float>(blob.area_px);
}

/// Bearings beside others get what these have.
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

bool isOfShade(Look look, Look shade_limit) {
  return look >= shade_limit && gainOf(look) < 1.0f;
}

}  // namespace

void ShadeFilter::clear() {
  clearStrips(core_strips_, bare_);
  ground::clear(core_area_, bare_bits_);
  ground::clear(core_area_, core_);
  undecided_.clear();
  vague_.clear();
  boards_.clear();
  faces_.clear();
  sides_.clear();
  lights_.clear();
  things_.clear();
}

void ShadeFilter::doubt(const Blob& region) {
  const auto isIt = [&](const Blob& blob) { return blob.label == region.label && blob.rect == region.rect; };
  if (std::none_of(undecided_.begin(), undecided_.end(), isIt)) undecided_.push_back(region);
}

void ShadeFilter::decide(const BitMask& found) {
  const auto isFound = [&](const Blob& blob) {
    int in = 0;
    for (const Run& run : blob.runs)
      for (int x = run.begin; x < run.end; ++x) in += found.at(x, run.row) ? 1 : 0;
    return 2 * in > blob.area_px;
  };
  for (std::vector<Blob>* blobs : {&undecided_, &vague_})
    blobs->erase(std::remove_if(blobs->begin(), blobs->end(), isFound), blobs->end());
}

ShadeFilter::Census ShadeFilter::count(const Blob& blob, const cv::Mat1b& looks) {
  // Of each look; in four parts, as equal looks, which lie side by side, wait for each other.
  constexpr int kParts = 4;
  std::array<std::array<int, 256>, kParts> parts{};
  for (const Run& run : blob.runs) {
    const Look* row = looks.ptr(run.row);
    int x = run.begin;
    for (; x + kParts <= run.end; x += kParts)
      for (int k = 0; k < kParts; ++k) ++parts[k][row[x + k]];
    for (; x < run.end; ++x) ++parts[0][row[x]];
  }
  std::array<int, 256>& pixels = parts[0];
  for (int k = 1; k < kParts; ++k)
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] += parts[k][i];
  Census census;
  census.coloured = pixels[kColourLook];
  census.shade_limit = greyLook(kDeepestShade);
  // What no shadow is as dark as must be there, or two kinds of floor would make a thing.
  const int darkest =
      std::accumulate(pixels.begin() + kColourLook + 1, pixels.begin() + census.shade_limit, 0);
  const Look parting =
      isCore(darkest, blob) && 2 * census.coloured < blob.area_px ? partingOf(pixels) : kFloorLook;
  if (parting != kFloorLook) census.shade_limit = parting;
  for (int i = 0; i < 256; ++i) {
    const auto look = static_cast<Look>(i);
    const int n = pixels[look];
    if (n == 0 || !isGrey(look)) continue;
    const float gain = gainOf(look);
    if (isFaint(look)) census.faint += n;
    if (isOfPattern(look)) census.patterned += n;
    if (gain >= 1.0f + kPatternContrast) census.light += n;
    if (look >= census.shade_limit && gain < 1.0f) {
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

/// All over of the floor's hue and nearly of its brightness.
bool ShadeFilter::isFloorLike(const Blob& blob, const Census& c) {
  return static_cast<float>(c.faint) >= kFaintShare * static_cast<float>(blob.area_px);
}

/// May be pieces of tiles with joints between them: of the floor's hue, and much of it of nearly its
/// brightness.
bool ShadeFilter::isTile(const Blob& blob, const Census& c) {
  const auto share = static_cast<float>(c.patterned) / static_cast<float>(blob.area_px);
  const auto light = static_cast<float>(c.light) / static_cast<float>(blob.area_px);
  return share >= kTileShare && light < kLightTile && !isCore(c.coloured + c.dark, blob);
}

/// Mostly of the floor's hue and in less light, and nothing of it is plainly a thing.
bool ShadeFilter::isSide(const Blob& blob, const Census& c) {
  return 2 * c.shaded > blob.area_px && !isCore(c.coloured + c.dark, blob);
}

/// More shade than a thing of the rest throws: that may be a small piece of another thing beside it.
bool ShadeFilter::isMostlyShade(const Blob& blob, const Census& c) {
  const auto share = static_cast<float>(c.coloured + c.dark) / static_cast<float>(blob.area_px);
  return 2 * c.shaded > blob.area_px && share < kLeastCaster;
}

/// Of the floor's hue, and some of it in more light.
bool ShadeFilter::isLight(const Blob& blob, const Census& c) {
  return static_cast<float>(c.bright) >= kLightShare * static_cast<float>(blob.area_px) &&
         !isCore(c.coloured + c.dark, blob);
}

/// The core's nearest pixel by bearings, in nearest_px_; those right beside the core have its own.
/// @return false where the region is too near for that
bool ShadeFilter::findNearest(const Blob& blob, Look shade_limit, const Frame& frame,
                              const cv::Mat1b& looks) {
  constexpr float kNear = 0.6f;  // at half the size and less, part of it lies to the other side
  ahead_ = 0.5f * cv::Point2f(blob.rect.tl() + blob.rect.br()) - frame.foot_px;
  const float size = std::hypot(static_cast<float>(blob.rect.width), static_cast<float>(blob.rect.height));
  if (std::sqrt(ahead_.dot(ahead_)) <= kNear * size) return false;
  const auto half = static_cast<std::size_t>(std::ceil(2.0f * size));
  nearest_px_.assign(2 * half + 1, kNone_px);
  forBearings(blob, frame, looks, [&](Look look, std::size_t k, float radius2, const cv::Point&) {
    if (look == kColourLook || (isGrey(look) && look < shade_limit))
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
void ShadeFilter::forBearings(const Blob& blob, const Frame& frame, const cv::Mat1b& looks, Visit visit) {
  const float distance = std::sqrt(ahead_.dot(ahead_));
  const auto half = static_cast<int>(nearest_px_.size() / 2);
  for (const Run& run : blob.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      const cv::Point2f to = cv::Point2f(static_cast<float>(x), static_cast<float>(run.row)) - frame.foot_px;
      const auto k = static_cast<int>(std::lround(distance * ahead_.cross(to) / ahead_.dot(to)));
      visit(looks(run.row, x), static_cast<std::size_t>(std::clamp(k, -half, half) + half), to.dot(to),
            cv::Point(x, run.row));
    }
  }
}

/// Most of the shade lies before the core on the core's own bearings or at its foot.
bool ShadeFilter::liesBefore(const Blob& blob, const Census& c, const Frame& frame, const cv::Mat1b& looks) {
  if (!findNearest(blob, c.shade_limit, frame, looks)) return false;
  int before = 0;
  forBearings(blob, frame, looks, [&](Look look, std::size_t k, float radius2, const cv::Point&) {
    before +=
        isOfShade(look, c.shade_limit) && nearest_px_[k] != kNone_px && radius2 < nearest_px_[k] ? 1 : 0;
  });
  return static_cast<float>(before) >= kMostBefore * static_cast<float>(c.shaded);
}

/// Where shade lies that has that bearing and distance.
ShadeFilter::Place ShadeFilter::placeOf(std::size_t k, float radius2) const {
  if (k < core_begin_) return kToOneSide;
  if (k >= core_end_) return kToTheOther;
  return radius2 < nearest_px_[k] ? kBefore : kWithin;
}

/// Around the core its own shadow gets to the floor's brightness by degrees, as no side of a thing does.
bool ShadeFilter::findFading(const Blob& blob, const Census& c, const Frame& frame, const cv::Mat1b& looks) {
  fades_.fill(false);
  if (c.patterned < kMinFoot_px || !findNearest(blob, c.shade_limit, frame, looks)) return false;
  std::array<int, kPlaces> all{}, light{};
  forBearings(blob, frame, looks, [&](Look look, std::size_t k, float radius2, const cv::Point&) {
    if (!isOfShade(look, c.shade_limit)) return;
    const Place place = placeOf(k, radius2);
    ++all[place];
    light[place] += isOfPattern(look) ? 1 : 0;
  });
  const auto fades = [&](Place place) {
    return static_cast<float>(light[place]) >= kFading * static_cast<float>(all[place]);
  };
  const int face = std::max(kMinFoot_px, static_cast<int>(kLeastFace * static_cast<float>(blob.area_px)));
  for (const Place place : {kBefore, kToOneSide, kToTheOther})
    fades_[place] = all[place] < face || fades(place);
  if (!fades_[kBefore]) fades_.fill(false);
  fades_[kWithin] = fades_[kBefore] && !fades(kWithin);  // its top, and beside its edges some shadow
  return fades_[kBefore];
}

/// Of the marks of shade those stay that lie where it fades.
void ShadeFilter::keepFading(const Blob& blob, const Judged& judged, const Frame& frame,
                             const cv::Mat1b& looks) {
  if (!findNearest(blob, judged.shade_limit, frame, looks)) return;
  forBearings(blob, frame, looks, [&](Look look, std::size_t k, float radius2, const cv::Point& at) {
    const Place place = placeOf(k, radius2);
    const bool goes = judged.fades[place] && (place != kWithin || isOfPattern(look));
    if (bare_(at) == kShade && !goes) bare_(at) = kHued;
  });
}

ShadeFilter::Verdict ShadeFilter::judge(const Blob& blob, const Census& c, const Frame& frame,
                                        const cv::Mat1b& looks) {
  if (isFloorLike(blob, c)) return Verdict::kUndecided;
  const int core = c.coloured + c.dark + c.bright;
  const bool has_core = isCore(core, blob);
  const bool fringed = static_cast<float>(c.faint) > kFaintFringe * static_cast<float>(blob.area_px);
  const bool side = isSide(blob, c);
  if (!has_core || 2 * c.bright > blob.area_px) {
    const bool all_light = 4 * (c.coloured + c.dark) < blob.area_px;
    if (side) {
      const float sharp = deep_.sharpShare(blob, frame, looks);
      if (sharp < kSharpSide)
        return sharp < kVagueShare || blob.area_px < kMinVague_px ? Verdict::kDrop : Verdict::kVague;
      return fringed ? Verdict::kKeepFirm : Verdict::kKeep;
    }
    if (!all_light) return Verdict::kKeep;
    const auto [sharp, light, sharp_of_light] = sharpnessOfOutline(blob, frame, looks);
    const bool is_top = light >= kLeastTop && sharp_of_light >= kSharpTop;
    if (sharp > kSharpLight || is_top) return Verdict::kKeep;
    return sharp < kVagueLight || blob.area_px < kMinVague_px ? Verdict::kDrop : Verdict::kVague;
  }
  if ((side || isMostlyShade(blob, c)) && deep_.sharpShare(blob, frame, looks) >= kSharpSide)
    return Verdict::kKeepFirm;
  if (c.shaded > 0 && (c.coloured > c.dark || c.shaded_gain > kFaces * c.dark_gain))
    return Verdict::kKeepCore;
  if (c.shade_limit > greyLook(kDeepestShade) && c.shaded < c.dark && liesBefore(blob, c, frame, looks))
    return Verdict::kKeepCore;
  if (isCore(c.dark, blob) && 2 * c.coloured < blob.area_px && findFading(blob, c, frame, looks))
    return Verdict::kKeepUnfading;
  return fringed ? Verdict::kKeepFirm : Verdict::kKeep;
}

void ShadeFilter::apply(const Found& found, const Frame& frame, Despeckler& despeckler, BitMask& objects) {
  const std::vector<Blob>& blobs = found.regions;
  const cv::Mat1b& looks = found.looks;
  judgeAll(blobs, frame, looks);
  findCoreStrips(found.strips, blobs);
  core_area_.cover(core_strips_);
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const Judged& judged = judged_[i];
    if (judged.verdict == Verdict::kKeepFirm) {
      partShade(blobs[i], judged.firm_limit, greyLook(1.0f + kFaintContrast), found.raw, looks, bare_);
      givePatternBack(blobs[i], frame);
      keepCore(blobs[i], bare_);
    } else if (keepsCore(judged.verdict)) {
      partShade(blobs[i], judged.shade_limit, greyLook(1.0f + kFaintContrast), found.raw, looks, bare_);
      giveHuedBack(blobs[i], frame, looks);
      if (judged.verdict == Verdict::kKeepCore) givePatternBack(blobs[i], frame);
      if (judged.verdict == Verdict::kKeepUnfading) keepFading(blobs[i], judged, frame, looks);
      keepCore(blobs[i], bare_);
    }
  }
  pack(core_strips_, bare_, bare_bits_);
  despeckler.clean(core_area_, bare_bits_, core_);
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    carryOut(blobs[i], judged_[i].verdict, objects);
    if (!judged_[i].has_pieces || !keepsCore(judged_[i].verdict)) continue;
    pieces_.find(blobs[i], core_, core_area_, frame, looks);
    for (const Blob* board : pieces_.boards()) boards_.push_back(*board);
    for (const Blob* face : pieces_.faces()) faces_.push_back(*face);
  }
}

/// What the coloured pixels of a region, made as bright as the floor, differ from it by, as a share of that
/// brightness; 0 without any.
cv::Vec3f ShadeFilter::hueOfCore(const Blob& blob, const Frame& frame, const cv::Mat1b& looks) {
  constexpr int kEvery = 8;  // pixels
  cv::Vec3f colour, floor;
  for (const Run& run : blob.runs) {
    const Look* look = looks.ptr(run.row);
    for (int x = run.begin + 3 * run.row % kEvery; x < run.end; x += kEvery) {
      if (look[x] != kColourLook) continue;
      colour += cv::Vec3f(frame.image.at<cv::Vec3b>(run.row, x));
      floor += floorAt(frame, x, run.row);
    }
  }
  const float rr = floor.dot(floor), gain = colour.dot(floor) / std::max(1.0f, rr);
  if (!(gain > 0.0f)) return {};
  return (colour / gain - floor) / std::sqrt(rr);
}

/// Where the noise hides the hue of single pixels, those whose surroundings have another hue than the floor
/// are no shade.
void ShadeFilter::giveHuedBack(const Blob& blob, const Frame& frame, const cv::Mat1b& looks) {
  const cv::Vec3f core = hueOfCore(blob, frame, looks);
  around_.begin();
  for (const Run& run : blob.runs) {
    const std::uint8_t* mark = bare_.ptr(run.row);
    const auto next = [&](int x) { return nextMark(mark, x, run.end, kShade); };
    for (int begin = next(run.begin), end; begin < run.end; begin = next(end)) {
      for (end = begin + 1; end < run.end && mark[end] == kShade;) ++end;
      giveHuedBack({run.row, begin, end}, core, frame);
    }
  }
}

/// @param shade nothing else
void ShadeFilter::giveHuedBack(const Run& shade, const cv::Vec3f& core_hue, const Frame& frame) {
  const auto nextCell = [](int x) { return (x / kCell + 1) * kCell; };  // the floor's colour is one there
  int begin = shade.begin;
  HueTest hasOtherHue(frame, core_hue, begin, shade.row);
  while (!hasOtherHue.isNeeded()) {
    begin = nextCell(begin);
    if (begin >= shade.end) return;
    hasOtherHue = HueTest(frame, core_hue, begin, shade.row);
  }
  std::uint8_t* mark = bare_.ptr(shade.row);
  int end = nextCell(begin);
  around_.slide({shade.row, begin, shade.end}, frame.image, bare_, [&](int x, HueWindow::Sum around) {
    if (x == end) {
      hasOtherHue = HueTest(frame, core_hue, x, shade.row);
      end += kCell;
    }
    if (hasOtherHue.isNeeded() && hasOtherHue(around)) mark[x] = kHued;
  });
}

/// Patches of a thing's pattern are no shade.
void ShadeFilter::givePatternBack(const Blob& blob, const Frame& frame) {
  pattern_.fill(blob, frame, kCore, kShade, bare_);
}

bool ShadeFilter::isPatterned(const Blob& blob, const Frame& frame) {
  pattern_.find(blob, frame);
  return pattern_.isAllOver();
}

/// The strips around the regions of which only the core stays, with what despeckling looks at beside them.
void ShadeFilter::findCoreStrips(const std::vector<Strip>& strips, const std::vector<Blob>& blobs) {
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

void ShadeFilter::judgeAll(const std::vector<Blob>& blobs, const Frame& frame, const cv::Mat1b& looks) {
  judged_.clear();
  int faint = 0, patterned = 0, tiles = 0;
  for (const Blob& blob : blobs) {
    const Census census = count(blob, looks);
    const auto least = static_cast<int>(kFaintShare * static_cast<float>(blob.area_px));
    const bool as_pattern = census.patterned > least, as_tile = isTile(blob, census);
    judged_.push_back({judge(blob, census, frame, looks), as_pattern, isSide(blob, census), as_tile,
                       isLight(blob, census), isCore(census.coloured + census.dark, blob),
                       pieces_.mayBeIn(blob, census.shaded), census.shade_limit, kFloorLook, fades_});
    Judged& judged = judged_.back();
    if (judged.verdict == Verdict::kKeepFirm)
      judged.firm_limit = judged.is_side || isMostlyShade(blob, census) ? deep_.foot(blob, frame, looks)
                                                                        : greyLook(1.0f - kFaintContrast);
    faint += isFloorLike(blob, census) ? 1 : 0;
    patterned += as_pattern && !isCore(census.coloured + census.dark, blob) ? 1 : 0;
    tiles += as_tile && !as_pattern ? 1 : 0;
  }
  const bool has_pattern = faint >= kPatternRegions || patterned >= kStrongPatternRegions;
  for (Judged& judged : judged_) {
    const bool of_floor = (has_pattern && judged.as_pattern) || (tiles >= kPatternRegions && judged.as_tile);
    const bool is_shade = judged.verdict == Verdict::kDrop || judged.verdict == Verdict::kVague;
    if (of_floor && !is_shade) judged.verdict = Verdict::kUndecided;
  }
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const bool stays = judged_[i].verdict == Verdict::kKeep || judged_[i].verdict == Verdict::kKeepFirm;
    const bool of_tiles = tiles >= kPatternRegions && judged_[i].as_tile;
    if (judged_[i].has_core && (stays || keepsCore(judged_[i].verdict))) things_.push_back(&blobs[i]);
    const bool may_be_top = stays || (judged_[i].verdict == Verdict::kUndecided && !of_tiles);
    if (stays && judged_[i].is_side)
      sides_.push_back(&blobs[i]);
    else if (judged_[i].is_light && may_be_top && !(stays && isPatterned(blobs[i], frame)))
      lights_.push_back(&blobs[i]);
  }
}

void ShadeFilter::carryOut(const Blob& blob, Verdict verdict, BitMask& objects) {
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
