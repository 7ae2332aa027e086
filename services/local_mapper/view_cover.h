#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "local_mapper/view_blocks.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct ViewCoverOptions {
  double min_share = 0.08;    ///< 1, of the view that a cover hides at least; 0: off
  double max_share = 0.70;    ///< 1, … and at most: beyond that nothing tells cover from world
  double black_level = 6;     ///< grey levels: no thing in a lit room is as dark …
  double black_share = 0.05;  ///< 1, … and also darker than this share of the view's median
  double moved_m = 1.0;       ///< metres driven under one and the same plain part of the view, or …
  double turned_rad = 0.6;    ///< radians turned, until it is known to be none of the world
  static ViewCoverOptions read(const options::Section& section);
};

/// A part of the view that shows nothing of the world: tape or a hand on the lens, a lens hood, an image
/// circle that is smaller than its calibration says. It reaches the edge of the view. Black, or of one colour
/// that ends at an edge and comes up within one frame while the robot hardly moves: told at once. Of whatever
/// look: told at once, too, where it comes up so and what was seen there is gone, in hue or in structure;
/// light and shadow change neither. Any other of one colour: when it stays while the robot drives and the
/// rest of the view changes, as with no wall.
class ViewCover {
 public:
  /// @param blocks are kept by reference
  ViewCover(const ViewBlocks& blocks, const ViewCoverOptions& options);

  /// Looks at the frame that `blocks` has read. @param wheels since the frame before
  /// @return whether another part than before is covered now
  bool look(const Motion& wheels);
  /// Share of the view; 0 while nothing is covered.
  double share() const;
  /// 255 where covered; empty while nothing is.
  const cv::Mat1b& mask() const { return mask_; }
  /// One each block: 1 where it lies in the view and is not known to be covered.
  const std::vector<std::uint8_t>& usable() const { return usable_; }

 private:
  using Blocks = std::vector<std::uint8_t>;  // one each

  struct Region {
    Blocks in;
    int count = 0;
    cv::Vec3f colour;
    Pose2 moved;                   ///< since it was seen first
    std::vector<cv::Vec3f> means;  ///< of all blocks then
  };

  float median();
  bool isGone() const;
  template <class Belongs>
  bool grow(int seed, Belongs belongs);
  bool growOneColour(int seed);
  bool hasEdge() const;
  bool isBlack(float median) const;
  bool cameUp(const Motion& wheels) const;
  bool hasStayed(const Motion& wheels);
  bool hasRestChanged(const Region& region) const;
  bool coverOneColour(const Motion& wheels);
  bool coverWhatCameUp(const Motion& wheels);
  bool hasAnotherHue() const;
  bool lostStructure() const;
  void cover();
  void drawMask();

  static constexpr int kFollowed = 4;
  ViewCoverOptions options_;
  const ViewBlocks& blocks_;
  cv::Size grid_;
  Blocks usable_;
  std::vector<cv::Vec3f> covered_means_;
  Blocks visited_, covered_;
  std::vector<int> queue_;  ///< of the region that was grown last
  std::vector<float> sorted_;
  Region followed_[kFollowed], next_[kFollowed];
  int next_count_ = 0;
  cv::Mat1b mask_;
};

}  // namespace omnifleet::local_mapper
