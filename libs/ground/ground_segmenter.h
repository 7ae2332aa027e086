#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/cell_means.h"
#include "ground/cell_test.h"
#include "ground/coarse_texture.h"
#include "ground/despeckler.h"
#include "ground/far_objects.h"
#include "ground/floor_noise.h"
#include "ground/floor_reference.h"
#include "ground/floor_view.h"
#include "ground/horizon.h"
#include "ground/hue_smoother.h"
#include "ground/hued_cells.h"
#include "ground/intensity_edges.h"
#include "ground/labelling.h"
#include "ground/lamp_shadows.h"
#include "ground/line_filter.h"
#include "ground/low_walls.h"
#include "ground/object_completer.h"
#include "ground/off_cells.h"
#include "ground/shadow_filter.h"
#include "ground/strip.h"
#include "options/options.h"

namespace omnifleet::ground {

struct SegmenterOptions {
  std::string method =
      "local";  ///< "local": local floor colour; "histogram": Choi's single histogram of the image
  ReferenceOptions reference;      ///< section `reference`, for "local"
  double histogram_share = 0.002;  ///< for "histogram": share of the seed pixels that makes a bin ground
  int histogram_grow = 1;          ///< for "histogram": bins added around these
  double line_width_m = 0.020;  ///< metres: floor markings up to this width near the robot are ground; 0: off
  bool shadows = true;          ///< for "local" with colour images: shadows are ground
  bool low_walls = true;  ///< with `shadows`: separate walls lower than the camera from objects before them
  int max_line_px = 9;    ///< pixels: maximum thickness of a marking in the image
  static SegmenterOptions read(const options::Section& section);
};

/// Removes the ground (Choi §III.2) and despeckles (5×5 median). Reads single pixels only in cells that are
/// not clearly floor. Buffers are reused between frames.
class GroundSegmenter {
 public:
  /// @param camera defines the width of a floor marking in the image around the robot
  GroundSegmenter(const lens::Camera& camera, const FloorView& view, const SegmenterOptions& options);

  /// @param image CV_8UC3 or CV_8UC1 of the view's size
  /// @return false if no floor was found around the robot
  bool segment(const cv::Mat& image);

  /// 255 on pixels that are not ground, LowWalls::kWall on low walls, 0 elsewhere; full resolution.
  const cv::Mat1b& objects() const { return objects_; }
  /// The pixels of objects() that are 255, one bit per pixel.
  const BitMask& bits() const { return bits_; }
  /// Area outside of which objects() is 0.
  const BitArea& area() const { return area_; }
  /// Sets the pixels of a region of objects() that are not in `kept` to the value `other`.
  void relabelOutside(const Blob& region, const BitMask& kept, std::uint8_t other);
  /// True if the outline of the region was derived from its top and the average appearance of its sides
  /// (TopCompleter). Such an outline is wrong by several pixels.
  bool isRough(const Blob& region) const { return completer_.isRough(region); }
  bool hasLowWalls() const { return low_walls_ && low_walls_->any(); }
  /// Regions that may be floor or an object of the floor's colour. They are not in objects().
  const std::vector<Blob>& undecided() const { return shadow_.undecided(); }
  /// Undecided regions, not in objects(): shadows, walls in the shadow, or objects of the floor's colour of
  /// which little is visible.
  const std::vector<Blob>& vague() const { return shadow_.vague(); }
  /// Undecided regions, not in objects(): low walls behind objects, or shadows of these objects
  /// (ShadowPieces).
  const std::vector<Blob>& boards() const { return shadow_.boards(); }
  /// Undecided regions, not in objects(): other objects that touch an object in the image, or its shadow
  /// (ShadowPieces).
  const std::vector<Blob>& faces() const { return shadow_.faces(); }
  /// Undecided regions, not in objects(): the foot of a low wall, or the border of another floor
  /// (IntensityEdges).
  const std::vector<Blob>& intensityEdges() const { return intensity_edges_.found(); }
  /// Undecided regions, not in objects(): walls as bright as the floor, or another floor (CoarseTexture).
  const std::vector<Blob>& coarseTexture() const { return coarse_texture_.found(); }
  /// Colour of the floor per cell, CV_32FC3.
  const cv::Mat3f& floorColour() const { return reference_.colour(); }
  /// Noise of the last frame's pixels.
  const FloorNoise& noise() const { return noise_; }
  /// True if region growing reached the cell in the last frame.
  bool isGrown(int y, int x) const { return reference_.isGrown(y, x); }
  /// Size of the blocks of isGrown(), pixels.
  int blockSize() const { return reference_.blockSize(); }
  /// Horizon in the last frame; nullptr for wall views, which extend above it.
  const Horizon* horizon() const { return horizon_.get(); }
  /// Mean colour of each cell, CV_32FC3 (grey: three equal channels).
  const cv::Mat3f& cellMeans() const { return cells_.means(); }

