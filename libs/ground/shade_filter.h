#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/deep_shade.h"
#include "ground/despeckler.h"
#include "ground/floor_frame.h"
#include "ground/hue_window.h"
#include "ground/labelling.h"
#include "ground/look.h"
#include "ground/pattern.h"
#include "ground/shade_pieces.h"
#include "ground/strip.h"

namespace omnifleet::ground {

/// Takes shadows and patches of light out of a mask of what is not floor. One pixel of the floor's hue,
/// darker than the floor, may be shadow or a grey thing; the region decides:
///  - where it is mostly of other hues, or much darker still, the pixels that are merely shaded floor are the
///    thing's shadow (at its foot or thrown) and go;
///  - so does what lies before the darker part of a region of two kinds of the floor's hue, seen from the
///    camera's foot: a top lies behind its sides;
///  - of a grey thing whose top is as light as shade may be, what lies before its dark side goes where it
///  fades into the floor's brightness;
///  - where all of it has the floor's hue, it stays when its outline is sharp, as a grey thing's is, and goes
///    when its brightness fades into the floor's;
///  - where all of it has the floor's hue, but some of it is lighter than the floor, it is a thing of nearly
///    the floor's colour with its side in the shade, if the shade ends in a step; else a light thing's
///    shadow;
///  - where nearly all of it differs from the floor by less than floors differ from tile to tile, it goes,
///    but is kept as undecided(): a thing of just that colour would look the same;
///  - where several such regions, or some more of a little more contrast, show that the floor has a pattern,
///  what differs little more is of it too;
///  - so are regions that mix what is so near to the floor with shade, where there are several: tiles and
///    their joints.
class ShadeFilter {
 public:
  explicit ShadeFilter(cv::Size image)
      : bare_(image, std::uint8_t{0}),
        core_area_(image),
        bare_bits_(image),
        core_(image),
        around_(image.width),
        deep_(image),
        pieces_(image),
        pattern_(image) {}

  using Frame = FloorFrame;

  static constexpr int kMinRegion_px = 12;  ///< smaller ones are noise, whatever they are
  /// What is not plainly floor.
  struct Found {
    const std::vector<Strip>& strips;
    const std::vector<Blob>& regions;  ///< of at least kMinRegion_px; must last as long as sides() is asked
    const cv::Mat1b& looks;            ///< of the pixels, 0 outside the strips
    const cv::Mat1b& raw;              ///< 0/1, not yet despeckled
  };

  /// @param objects the mask of the regions; changed
  void apply(const Found& found, const Frame& frame, Despeckler& despeckler, BitMask& objects);

  void clear();

  /// Regions of the last apply() that may be floor or a thing of its colour.
  const std::vector<Blob>& undecided() const { return undecided_; }
  /// Regions of the last apply() that went as shade though some of their outline is as sharp as a thing's.
  const std::vector<Blob>& vague() const { return vague_; }
  /// Pieces of regions of the last apply() that went as a thing's shade, but may be a low wall behind it.
  const std::vector<Blob>& boards() const { return boards_; }
  /// Likewise, but may be the face of another thing: nobody sees floor through it. Too many to be told.
  const std::vector<Blob>& faces() const { return faces_; }
  /// Regions of the last apply() that stay and are mostly in less light than the floor, of nearly its hue:
  /// sides of things whose tops may be as bright as the floor.
  const std::vector<const Blob*>& sides() const { return sides_; }
  /// Regions of the last apply() that stay or are undecided, of the floor's hue, of which some is plainly
  /// lighter: tops of things whose sides may be as bright as the floor.
  const std::vector<const Blob*>& lights() const { return lights_; }
  /// Regions of the last apply() that stay, at least in part, and of which some is plainly no floor.
  const std::vector<const Blob*>& things() const { return things_; }
  /// A region of the last apply() that is undecided after all; must not be in objects().
  void doubt(const Blob& region);
  /// What lies mostly in `found` is decided.
  void decide(const BitMask& found);

