#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/appearance_class.h"
#include "ground/bit_mask.h"
#include "ground/deep_shadow.h"
#include "ground/despeckler.h"
#include "ground/floor_frame.h"
#include "ground/hue_window.h"
#include "ground/labelling.h"
#include "ground/pattern.h"
#include "ground/shadow_pieces.h"
#include "ground/strip.h"

namespace omnifleet::ground {

/// Removes shadows and patches of light from a mask of what is not floor. A single pixel of the floor's hue
/// that is darker than the floor may be shadow or a grey object. The region decides:
/// - Mostly of other hues, or much darker: pixels that are merely floor in less light are the object's shadow
/// (attached or cast) and are removed.
/// - Of two kinds of the floor's hue: what lies in front of the darker part, seen from the camera foot, is
/// removed, because a top lies behind its sides.
/// - A grey object whose top is as light as a shadow may be: what lies in front of its dark side is removed
/// where it fades into the floor's brightness.
/// - Entirely of the floor's hue: the region is kept when its outline is sharp, as a grey object's is. It is
/// removed when its brightness fades into the floor's.
/// - Entirely of the floor's hue, but partly lighter than the floor: an object of nearly the floor's colour
/// with its side in shadow, if the dark part ends in an edge; otherwise the shadow of a light object.
/// - Nearly all of it differs from the floor by less than floors differ from tile to tile: the region is
/// removed, but kept in undecided(), because an object of just that colour has the same appearance.
/// - Several such regions, or some more of slightly higher contrast, show that the floor has a pattern.
/// Regions that differ little more then belong to it, too.
/// - Several regions that mix such pixels with shadow are tiles and their joints, and belong to the pattern,
/// too.
class ShadowFilter {
 public:
  explicit ShadowFilter(cv::Size image)
      : bare_(image, std::uint8_t{0}),
        core_area_(image),
        bare_bits_(image),
        core_(image),
        around_(image.width),
        deep_(image),
        pieces_(image),
        pattern_(image) {}

  using Frame = FloorFrame;

  static constexpr int kMinRegion_px = 12;  ///< smaller ones are noise
  /// What is not plainly floor.
  struct Found {
    const std::vector<Strip>& strips;
    const std::vector<Blob>& regions;  ///< of at least kMinRegion_px; must outlive the use of sides()
    const cv::Mat1b& appearances;      ///< of the pixels, 0 outside the strips
    const cv::Mat1b& raw;              ///< 0/1, before despeckling
  };

  /// @param objects the mask of the regions; changed
  void apply(const Found& found, const Frame& frame, Despeckler& despeckler, BitMask& objects);

  void clear();

  /// Regions of the last apply() that may be floor or an object of its colour.
  const std::vector<Blob>& undecided() const { return undecided_; }
  /// Regions of the last apply() that were removed as shadow, although part of their outline is as sharp as
  /// an object's.
  const std::vector<Blob>& vague() const { return vague_; }
  /// Pieces of regions of the last apply() that were removed as an object's shadow, but may be a low wall
  /// behind it.
  const std::vector<Blob>& boards() const { return boards_; }
  /// Pieces of regions of the last apply() that were removed as an object's shadow, but may be the face of
  /// another object. No floor is visible through them. They are too many to be reported.
  const std::vector<Blob>& faces() const { return faces_; }
  /// Regions of the last apply() that are kept and mostly in less light than the floor, of nearly its hue:
  /// sides of objects whose tops may be as bright as the floor.
  const std::vector<const Blob*>& sides() const { return sides_; }
  /// Regions of the last apply() that are kept or undecided, of the floor's hue, and plainly lighter in part:
  /// tops of objects whose sides may be as bright as the floor.
  const std::vector<const Blob*>& lights() const { return lights_; }
  /// Regions of the last apply() that are kept, at least in part, and of which some is plainly not floor.
  const std::vector<const Blob*>& objects() const { return objects_; }
  /// Makes a region of the last apply() undecided. It must not be in objects().
  void markUndecided(const Blob& region);
  /// Removes from the undecided and vague regions those that lie mostly in `found`.
  void decide(const BitMask& found);

