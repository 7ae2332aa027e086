#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "lens/camera.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ViewOptions {
  double min_depression_deg = 2.0;  ///< degrees below the horizon, upper limit of the search for floor
  double mask_margin_px = 2.0;      ///< pixels added to the robot's own mask
  double border_margin_px =
      2.0;  ///< pixels excluded along the border of the lens's image circle and of the image
  double cut_reach_px =
      11.0;  ///< pixels from the border of the view within which filters distort a cut region
  double seed_ring_px =
      40.0;  ///< pixels: width of the floor ring outside the mask that seeds the floor model
  std::vector<double> seed_annulus_px;  ///< [u, v, r_inner, r_outer]: seeds instead of the ring; empty: ring
  std::vector<double> seed_rectangle_px;  ///< [u, v, width, height]: seeds instead of the ring; empty: ring
  std::vector<double>
      region_px;  ///< [u, v, width, height]: search only here; empty: wherever floor can be visible
  static ViewOptions read(const options::Section& section);
};

/// Pixels of one camera that can show floor, computed once from the lens. All results exist per cell of kCell
/// × kCell pixels, so that the frame loop rarely reads single pixels.
class FloorView {
 public:
  static constexpr int kCell = 4;  ///< pixels: quarter resolution of the floor model

  /// @param occluded not 0 on pixels that show nothing of the world; empty: none
  /// Throws options::Error if no pixel shows floor or no seed cell remains.
  FloorView(const lens::Camera& camera, const ViewOptions& options, const cv::Mat1b& occluded = {});

  /// View of objects that reach the horizon or higher, such as the walls of a room. It extends as far up as
  /// the lens sees, with seeds along its upper border. Returns nullptr if the image does not contain the
  /// horizon.
  static std::unique_ptr<FloorView> upward(const lens::Camera& camera);

  cv::Size imageSize() const { return {mask_.cols, mask_.rows}; }
  cv::Size cells() const { return {seeds_.cols, seeds_.rows}; }
  /// Full resolution, 255 where floor may be visible, else 0.
  const cv::Mat1b& mask() const { return mask_; }
  /// True within 2 px of the outside of mask(). An outline there is cut off by the view.
  bool nearBorder(float u, float v) const { return borderAt(u, v) > kCutReach; }
  /// Prefetches the data of nearBorder() and nearCut().
  void prefetchBorder(float u, float v) const {
    const int x = cvRound(u), y = cvRound(v);
    if (x >= 0 && y >= 0 && x < border_.cols && y < border_.rows) __builtin_prefetch(border_.ptr(y) + x);
  }
  /// True within `cut_reach_px` of the outside of mask(). A cut outline ends too early there.
  bool nearCut(float u, float v) const { return borderAt(u, v) > 0; }
  /// True if the pixel shows the robot itself.
  bool isOwnBody(const cv::Point& pixel) const { return border_(pixel) == kOwnBody; }
  /// Per cell: 0 outside, 1 partly inside, 2 wholly inside.
  const cv::Mat1b& coverage() const { return coverage_; }
  /// Per cell: 255 where the cell seeds the ground model.
  const cv::Mat1b& seeds() const { return seeds_; }
  /// Positions of the seed cells, at least one.
  const std::vector<cv::Point>& seedCells() const { return seed_cells_; }
  /// First and one-past-last cell of the view in each row of cells.
  const std::vector<cv::Range>& rows() const { return rows_; }
  /// rows() of the view with a margin around it.
  std::vector<cv::Range> rowsWithin(int margin_cells) const;

 private:
  FloorView() = default;
  void seedHorizon(const lens::Camera& camera);
  void drawMask(const lens::Camera& camera, const ViewOptions& options, const cv::Mat1b& occluded);
  void drawCells(const lens::Camera& camera, const ViewOptions& options);

  static constexpr std::uint8_t kCutReach = 1, kBorder = 2, kOwnBody = 3;  // values of border_
  std::uint8_t borderAt(float u, float v) const {
    const int x = cvRound(u), y = cvRound(v);
    if (x < 0 || y < 0 || x >= border_.cols || y >= border_.rows) return kBorder;
    return border_(y, x);
  }

  cv::Mat1b mask_, border_, coverage_, seeds_;
  std::vector<cv::Point> seed_cells_;
  std::vector<cv::Range> rows_;
};

}  // namespace omnifleet::ground
