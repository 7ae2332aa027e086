#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/appearance_class.h"
#include "ground/bit_mask.h"
#include "ground/convex_part.h"
#include "ground/labelling.h"
#include "ground/patch_sums.h"
#include "ground/shadow_filter.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Completes objects of nearly the floor's colour. Their sides receive less light than the floor and are
/// regions of their own. Their tops, and sides in full light, differ from the floor by a few hundredths,
/// which no single pixel reveals. Three cues from means of 5×5 pixels beside the region do:
/// - the hue of the side, which all faces of one object have in any light;
/// - more light than on the floor, which no shadow has;
/// - the colour right behind the side. Verticals run away from the camera foot, so every bearing of the side
/// meets the top there (docs/methods/local_mapper.md). The median over all bearings determines its difference
/// from the floor to less than a hundredth. The top extends as far as that colour does.
/// The region grows by these cues from pixel to pixel; each must exceed the noise. The result is accepted
/// only where it is convex, as the silhouette of an upright convex object is, and ends by itself: what
/// extends to the limit of the search is floor.
class SideCompleter {
 public:
  SideCompleter(const lens::Camera& camera, cv::Size image);

  struct Frame {
    const ShadowFilter::Frame& shadow;
    const cv::Mat1b& view;         ///< not 0 where floor may be visible
    const cv::Mat1b& appearances;  ///< of the pixels
    const BitMask& found;  ///< pixels of the side that belong to the object; the others are its shadow
  };
  /// @param side a region in less light than the floor and of nearly its hue
  /// @return the pixels of the whole object by rows; empty where there is none; valid until the next call
  const std::vector<Run>& complete(const Frame& frame, const Blob& side);

  /// The camera foot, pixels.
  const cv::Point2f& foot() const { return foot_px_; }

 private:
  /// Extent of the side on a bearing, pixels from the camera foot; far < near where it has none.
  struct Bearing {
    float near_px, far_px;
    float end_px;  ///< end of the top behind it
  };
  int bearingAt(float x, float y) const;
  void setSearchArea(const cv::Rect& region, int reach);
  static float noiseAt(const Frame& frame, const cv::Rect& region);
  bool measureSide(const Frame& frame, const Blob& side);
  void learnTop(const Frame& frame);
  void addTop(const Frame& frame);
  float endOfTop(const Frame& frame, std::size_t k) const;
  cv::Point pixelAt(std::size_t k, float radius) const;
  bool isLike(const Frame& frame, int x, int y) const;
  cv::Vec3f colourAt(const Frame& frame, int x, int y) const;
  bool isRim(const cv::Point& at) const;
  void grow(const Frame& frame);
  void keepConvex();
  cv::Rect paint(const std::vector<cv::Point>& polygon, const cv::Mat1b& view, cv::Mat1b& mask) const;
  void take(const cv::Mat1b& view);
  static bool isOther(const Frame& frame, const cv::Point& at);

  cv::Size size_;  ///< of the whole cells
  cv::Point2f foot_px_;
  cv::Rect around_;          ///< the region with the margin into which it may grow
  cv::Rect free_;            ///< around_ without its edges, except for those on the image border
  cv::Rect box_;             ///< bounding box of what has grown
  PatchSums sums_;           ///< in around_
  cv::Mat1b grown_, whole_;  ///< in around_: 255 where the object is; result
  cv::Point2f ahead_;        ///< from the camera foot to the region
  float step_rad_ = 0.0f;    ///< between bearings; the middle one points along `ahead_`
  std::vector<Bearing> bearings_;
  cv::Vec3f side_hue_, top_;  ///< top_: difference from the floor, whitened
  float noise_ = 0.0f;        ///< of patch means, as a share of the floor's brightness
  bool has_hue_ = false, has_top_ = false;
  std::vector<float> channel_[3], ends_;
  std::vector<cv::Point> outline_, hull_;
  std::vector<std::size_t> used_;
  std::vector<cv::Point> queue_;
  ConvexPart convex_;
  std::vector<Run> runs_;
};

}  // namespace omnifleet::ground
