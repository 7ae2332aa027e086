#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "local_mapper/view_blocks.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct LensOcclusionOptions {
  double min_share = 0.08;    ///< 1, minimum share of the view that is occluded; 0: off
  double max_share = 0.70;    ///< 1, maximum share; beyond it occluder and scene cannot be distinguished
  double black_level = 6;     ///< grey levels: no object in a lit room is as dark as a black occluder
  double black_share = 0.05;  ///< 1, a black occluder is also darker than this share of the view's median
  double moved_m =
      1.0;  ///< metres driven with an unchanged plain part of the view, from which it is an occluder
  double turned_rad = 0.6;  ///< radians turned, for the same test
  static LensOcclusionOptions read(const options::Section& section);
};

/// A part of the view that shows nothing of the scene: tape or a hand on the lens, a lens hood, an image
/// circle smaller than its calibration. It reaches the edge of the view. It is detected:
/// - at once, if it is of one colour, ends at an edge, and is black or appears within one frame while the
/// robot hardly moves;
/// - at once, whatever its appearance, if it appears in this way and the former content is gone, in hue or in
/// structure; light and shadow change neither;
/// - otherwise, if it is of one colour, once it stays while the robot drives and the rest of the view
/// changes. No wall does that.
class LensOcclusion {
 public:
  /// @param blocks kept by reference
  LensOcclusion(const ViewBlocks& blocks, const LensOcclusionOptions& options);

  /// Processes the frame that `blocks` has read. @param wheels motion since the previous frame
  /// @return whether the occluded part has changed
  bool update(const Motion& wheels);
  /// Occluded share of the view; 0 without occlusion.
  double share() const;
  /// 255 where occluded; empty without occlusion.
  const cv::Mat1b& mask() const { return mask_; }
  /// Per block: 1 where it lies in the view and is not known to be occluded.
  const std::vector<std::uint8_t>& usable() const { return usable_; }

 private:
  using Blocks = std::vector<std::uint8_t>;  // one per block

  struct Region {
    Blocks in;
    int count = 0;
    cv::Vec3f colour;
    Pose2 moved;                   ///< since its first frame
    std::vector<cv::Vec3f> means;  ///< of all blocks in its first frame
  };

  float median();
  bool isGone() const;
  template <class Belongs>
  bool grow(int seed, Belongs belongs);
  bool growOneColour(int seed);
  bool hasEdge() const;
  bool isBlack(float median) const;
  bool hasAppeared(const Motion& wheels) const;
  bool hasStayed(const Motion& wheels);
  bool hasRestChanged(const Region& region) const;
  bool findUniformOcclusion(const Motion& wheels);
  bool findSuddenOcclusion(const Motion& wheels);
  bool hasAnotherHue() const;
  bool lostStructure() const;
  void markOccluded();
  void drawMask();

  static constexpr int kMaxFollowed = 4;
  LensOcclusionOptions options_;
  const ViewBlocks& blocks_;
  cv::Size grid_;
  Blocks usable_;
  std::vector<cv::Vec3f> occluded_means_;
  Blocks visited_, occluded_;
  std::vector<int> queue_;  ///< region that was grown last
  std::vector<float> sorted_;
  Region followed_[kMaxFollowed], next_[kMaxFollowed];
  int next_count_ = 0;
  cv::Mat1b mask_;
};

}  // namespace omnifleet::local_mapper