 private:
  bool segmentLocal(const cv::Mat& image);
  bool segmentByHistogram(const cv::Mat& image);
  ShadowFilter::Frame shadowFrame(const cv::Mat& image) const;
  void findStrips(const FloorNoise& noise);
  void gatherStrips();
  bool findLowWalls(const cv::Mat& image, const std::vector<Blob>& regions);
  void complete(const cv::Mat& image);
  void markCells(const FloorNoise& noise);
  void spreadHue(int x, int y, float across2);
  cv::Vec3f faintHue(int x, int y, float strongest2, const FloorTest& pixel) const;
  FloorTest testOfSmoothed(int x, int y, const FloorNoise& noise) const;
  void findInside(const Strip& strip);
  bool isOneKind(int y, int x) const;
  void coverViewWithStrips();
  template <int kChannels>
  void classifyStrip(const cv::Mat& image, const Strip& strip, const FloorNoise& noise);
  template <int kChannels>
  void classifyCell(const cv::Mat& image, std::size_t i, int cell_y, const FloorNoise& noise);

  const FloorView* view_;
  SegmenterOptions options_;
  NoiseMeter meter_;
  FloorNoise noise_;  ///< of the seeds in the last frame
  HueSmoother hue_smoother_;
  cv::Mat3f colours_;         ///< cell colours for the comparison with the floor's
  FloorNoise cell_noise_;     ///< noise of colours_
  bool is_smoothed_ = false;  ///< CellColours::is_smoothed of colours_
  FloorReference reference_;
  std::unique_ptr<Horizon> horizon_;
  GroundHistogram histogram_;
  LineFilter lines_;
  CellMeans cells_;
  cv::Mat1b strength_, raw_, appearances_, objects_;
  cv::Mat1b off_;                   ///< per cell with a margin of 1: 1 if the mean is not clearly floor
  CellHues hues_;                   ///< of the cells of a row with off_ 1
  CellLimits limits_;               ///< of the cells of a strip that may be mixed
  cv::Mat1f across2_;               ///< same layout as off_: CellHues::across2 where off_ is 1, else 0
  cv::Mat1b active_;                ///< per cell: pixels are classified
  cv::Mat1b solid_;                 ///< per cell: appearance class if entirely object, else 0
  cv::Mat1f hue2_;                  ///< per JPEG colour block with a margin of 1: largest CellHues::across2
  std::vector<Around> around_;      ///< of the cells of a row within a strip
  std::vector<Strip> strips_;       ///< ordered by rows of cells from top to bottom, then left to right
  std::vector<Strip> last_strips_;  ///< strips of the previous frame, until its masks are cleared
  BitArea area_;                    ///< area of the strips
  BitMask raw_bits_, bits_;
  BitMask with_lines_;  ///< mask before the line filter
  Labeller labeller_with_lines_;
  const std::vector<Blob>* regions_with_lines_ = nullptr;  ///< of this frame, if they were needed
  FarObjects far_objects_;
  HuedCells hued_cells_;
  Despeckler despeckler_;
  Labeller labeller_;
  std::unique_ptr<LowWalls> low_walls_;
  IntensityEdges intensity_edges_;
  CoarseTexture coarse_texture_;
  LampShadows lamp_shadows_;
  ShadowFilter shadow_;
  ObjectCompleter completer_;
};

}  // namespace omnifleet::ground
