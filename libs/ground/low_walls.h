#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Walls that end below the horizon. No convex thing is seen over half of the turn by a camera beside it:
/// what hangs together over so much is walls, with all that covers their foot in the picture. Their tops are
/// its far edge, but where higher things hide them, so their colour, bearing by bearing, is the one that most
/// of this edge has: in one hue, darker and lighter as the light falls on their sides. What reaches the end
/// of the view is left alone where the lens sees the horizon (WallFinder).
class LowWalls {
 public:
  static constexpr std::uint8_t kWall = 1;  ///< value of walls in masks in which things have 255

  LowWalls(const lens::Camera& camera, const FloorView& floor_view);

  /// @param image CV_8UC3 of the view's size @param regions of `objects` @param floor its colour per cell
  /// @param objects changed: what is of the walls goes
  /// @param only_rings regions that are thin on most bearings (not a floor's grid, which is all over), but no
  /// line on the floor: seen beyond a wall's foot is its height
  /// @return whether there are such walls
  bool find(const cv::Mat& image, const std::vector<Blob>& regions, const BitArea& area,
            const cv::Mat3f& floor, BitMask& objects, bool only_rings = false);
  /// Walls whose hue is so near to the floor's that but cells tell it.
  /// @param hued regions that have such a hue, of whole cells: of a ring that things and distance have torn
  /// the long and thin ones count together @param colours of the cells, CV_32FC3 @param objects changed, as
  /// by find()
  bool findFaint(const cv::Mat& image, const std::vector<Blob>& hued, const BitArea& area,
                 const cv::Mat3f& floor, const cv::Mat3f& colours, BitMask& objects);
  bool any() const { return !walls_.empty(); }
  /// Writes kWall where it is 0.
  void mark(cv::Mat1b& mask) const;

 private:
  static constexpr int kSectors = 144;  ///< of a turn
  /// What is seen right inside of the region's far edge.
  struct Edge {
    cv::Point near, far;
    float near2_px = 0.0f;     ///< squared, from the camera's foot, likewise
    float radius2_px = -1.0f;  ///< squared, from the camera's foot; negative where it does not end
    int count = 0;             ///< pixels
    cv::Vec3f colour{0, 0, 0};
    float along = 0.0f, across = 0.0f;  ///< σ of them in brightness and in hue, as shares of the brightness
    bool is_wall = false;
  };
  template <typename Visit>
  void forSectors(const Blob& region, Visit visit) const;
  float radius2(int x, int y) const;
  bool isAround(const Blob& region);
  bool isOver(const Blob& region, double turn);
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
  void markThings(const cv::Mat& image, const Blob& region);
  void cleanThings(const cv::Mat& image, const Blob& region, const BitArea& area, const cv::Mat3f& floor);

  lens::Camera camera_;
  cv::Point2f foot_px_;
  cv::Mat1b sectors_;  ///< per cell
  Blob ring_;          ///< of a faint hue; its runs alone
  cv::Mat1b beside_;   ///< per cell: of that ring, or beside it
  const FloorView* view_;
  bool sees_horizon_;
  std::array<Edge, kSectors> edges_;
  std::array<int, kSectors> nearest_{};  ///< per sector, the nearest whose edge shows walls
  float along_ = 0.0f, across_ = 0.0f;   ///< by so much may a pixel of the walls differ from its edge
  BitMask things_, eroded_, opened_;     ///< in the walls' region, what is none of them
  BitMask gaps_;                         ///< likewise, floor
  std::vector<Run> walls_, alike_;
};

}  // namespace omnifleet::ground
