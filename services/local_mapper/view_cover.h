#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "ground/floor_view.h"
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
/// circle that is smaller than its calibration says. It reaches the edge of the view, is of one colour, and
/// ends at an edge. What is black is told at once; what comes up within one frame while the robot hardly
/// moves, too; any other when it stays while the robot drives and the rest of the view changes, as with no
/// wall. Looked at in blocks of the picture, about 40 in a row.
class ViewCover {
 public:
  ViewCover(const ground::FloorView& view, const ViewCoverOptions& options);

  /// @param image of the view's size, BGR8 or grey @param wheels since the frame before
  /// @return whether another part than before is covered now
  bool look(const cv::Mat& image, const Motion& wheels);
  /// Share of the view; 0 while nothing is covered.
  double share() const;
  /// 255 where covered; empty while nothing is.
  const cv::Mat1b& mask() const { return mask_; }

 private:
  using Blocks = std::vector<std::uint8_t>;  // one each

  struct Region {
    Blocks in;
    int count = 0;
    cv::Vec3f colour;
    Pose2 moved;                   ///< since it was seen first
    std::vector<cv::Vec3f> means;  ///< of all blocks then
  };

  void drawBlocks(const ground::FloorView& view);
  void readMeans(const cv::Mat& image);
  float median();
  bool isGone() const;
  bool grow(int seed);
  bool hasEdge() const;
  bool isBlack(float median) const;
  bool cameUp(const Motion& wheels) const;
  bool hasStayed(const Motion& wheels);
  bool hasRestChanged(const Region& region) const;
  void cover();
  void drawMask();

  static constexpr int kFollowed = 4;
  ViewCoverOptions options_;
  cv::Size image_, grid_;
  int block_px_;
  Blocks usable_;  ///< wholly in the view, and not known to be covered
  std::vector<int> view_blocks_, rim_;
  std::vector<cv::Vec3f> means_, before_, covered_means_;
  bool has_before_ = false;
  Blocks visited_, covered_;
  std::vector<int> queue_;  ///< of the region that was grown last
  std::vector<float> sorted_;
  Region followed_[kFollowed], next_[kFollowed];
  int next_count_ = 0;
  cv::Mat1b mask_;
};

}  // namespace omnifleet::local_mapper
