#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_growth.h"
#include "ground/floor_light.h"
#include "ground/floor_smoothing.h"
#include "ground/floor_view.h"
#include "ground/hue_smoother.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ReferenceOptions {
  double tolerance_along =
      0.06;  ///< fraction of the local floor brightness by which floor may be darker or lighter
  double tolerance_across = 0.022;  ///< fraction of it by which its colour may be off at equal brightness
  double noise_sigmas = 3.0;        ///< standard deviations of the seeds' pixel noise added to both
  double min_share = 0.004;         ///< share of the seeds that fills a bin of the histogram
  bool all_modes = false;           ///< of the seeds' colours all, not only the commonest (walls; no key)
  int smoothing_cells = 5;  ///< cells of 4 px: radius of the window that smooths the reference, 1–40
  static ReferenceOptions read(const options::Section& section);
};

/// The colour that the floor has, or would have, at each cell: learned from the seeds' histogram, grown
/// outward from them (FloorGrowth) and smoothed (FloorSmoothing; docs/methods.md, "Floor and contours").
class FloorReference {
 public:
  FloorReference(const lens::Camera& camera, const FloorView& view, const ReferenceOptions& options);

  /// @param cells grey: three equal channels
  /// @param beyond colours that are no floor's, by lookBeyond()'s sectors
  /// @return false when no seed shows floor; the reference of the last frame then stays
  bool learn(const CellColours& cells, const std::vector<cv::Vec4f>& beyond = {});
  /// @param sectors per cell, see FloorGrowth
  void lookBeyond(const cv::Mat1b& sectors);
  int blockSize() const { return block_ * FloorView::kCell; }  ///< pixels
  /// Has the growth got to that cell?
  bool isGrown(int y, int x) const;

  /// Of the last frame, in even light where a lamp is known.
  const FloorGrowth& growth() const { return growth_; }

  /// Floor colour per cell, defined wherever the view covers.
  const cv::Mat3f& colour() const { return smoothing_.colour(); }
  /// The light of the one lamp that is known to light the floor in the last frame; none where there is none.
  FloorLight* lampLight() { return growth_.isEvened() ? &light_ : nullptr; }
  /// Is p floor where the floor looks like r? Of a mean over n pixels the noise is √n times less.
  FloorTest testFor(const cv::Vec3f& r, const FloorNoise& noise) const {
    return tolerance_.testFor(r, noise);
  }

 private:
  void averageBlocks(const cv::Mat3f& cell_means);
  /// What growth is made of, of one frame.
  struct Sight {
    const CellColours& cells;
    FloorNoise noise;  ///< of a block
    const std::vector<cv::Vec4f>& beyond;
  };
  /// A look for a lamp's light, one growth a frame.
  struct LampLook {
    int left = 0;             ///< growths; 0: none is under way
    double grown = 0.0;       ///< blocks, by the last of them
    double best_share = 1.0;  ///< of the blocks without, by the best of them
  };

  bool grow(const Sight& sight);
  bool growBlocks(const Sight& sight);
  bool growByLamp(const Sight& sight);
  bool holdsFloor();
  void giveLampUp();
  void beginLook();
  void tryLamp(const Sight& sight);
  void judgeLamp(double without);
  bool lookAtOnce(const Sight& sight);
  bool growEvened(const Sight& sight);
  bool growAsSeen(const Sight& sight);
  double grownBlocks() const { return static_cast<double>(growth_.grown().size()); }

  ReferenceOptions options_;
  FloorTolerance tolerance_;
  int block_;                     ///< cells per side of a block
  std::vector<cv::Range> asked_;  ///< blocks of each row that the view or its neighbours lie in
  FloorGrowth growth_;
  FloorLight light_;
  bool is_lamp_lit_ = false;
  double most_grown_ = 0.0;  ///< blocks in the last frames
  double last_grown_ = 0.0;  ///< blocks in the last frame, without a lamp
  int until_look_ = 0;       ///< frames, while it is not, until that is looked at again
  int patience_;             ///< frames from the next look to the one after it
  LampLook look_;
  FloorSmoothing smoothing_;
};

}  // namespace omnifleet::ground
