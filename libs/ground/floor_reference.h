#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "ground/ground_histogram.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ReferenceOptions {
  double tolerance_along =
      0.06;  ///< fraction of the local floor brightness by which floor may be darker or lighter
  double tolerance_across = 0.022;  ///< fraction of it by which its colour may be off at equal brightness
  double noise_sigmas = 3.0;        ///< standard deviations of the seeds' pixel noise added to both
  double min_share = 0.004;         ///< share of the seeds that fills a bin of the histogram
  int smoothing_cells = 5;  ///< cells of 4 px: radius of the window that smooths the reference, 1–40
  static ReferenceOptions read(const options::Section& section);
};

/// The colour that the floor has, or would have, at each cell: learned from the seeds' histogram and grown
/// outward cell by cell, each accepted cell handing a slowly adapting reference on to its neighbours, so that
/// uneven light is followed while an object's edge stops the growth (RECIPES "Fisheye → ground", 1).
class FloorReference {
 public:
  FloorReference(const FloorView& view, const ReferenceOptions& options);

  /// @param cell_means CV_32FC3, mean colour per cell (grey: three equal channels)
  /// @param noise σ of one pixel of the seeds about its cell's mean, grey levels
  /// @return false when no seed shows floor; the reference of the last frame then stays
  bool learn(const cv::Mat3f& cell_means, double noise);

  /// Floor colour per cell, defined wherever the view covers.
  const cv::Mat3f& colour() const { return colour_; }
  /// Per block of cells (1×1, from 900 px of image width on 2×2): 255 where the growth reached, i.e. all
  /// floor.
  const cv::Mat1b& grown() const { return grown_; }

  /// Is p floor where the floor looks like r? `noise` in grey levels, added to both tolerances.
  struct Test {
    float along2, across2;  ///< squared tolerances as fractions of |r|², noise included
  };
  Test testFor(const cv::Vec3f& r, double noise) const;

 private:
  void averageBlocks(const cv::Mat3f& cell_means);
  bool seed();
  float brighten();
  float seedTexture();
  void grow(double noise);
  static cv::Vec3f expect(const cv::Vec3f& reference, const cv::Vec2f& slope, int dx, int dy);
  void sumBlocks();
  void smooth();
  void blurTwice();
  /// Where the middle of a fine pixel lies between the middles of coarse ones, `scale` times as large.
  struct Between {
    int first, second;
    float share;  ///< of the second
  };
  static Between between(int fine, int scale, int coarse_size);
  void spread();
  void fillAndDivide(cv::Mat& sums);

  const FloorView* view_;
  ReferenceOptions options_;
  GroundHistogram histogram_;
  int block_;         ///< cells per side of a block
  cv::Mat3f colour_;  ///< per cell
  // Per block:
  cv::Mat1b coverage_, seeds_, grown_;
  cv::Mat1b closed_, stop_;  ///< with a margin: 1 where growth never gets to; and where it has been
  std::vector<int> seed_blocks_;
  cv::Mat3f means_, carried_;
  cv::Mat2f slope_;                          ///< relative change of the brightness per block, x and y
  cv::Mat sums_, fine_, residual_, filler_;  ///< CV_32FC4: colour and weight, 2×2 blocks a pixel
  int radius_ = 1;                           ///< of the smoothing, in those pixels
  cv::Mat1f framed_, summed_;                ///< four floats a pixel; with a margin of zeros
  std::vector<Between> columns_;             ///< of colour_ in fine_
  cv::Mat3f wide_;                           ///< rows as of fine_, columns as of colour_
  std::vector<cv::Mat> pyramid_;
  std::vector<int> queue_;
  std::vector<float> steps_;
  float texture_ = 0.0f;  ///< median step of the seeds' colour over two cells, as a share of the brightness
};

}  // namespace omnifleet::ground