 private:
  /// Pixels of a region, counted by appearance.
  struct Census {
    int coloured = 0, dark = 0, shadowed = 0, bright = 0;
    int faint = 0;      ///< shadowed and bright pixels of nearly the floor's brightness
    int patterned = 0;  ///< of the floor's brightness within a pattern's contrast; includes the faint ones
    int light = 0;      ///< lighter than the patterned ones
    float dark_gain = 0.0f, shadowed_gain = 0.0f;  ///< means
    Appearance shadow_limit = kFloorAppearance;    ///< grey counts as shadow from this value on
  };
  enum class Verdict { kKeep, kKeepFirm, kKeepCore, kKeepUnfading, kDrop, kVague, kUndecided };
  static bool keepsCore(Verdict verdict) {
    return verdict == Verdict::kKeepCore || verdict == Verdict::kKeepUnfading;
  }
  static bool keepsPart(Verdict verdict) { return keepsCore(verdict) || verdict == Verdict::kKeepFirm; }
  /// Place of a shadow pixel relative to the core, seen from the camera foot: in front of it; beside it; on
  /// its bearings, from where it begins.
  enum Place : std::uint8_t { kInFront, kToOneSide, kToOtherSide, kWithin, kPlaces };
  struct Judged {
    Verdict verdict;
    bool as_pattern;  ///< removed where the floor has a pattern
    bool is_side;     ///< isSide()
    bool as_tile;     ///< isTile()
    bool is_light;    ///< isLight()
    bool has_core;    ///< some of it is plainly not floor
    bool has_pieces;  ///< ShadowPieces::mayBeIn()
    Appearance shadow_limit;
    Appearance firm_limit;            ///< kKeepFirm: removed from here on, up to what is lighter than floors
    std::array<bool, kPlaces> fades;  ///< kKeepUnfading: by place; kWithin: only its lightest part
  };

  static Census count(const Blob& blob, const cv::Mat1b& appearances);
  void findCoreStrips(const std::vector<Strip>& strips, const std::vector<Blob>& blobs);
  static cv::Vec3f hueOfCore(const Blob& blob, const Frame& frame, const cv::Mat1b& appearances);
  void restoreHued(const Blob& blob, const Frame& frame, const cv::Mat1b& appearances);
  void restoreHued(const Run& shadow, const cv::Vec3f& core_hue, const Frame& frame);
  void restorePattern(const Blob& blob, const Frame& frame);
  bool isPatterned(const Blob& blob, const Frame& frame);
  void judgeAll(const std::vector<Blob>& blobs, const Frame& frame, const cv::Mat1b& appearances);
  void applyVerdict(const Blob& blob, Verdict verdict, BitMask& objects);
  Verdict judge(const Blob& blob, const Census& census, const Frame& frame, const cv::Mat1b& appearances);
  static bool isFloorLike(const Blob& blob, const Census& census);
  static bool isTile(const Blob& blob, const Census& census);
  static bool isSide(const Blob& blob, const Census& census);
  static bool isMostlyShadow(const Blob& blob, const Census& census);
  static bool isLight(const Blob& blob, const Census& census);
  bool findNearest(const Blob& blob, Appearance shadow_limit, const Frame& frame,
                   const cv::Mat1b& appearances);
  template <typename Visit>
  void forBearings(const Blob& blob, const Frame& frame, const cv::Mat1b& appearances, Visit visit);
  bool liesInFront(const Blob& blob, const Census& census, const Frame& frame, const cv::Mat1b& appearances);
  Place placeOf(std::size_t bearing, float radius_px2) const;
  bool findFading(const Blob& blob, const Census& census, const Frame& frame, const cv::Mat1b& appearances);
  void keepFading(const Blob& blob, const Judged& judged, const Frame& frame, const cv::Mat1b& appearances);

  std::vector<cv::Rect> core_rects_;
  std::vector<Strip> core_strips_;
  cv::Mat1b bare_;            ///< raw without shadow; 0 outside the core strips
  BitArea core_area_;         ///< area of the core strips: outside of it the following masks are 0
  BitMask bare_bits_, core_;  ///< bare_; the same despeckled
  HueWindow around_;
  cv::Point2f ahead_;                          ///< from the camera foot to the region
  std::vector<float> nearest_px_;              ///< squared distance of the region's core, by bearing
  std::size_t core_begin_ = 0, core_end_ = 0;  ///< bearings of the core
  std::array<bool, kPlaces> fades_{};          ///< result of findFading()
  DeepShadow deep_;
  ShadowPieces pieces_;
  Pattern pattern_;
  std::vector<Judged> judged_;
  std::vector<Blob> undecided_, vague_, boards_, faces_;
  std::vector<const Blob*> sides_, lights_, objects_;
};

}  // namespace omnifleet::ground
