#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_light.h"
#include "ground/floor_smoothing.h"
#include "ground/floor_view.h"
#include "ground/hue_smoother.h"
#include "ground/region_growing.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ReferenceOptions {
  double tolerance_along = 0.06;    ///< brightness tolerance of floor, share of the local floor brightness
  double tolerance_across = 0.022;  ///< hue tolerance at equal brightness, same unit
  double noise_sigmas = 3.0;  ///< standard deviations of the seeds' pixel noise added to both tolerances
  double min_share = 0.004;   ///< share of the seeds that fills a bin of the histogram
  bool all_modes = false;     ///< use all modes of the seeds' colours (for walls; no option key)
  int smoothing_cells = 5;    ///< cells of 4 px: radius of the window that smooths the reference, 1–40
  static ReferenceOptions read(const options::Section& section);
};

/// Reference colour of the floor at each cell, also where objects hide it. It is learned from the seeds'
/// histogram, grown outward from the seeds (RegionGrowing) and smoothed (FloorSmoothing);
/// docs/methods/floor_segmentation.md.
class FloorReference {
 public:
  FloorReference(const lens::Camera& camera, const FloorView& view, const ReferenceOptions& options);

  /// @param cells grey images: three equal channels
  /// @param beyond colours that are not floor, by the sectors of setBeyondSectors()
  /// @return false if no seed shows floor; the reference of the previous frame then stays
  bool learn(const CellColours& cells, const std::vector<cv::Vec4f>& beyond = {});
  /// @param sectors sector number per cell, see RegionGrowing
  void setBeyondSectors(const cv::Mat1b& sectors);
  int blockSize() const { return block_ * FloorView::kCell; }  ///< pixels
  /// True if region growing reached the cell.
  bool isGrown(int y, int x) const;

  /// Region growing of the last frame. Its means are evened out if a lamp is known.
  const RegionGrowing& growing() const { return growing_; }

  /// Floor colour per cell, defined within the view.
  const cv::Mat3f& colour() const { return smoothing_.colour(); }
  /// Light of the lamp in the last frame; nullptr if no lamp is known.
  FloorLight* lampLight() { return growing_.isEvened() ? &light_ : nullptr; }
  /// Test for a pixel p where the floor has colour r. For a mean over n pixels divide the noise by √n.
  FloorTest testFor(const cv::Vec3f& r, const FloorNoise& noise) const {
    return tolerance_.testFor(r, noise);
  }

 private:
  void averageBlocks(const cv::Mat3f& cell_means);
  /// Inputs of region growing for one frame.
  struct FrameInput {
    const CellColours& cells;
    FloorNoise noise;  ///< noise of a block's mean
    const std::vector<cv::Vec4f>& beyond;
  };
  /// State of a search for a lamp, one growing per frame.
  struct LampSearch {
    int left = 0;             ///< frames left; 0: no search
    double grown = 0.0;       ///< blocks reached by the last growing with a lamp
    double best_share = 1.0;  ///< best ratio of blocks with a lamp to blocks without
  };

  bool grow(const FrameInput& input);
  bool growBlocks(const FrameInput& input);
  bool growByLamp(const FrameInput& input);
  bool holdsFloor();
  void dropLamp();
  void beginLampSearch();
  void tryLamp(const FrameInput& input);
  void judgeLamp(double without);
  bool searchAtOnce(const FrameInput& input);
  bool growEvened(const FrameInput& input);
  bool growUnevened(const FrameInput& input);
  double grownBlocks() const { return static_cast<double>(growing_.grown().size()); }

  ReferenceOptions options_;
  FloorTolerance tolerance_;
  int block_;                           ///< cells per side of a block
  std::vector<cv::Range> used_blocks_;  ///< per row: blocks in the view or next to it
  RegionGrowing growing_;
  FloorLight light_;
  bool is_lamp_lit_ = false;
  double most_grown_ = 0.0;      ///< decaying maximum of blocks over the last frames
  double last_grown_ = 0.0;      ///< blocks in the last frame, without a lamp
  int frames_until_search_ = 0;  ///< frames until the next search, while no lamp is known
  int search_interval_;          ///< frames between the next search and the one after it
  LampSearch search_;
  FloorSmoothing smoothing_;
};

}  // namespace omnifleet::ground
