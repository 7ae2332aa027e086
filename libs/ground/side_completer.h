#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/convex_part.h"
#include "ground/labelling.h"
#include "ground/look.h"
#include "ground/patch_sums.h"
#include "ground/shade_filter.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Completes things of nearly the floor's colour. Their sides lie in less light than the floor and are
/// regions of their own; tops and sides in full light differ from the floor by a few hundredths, which no
/// single pixel tells. Three things do, of means of 5×5 pixels beside the region:
///  - the hue of the side: all faces of one thing have it, in any light;
///  - more light than on the floor: no shadow has it;
///  - what lies right behind the side. Verticals run away from the camera's foot, so every bearing of the
///  side
///    meets the top there (docs/methods.md, "Support-function prism"); the median over all bearings tells its
///    colour from the floor's to less than a hundredth, and the top goes on while that colour does.
/// The region grows by them from pixel to pixel; all of them must be more than noise. What it becomes counts
/// only where it is convex, as the silhouette of an upright convex thing is, and ends by itself: what goes on
/// as far as it is looked for is floor.
class SideCompleter {
 public:
  SideCompleter(const lens::Camera& camera, cv::Size image);

  struct Frame {
    const ShadeFilter::Frame& shade;
    const cv::Mat1b& view;   ///< not 0 where floor may be seen
    const cv::Mat1b& looks;  ///< of the pixels
    const BitMask& found;    ///< what of the side is the thing; the rest is its shadow
  };
  /// @param side a region in less light than the floor and of nearly its hue
  /// @return the pixels of the whole thing, by rows, valid until the next call; empty where there is none
  const std::vector<Run>& complete(const Frame& frame, const Blob& side);

  /// The camera's, pixels.
  const cv::Point2f& foot() const { return foot_px_; }

 private:
  /// Of the side, pixels from the foot; far < near where it has none.
  struct Bearing {
    float near_px, far_px;
    float end_px;  ///< of the top behind
  };
  int bearingAt(float x, float y) const;
  void lookAround(const cv::Rect& region, int reach);
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
  cv::Rect around_;          ///< the region, with as much beside it as it may grow
  cv::Rect free_;            ///< of it, without its edges, but for those that are the image's
  cv::Rect box_;             ///< what has grown
  PatchSums sums_;           ///< in around_
  cv::Mat1b grown_, whole_;  ///< in around_: 255 where the thing is; what is taken
  cv::Point2f ahead_;        ///< from the foot to the region
  float step_rad_ = 0.0f;    ///< of the bearings, which begin half their number before `ahead_`
  std::vector<Bearing> bearings_;
  cv::Vec3f side_hue_, top_;  ///< top_: off the floor as whitened
  float noise_ = 0.0f;        ///< of means, as a share of the floor's brightness
  bool has_hue_ = false, has_top_ = false;
  std::vector<float> channel_[3], ends_;
  std::vector<cv::Point> outline_, hull_;
  std::vector<std::size_t> used_;
  std::vector<cv::Point> queue_;
  ConvexPart convex_;
  std::vector<Run> runs_;
};

}  // namespace omnifleet::ground
