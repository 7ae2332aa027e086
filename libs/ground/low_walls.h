#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Walls whose top is below the horizon. A convex object beside the camera never spans half of the turn. A
/// connected region that spans more consists of walls, together with everything that occludes their foot in
/// the image. The top of the walls is the far edge of the region, except where higher objects hide it. The
/// colour of the walls, per bearing, is therefore the one that most of this edge has: one hue, darker or
/// lighter depending on the light on each side. A region that reaches the end of the view is left to
/// WallFinder where the lens sees the horizon.
class LowWalls {
 public:
  static constexpr std::uint8_t kWall = 1;  ///< mask value of walls; objects have 255

  LowWalls(const lens::Camera& camera, const FloorView& floor_view);

  /// @param image CV_8UC3 of the view's size @param regions of `objects` @param floor its colour per cell
  /// @param objects changed: pixels of the walls are removed
  /// @param only_rings accepts only regions that are thin on most bearings (a floor's grid is not) and at
  /// least as wide on the floor as a wall's height projects (a line on the floor is not)
  /// @return whether there are such walls
  bool find(const cv::Mat& image, const std::vector<Blob>& regions, const BitArea& area,
            const cv::Mat3f& floor, BitMask& objects, bool only_rings = false);
  /// Finds walls whose hue is so close to the floor's that only cell means distinguish it.
  /// @param hued regions of such a hue, made of whole cells. Objects and distance divide a ring into pieces;
  /// the long and thin pieces count together. @param colours of the cells, CV_32FC3 @param objects changed as
  /// by find()
  bool findFaint(const cv::Mat& image, const std::vector<Blob>& hued, const BitArea& area,
                 const cv::Mat3f& floor, const cv::Mat3f& colours, BitMask& objects);
  bool any() const { return !walls_.empty(); }
  /// Writes kWall where the mask is 0.
  void mark(cv::Mat1b& mask) const;

 private:
  static constexpr int kSectors = 144;  ///< of the full turn
  /// Statistics of the pixels just inside the region's far edge, in one sector.
  struct Edge {
    cv::Point near, far;
    float near2_px = 0.0f;  ///< squared distance of `near` from the camera foot
    float radius2_px =
        -1.0f;      ///< squared distance of `far` from the camera foot; negative where the region has no end
    int count = 0;  ///< pixels
    cv::Vec3f colour{0, 0, 0};
    float along = 0.0f, across = 0.0f;  ///< σ in brightness and in hue, as shares of the brightness
    bool is_wall = false;
  };
  template <typename Visit>
  void forSectors(const Blob& region, Visit visit) const;
  float radius2(int x, int y) const;
  bool isAround(const Blob& region);
  bool spansTurn(const Blob& region, double turn);
  bool isWide(const Edge& edge) const;
  bool isRing(const Blob& region) const;
  bool isFilled(const Blob& region) const;
  bool isRestOfRing(const Blob& region) const;
  bool isStrip(const Blob& region) const;
  void take(const cv::Mat& image, const Blob& region, const BitArea& area, const cv::Mat3f& floor,
            BitMask& objects);
  void keepAlike(const cv::Mat3f& colours);
  void takeEdges(const cv::Mat& image, BitMask& objects);
  void readEdges(const cv::Mat& image, const Blob& region);
  bool findHue();
  void findNearest();
  void markObjects(const cv::Mat& image, const Blob& region);
  void cleanObjects(const cv::Mat& image, const Blob& region, const BitArea& area, const cv::Mat3f& floor);

  lens::Camera camera_;
  cv::Point2f foot_px_;
  cv::Mat1b sectors_;  ///< per cell
  Blob ring_;          ///< of a faint hue; only its runs are set
  cv::Mat1b beside_;   ///< per cell: 1 on that ring or beside it
  const FloorView* view_;
  bool sees_horizon_;
  std::array<Edge, kSectors> edges_;
  std::array<int, kSectors> nearest_{};  ///< per sector: the nearest sector whose edge shows walls
  float along_ = 0.0f,
        across_ = 0.0f;  ///< greatest difference of a wall pixel from its edge, in brightness and in hue
  BitMask objects_, eroded_, opened_;  ///< within the walls' region: what is not wall
  BitMask gaps_;                       ///< within the walls' region: floor
  std::vector<Run> walls_, alike_;
};

}  // namespace omnifleet::ground
