#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/region_growing.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Model of the floor's illumination by one lamp and ambient light:
/// a + (1 − a)·φ, φ = (1 + |p − c|²/s²)^(−3/2), times exp(v·ρ²).
/// φ is Lambert's law for a small lamp at height s above the floor at c. The last factor is the vignetting of
/// the lens. Under a lamp in a dark room the light falls by a third within a few pixels far away. The model
/// predicts this from the floor that region growing has already reached. The sun, a window or several lamps
/// do not fit this model; region growing follows them by itself.
class FloorLight {
 public:
  /// @param cells number of cells of the view, of cell_px × cell_px pixels each
  /// @param block cells per side of a block of region growing
  FloorLight(const lens::Camera& camera, cv::Size cells, int cell_px, int block);

  /// Fits the model to the blocks that region growing has reached, starting from the last fit. It uses the
  /// sum of the channels of their means in the actual light.
  /// @return false if there are too few blocks
  bool fit(const RegionGrowing& growing);
  /// Light of the darkest of those blocks by the last fit(), as a share of the light at the camera's foot. A
  /// lamp matters only if it is low. Floor that is brighter elsewhere, as beside a window, needs no lamp
  /// model.
  double darkest() const { return darkest_; }
  /// Largest relative change of these blocks' light by the last fit().
  double change() const { return change_; }
  /// Keeps the parameters of the last ofBlocks(). restoreKept() returns to them.
  void keepUsed() { kept_ = of_last_blocks_; }
  void restoreKept() { p_ = kept_; }
  /// Resets the fit to the prior.
  void reset();

  /// Light per block by the last fit, CV_32FC1, 1 at the camera's foot. Valid until the next call.
  const cv::Mat1f& ofBlocks();
  /// Light per cell with the parameters of the last ofBlocks(), even if fit() was called since.
  const cv::Mat1f& ofCells();
  /// Ambient share of that light per cell; valid until the next call.
  const cv::Mat1f& ambientShareOfCells();
  /// Unit vectors in the image that lead over the floor towards the point beneath that lamp; 0 where no floor
  /// is visible.
  const cv::Mat2f& towardsLampOfCells();

 private:
  static constexpr int kParameters = 6;
  /// Level (logarithm), ambient share a, c (metres, floor frame of the camera), log s (metres), v.
  using Parameters = Eigen::Matrix<double, kParameters, 1>;
  using Hessian = Eigen::Matrix<double, kParameters, kParameters>;
  /// Floor positions of the centres of cells or blocks, and ρ² there. ρ² is 1 at the visible floor cell
  /// farthest from the principal point.
  struct Places {
    cv::Mat1f x_m, y_m, rim2;
  };
  struct Sample {
    float x_m, y_m, rim2, level;  ///< logarithm of the brightness
  };

  static Places placesOf(const lens::Camera& camera, cv::Size count, int pixels);
  static void scaleRim(Places& cells, Places& blocks);
  static Parameters initialGuess();
  static Parameters bounded(const Parameters& p);
  void gather(const RegionGrowing& growing);
  double costOf(const Parameters& p) const;
  void linearise(const Parameters& p, Hessian& hessian, Parameters& gradient) const;
  static void evaluate(const Parameters& p, const Places& places, cv::Mat1f& light);

  Places cells_, blocks_;
  cv::Mat1f of_cells_, of_blocks_, ambient_share_;
  cv::Mat2f towards_lamp_;
  Parameters p_ = initialGuess(), kept_ = initialGuess(), of_last_blocks_ = initialGuess();
  std::vector<Sample> samples_;
  double change_ = 0.0, darkest_ = 1.0;
};

}  // namespace omnifleet::ground
