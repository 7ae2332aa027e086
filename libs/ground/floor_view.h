#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "lens/camera.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ViewOptions {
  double min_depression_deg = 2.0;  ///< degrees below the horizon down to which floor is looked for
  double mask_margin_px = 2.0;      ///< pixels added to the robot's own mask
  double border_margin_px =
      2.0;                     ///< pixels left out along the edge of the lens's image circle and of the image
  double cut_reach_px = 11.0;  ///< pixels: a region that the edge of the view cuts is shaped by filters as
                               ///< far from there: thin as a marking where it tapers, rounded where it ends
  double seed_ring_px =
      40.0;  ///< pixels: width of the floor ring outside the mask that seeds the ground model
  std::vector<double>
      seed_annulus_px;  ///< [u, v, r_inner, r_outer]: seeds there instead of the ring; empty: ring
  std::vector<double> seed_rectangle_px;  ///< [u, v, width, height]: seeds there instead; empty: ring
  std::vector<double>
      region_px;  ///< [u, v, width, height]: look only there; empty: wherever floor can be seen
  static ViewOptions read(const options::Section& section);
};

/// Which pixels of one camera can show floor, found once from the lens. Everything is per cell of kCell ×
/// kCell pixels first, so that the frame loop need not look at pixels.
class FloorView {
 public:
  static constexpr int kCell = 4;  ///< pixels: the quarter resolution of the ground model

  /// @param covered not 0 on pixels that show nothing of the world; empty: none
  /// Throws options::Error when no pixel shows floor or no seed cell remains.
  FloorView(const lens::Camera& camera, const ViewOptions& options, const cv::Mat1b& covered = {});

  /// The view of what stands up to the horizon and beyond, a room's walls: as far up as the lens sees, seeds
  /// along the end of it. None where the image holds nothing of the horizon.
  static std::unique_ptr<FloorView> upward(const lens::Camera& camera);

  cv::Size imageSize() const { return {mask_.cols, mask_.rows}; }
  cv::Size cells() const { return {seeds_.cols, seeds_.rows}; }
  /// Full resolution, 255 where floor may be seen, else 0.
  const cv::Mat1b& mask() const { return mask_; }
  /// Within 2 px of the outside of mask(): an outline there is cut, not seen.
  bool nearBorder(float u, float v) const { return borderAt(u, v) > kCutReach; }
  /// Fetches what nearBorder() and nearCut() read.
  void prefetchBorder(float u, float v) const {
    const int x = cvRound(u), y = cvRound(v);
    if (x >= 0 && y >= 0 && x < border_.cols && y < border_.rows) __builtin_prefetch(border_.ptr(y) + x);
  }
  /// As near to the outside of mask() as `cut_reach_px`: there an outline that is cut ends too early.
  bool nearCut(float u, float v) const { return borderAt(u, v) > 0; }
  /// Does the pixel show the robot itself?
  bool isOwnBody(const cv::Point& pixel) const { return border_(pixel) == kOwnBody; }
  /// Per cell: 0 outside, 1 partly inside, 2 wholly inside.
  const cv::Mat1b& coverage() const { return coverage_; }
  /// Per cell: 255 where the cell seeds the ground model.
  const cv::Mat1b& seeds() const { return seeds_; }
  /// These cells, at least one.
  const std::vector<cv::Point>& seedCells() const { return seed_cells_; }
  /// First and one-past-last covered cell of each row of cells.
  const std::vector<cv::Range>& rows() const { return rows_; }
  /// The same of the view with a margin around it.
  std::vector<cv::Range> rowsWithin(int margin_cells) const;

 private:
  FloorView() = default;
  void seedHorizon(const lens::Camera& camera);
  void drawMask(const lens::Camera& camera, const ViewOptions& options, const cv::Mat1b& covered);
  void drawCells(const lens::Camera& camera, const ViewOptions& options);

  static constexpr std::uint8_t kCutReach = 1, kBorder = 2, kOwnBody = 3;  // of border_
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
