#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_growth.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// How bright the floor is lit, as one lamp over it and what light there is all over do it: a + (1 − a)·φ,
/// φ = (1 + |p − c|²/s²)^(−3/2), Lambert's law for a small lamp s over the floor at c, times what the lens
/// loses towards its rim, exp(v·ρ²). Where the light falls by a third within a few pixels, as far off under a
/// lamp in a dark room, it is known before growth gets there: from the floor that growth has reached already.
/// A sun, a window or many lamps are no such light; growth follows them by itself.
class FloorLight {
 public:
  /// @param cells of the view, of cell_px × cell_px pixels each; block: cells to a side of growth's blocks
  FloorLight(const lens::Camera& camera, cv::Size cells, int cell_px, int block);

  /// Fits to the blocks that growth has reached (sum of the channels of their means as they are, light and
  /// all), from the last fit on. @return false where they are too few
  bool fit(const FloorGrowth& growth);
  /// The darkest of those blocks by the last fit(), as a share of the light at the foot: floor
  /// that is lighter elsewhere, as beside a window, asks for no lamp.
  double darkest() const { return darkest_; }
  /// The largest change of brightness, as a share of it, that the last fit() made to those blocks' light.
  double change() const { return change_; }
  /// goBack() takes back what fit() did after the ofBlocks() that was the last before the last keepTried().
  void keepTried() { kept_ = of_last_blocks_; }
  void goBack() { p_ = kept_; }
  /// Forgets the fits.
  void reset();

  /// By the last fit. CV_32FC1, 1 at the camera's foot; valid until the next call.
  const cv::Mat1f& ofBlocks();
  /// The same light as that of the last ofBlocks(), whatever was fitted since.
  const cv::Mat1f& ofCells();
  /// Of that light the share that is not the lamp's; valid until the next call.
  const cv::Mat1f& besideLampOfCells();
  /// Unit vectors in the picture, which lead over the floor towards the place beneath that lamp; 0 where no
  /// floor is seen.
  const cv::Mat2f& towardsLampOfCells();

 private:
  static constexpr int kParameters = 6;
  /// Level (logarithm), ambient share a, c (metres, camera's floor frame), log s (metres), v.
  using Parameters = Eigen::Matrix<double, kParameters, 1>;
  using Hessian = Eigen::Matrix<double, kParameters, kParameters>;
  /// Of blocks, or cells: where their middles' floor is, and ρ² there, 1 at the cell of floor in view that is
  /// farthest from the principal point.
  struct Places {
    cv::Mat1f x_m, y_m, rim2;
  };
  struct Sample {
    float x_m, y_m, rim2, level;  ///< logarithm of the brightness
  };

  static Places placesOf(const lens::Camera& camera, cv::Size count, int pixels);
  static void scaleRim(Places& cells, Places& blocks);
  static Parameters start();
  static Parameters bounded(const Parameters& p);
  void gather(const FloorGrowth& growth);
  double costOf(const Parameters& p) const;
  void linearise(const Parameters& p, Hessian& hessian, Parameters& gradient) const;
  static void shine(const Parameters& p, const Places& places, cv::Mat1f& light);

  Places cells_, blocks_;
  cv::Mat1f of_cells_, of_blocks_, beside_lamp_;
  cv::Mat2f towards_lamp_;
  Parameters p_ = start(), kept_ = start(), of_last_blocks_ = start();
  std::vector<Sample> samples_;
  double change_ = 0.0, darkest_ = 1.0;
};

}  // namespace omnifleet::ground