 private:
  /// Pixels of a region by their looks.
  struct Census {
    int coloured = 0, dark = 0, shaded = 0, bright = 0;
    int faint = 0;                               ///< of the shaded and bright ones
    int patterned = 0;                           ///< the faint ones and those hardly less so
    int light = 0;                               ///< lighter than those
    float dark_gain = 0.0f, shaded_gain = 0.0f;  ///< means
    Look shade_limit = kFloorLook;               ///< from which grey is taken for shade
  };
  enum class Verdict { kKeep, kKeepFirm, kKeepCore, kKeepUnfading, kDrop, kVague, kUndecided };
  static bool keepsCore(Verdict verdict) {
    return verdict == Verdict::kKeepCore || verdict == Verdict::kKeepUnfading;
  }
  static bool keepsPart(Verdict verdict) { return keepsCore(verdict) || verdict == Verdict::kKeepFirm; }
  /// Of shade, seen from the camera's foot: before the core; beside it; behind where it begins.
  enum Place : std::uint8_t { kBefore, kToOneSide, kToTheOther, kWithin, kPlaces };
  struct Judged {
    Verdict verdict;
    bool as_pattern;  ///< goes where the floor has a pattern
    bool is_side;     ///< isSide()
    bool as_tile;     ///< isTile()
    bool is_light;    ///< isLight()
    bool has_core;    ///< some of it is plainly no floor
    bool has_pieces;  ///< ShadePieces::mayBeIn()
    Look shade_limit;
    Look firm_limit;                  ///< kKeepFirm: from there to what is lighter than floors it goes
    std::array<bool, kPlaces> fades;  ///< kKeepUnfading: by places; kWithin: its lightest part
  };

  static Census count(const Blob& blob, const cv::Mat1b& looks);
  void findCoreStrips(const std::vector<Strip>& strips, const std::vector<Blob>& blobs);
  static cv::Vec3f hueOfCore(const Blob& blob, const Frame& frame, const cv::Mat1b& looks);
  void giveHuedBack(const Blob& blob, const Frame& frame, const cv::Mat1b& looks);
  void giveHuedBack(const Run& shade, const cv::Vec3f& core_hue, const Frame& frame);
  void givePatternBack(const Blob& blob, const Frame& frame);
  bool isPatterned(const Blob& blob, const Frame& frame);
  void judgeAll(const std::vector<Blob>& blobs, const Frame& frame, const cv::Mat1b& looks);
  void carryOut(const Blob& blob, Verdict verdict, BitMask& objects);
  Verdict judge(const Blob& blob, const Census& census, const Frame& frame, const cv::Mat1b& looks);
  static bool isFloorLike(const Blob& blob, const Census& census);
  static bool isTile(const Blob& blob, const Census& census);
  static bool isSide(const Blob& blob, const Census& census);
  static bool isMostlyShade(const Blob& blob, const Census& census);
  static bool isLight(const Blob& blob, const Census& census);
  bool findNearest(const Blob& blob, Look shade_limit, const Frame& frame, const cv::Mat1b& looks);
  template <typename Visit>
  void forBearings(const Blob& blob, const Frame& frame, const cv::Mat1b& looks, Visit visit);
  bool liesBefore(const Blob& blob, const Census& census, const Frame& frame, const cv::Mat1b& looks);
  Place placeOf(std::size_t bearing, float radius_px2) const;
  bool findFading(const Blob& blob, const Census& census, const Frame& frame, const cv::Mat1b& looks);
  void keepFading(const Blob& blob, const Judged& judged, const Frame& frame, const cv::Mat1b& looks);

  std::vector<cv::Rect> core_rects_;
  std::vector<Strip> core_strips_;
  cv::Mat1b bare_;            ///< raw without shade; 0 outside the core strips
  BitArea core_area_;         ///< of them: outside of it these are 0
  BitMask bare_bits_, core_;  ///< bare_; the same despeckled
  HueWindow around_;
  cv::Point2f ahead_;                          ///< from the camera's foot to the region
  std::vector<float> nearest_px_;              ///< of the region's core, by bearings; squared
  std::size_t core_begin_ = 0, core_end_ = 0;  ///< its bearings
  std::array<bool, kPlaces> fades_{};          ///< as findFading() found it
  DeepShade deep_;
  ShadePieces pieces_;
  Pattern pattern_;
  std::vector<Judged> judged_;
  std::vector<Blob> undecided_, vague_, boards_, faces_;
  std::vector<const Blob*> sides_, lights_, things_;
};

}  // namespace omnifleet::ground
