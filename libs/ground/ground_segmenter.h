#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/cell_means.h"
#include "ground/cell_test.h"
#include "ground/despeckler.h"
#include "ground/far_things.h"
#include "ground/floor_noise.h"
#include "ground/floor_reference.h"
#include "ground/floor_view.h"
#include "ground/grainy_floor.h"
#include "ground/horizon.h"
#include "ground/hue_smoother.h"
#include "ground/hued_cells.h"
#include "ground/labelling.h"
#include "ground/lamp_shadows.h"
#include "ground/line_filter.h"
#include "ground/low_walls.h"
#include "ground/off_cells.h"
#include "ground/shade_filter.h"
#include "ground/step_edges.h"
#include "ground/strip.h"
#include "ground/thing_completer.h"
#include "options/options.h"

namespace omnifleet::ground {

struct SegmenterOptions {
  std::string method =
      "local";  ///< "local": local floor colour; "histogram": Choi's one histogram for the image
  ReferenceOptions reference;      ///< `reference`: for "local"
  double histogram_share = 0.002;  ///< for "histogram": share of the seed pixels that makes a bin ground
  int histogram_grow = 1;          ///< for "histogram": bins added around
  double line_width_m = 0.020;  ///< metres: floor markings up to this wide near the robot are ground; 0: off
  bool shadows = true;          ///< for "local", colour images: shadows are ground
  bool low_walls = true;  ///< with shadows: walls lower than the camera are told from what stands before
  int max_line_px = 9;    ///< pixels: but nothing thicker than this is taken for a marking
  static SegmenterOptions read(const options::Section& section);
};

/// Removes the ground (Choi §III.2) and despeckles (5×5 median). Looks at single pixels only in cells that
/// are not plain floor; buffers live from frame to frame.
class GroundSegmenter {
 public:
  /// @param camera tells how wide a floor marking appears around the robot
  GroundSegmenter(const lens::Camera& camera, const FloorView& view, const SegmenterOptions& options);

  /// @param image CV_8UC3 or CV_8UC1 of the view's size
  /// @return false when no floor was found around the robot
  bool segment(const cv::Mat& image);

  /// 255 on what is not ground, LowWalls::kWall on such walls, 0 elsewhere; full resolution.
  const cv::Mat1b& objects() const { return objects_; }
  /// Where that is 255, one bit a pixel.
  const BitMask& bits() const { return bits_; }
  /// Outside of it objects() is 0.
  const BitArea& area() const { return area_; }
  /// Of a region of objects() what is not in `kept` gets another value.
  void keepOf(const Blob& region, const BitMask& kept, std::uint8_t other);
  /// Is the region one whose outline was told by its top and what its sides look like on the whole? It is
  /// wrong by pixels.
  bool isRough(const Blob& region) const { return completer_.isRough(region); }
  bool hasLowWalls() const { return low_walls_ && low_walls_->any(); }
  /// Regions that may be floor or a thing of its colour; not in objects().
  const std::vector<Blob>& undecided() const { return shade_.undecided(); }
  /// Likewise; shadows, walls in the shade, or things of the floor's colour of which hardly more is seen.
  const std::vector<Blob>& vague() const { return shade_.vague(); }
  /// Likewise; low walls behind things, or those' shade (ShadePieces).
  const std::vector<Blob>& boards() const { return shade_.boards(); }
  /// Likewise; other things that touch a thing in the picture, or that one's shadow (ShadePieces).
  const std::vector<Blob>& faces() const { return shade_.faces(); }
  /// Likewise; the feet of low walls, or where another floor begins (StepEdges).
  const std::vector<Blob>& steps() const { return step_edges_.found(); }
  /// Likewise; walls as light as the floor, or another floor (GrainyFloor).
  const std::vector<Blob>& grainy() const { return grainy_floor_.found(); }
  /// Colour of the floor per cell, CV_32FC3.
  const cv::Mat3f& floorColour() const { return reference_.colour(); }
  /// Of the last frame's pixels.
  const FloorNoise& noise() const { return noise_; }
  /// Is the cell floor that joins the seeds, by the last frame's local colours?
  bool isGrown(int y, int x) const { return reference_.isGrown(y, x); }
  /// Pixels, of the blocks that it goes by.
  int blockSize() const { return reference_.blockSize(); }
  /// As the last frame shows it; none for walls, which reach up to it.
  const Horizon* horizon() const { return horizon_.get(); }
  /// Mean colour of each cell, CV_32FC3 (grey: three equal channels).
  const cv::Mat3f& cellMeans() const { return cells_.means(); }

 private:
  bool segmentLocal(const cv::Mat& image);
  bool segmentByHistogram(const cv::Mat& image);
  ShadeFilter::Frame shadeFrame(const cv::Mat& image) const;
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
  void everythingIsAStrip();
  template <int kChannels>
  void classifyStrip(const cv::Mat& image, const Strip& strip, const FloorNoise& noise);
  template <int kChannels>
  void classifyCell(const cv::Mat& image, std::size_t i, int cell_y, const FloorNoise& noise);

  const FloorView* view_;
  SegmenterOptions options_;
  NoiseMeter meter_;
  FloorNoise noise_;  ///< of the last frame's seeds
  HueSmoother hue_smoother_;
  cv::Mat3f colours_;         ///< of its cells, as they are compared with the floor's …
  FloorNoise cell_noise_;     ///< … and by how much they may be off by chance
  bool is_smoothed_ = false;  ///< CellColours
  FloorReference reference_;
  std::unique_ptr<Horizon> horizon_;
  GroundHistogram histogram_;
  LineFilter lines_;
  CellMeans cells_;
  cv::Mat1b strength_, raw_, looks_, objects_;
  cv::Mat1b off_;      ///< per cell, with one of margin to each side: 1 where the mean is not plainly floor
  CellHues hues_;      ///< of a row's cells that are off
  CellLimits limits_;  ///< of a strip's cells that may be mixed
  cv::Mat1f across2_;  ///< like off_: CellHues::across2 where that is 1, else 0
  cv::Mat1b active_;   ///< per cell: looked at
  cv::Mat1b solid_;    ///< per cell: Look of what is object all over, else 0
  cv::Mat1f hue2_;     ///< per block of JPEG's colours, with one of margin: the strongest CellHues::across2
  std::vector<Around> around_;      ///< of the cells of a row, in a strip
  std::vector<Strip> strips_;       ///< by rows of cells from top to bottom, left to right
  std::vector<Strip> last_strips_;  ///< of the frame before, until its masks are cleared
  BitArea area_;                    ///< of the strips
  BitMask raw_bits_, bits_;
  BitMask unlined_;  ///< with the markings
  Labeller unlined_labeller_;
  const std::vector<Blob>* unlined_regions_ = nullptr;  ///< of this frame, where they were asked for
  FarThings far_things_;
  HuedCells hued_cells_;
  Despeckler despeckler_;
  Labeller labeller_;
  std::unique_ptr<LowWalls> low_walls_;
  StepEdges step_edges_;
  GrainyFloor grainy_floor_;
  LampShadows lamp_shadows_;
  ShadeFilter shade_;
  ThingCompleter completer_;
};

}  // namespace omnifleet::ground
