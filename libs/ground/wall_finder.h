#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/floor_view.h"
#include "ground/ground_segmenter.h"
#include "ground/labelling.h"
#include "ground/low_walls.h"
#include "ground/wall_foot.h"
#include "options/options.h"

namespace omnifleet::ground {

struct WallOptions {
  bool enabled = true;
  double min_arc_deg = 60.0;  ///< degrees of the horizon that a region must reach
  static WallOptions read(const options::Section& section);
};

/// Walls, and what stands in front of them. Everything lower than the camera ends below the horizon. A region
/// that reaches it over a wide arc is the walls of the room, together with everything that occludes their
/// foot in the image. The colours of the walls are those at and above the horizon, where nothing else is
/// visible. From there the walls are followed downward, as the floor is followed from the robot outward
/// (GroundSegmenter, with seeds along the horizon). What is neither floor nor wall stands in front of a wall
/// or is a part of it; FloorScan::isInFrontOfWalls() decides.
/// A wall of nearly the floor's colours leaves no region or is taken for shadow. It is found where the
/// growing of the floor stopped: what extends from above the horizon down to there without an edge is not
/// floor.
/// Where the growing of the floor leaked onto a wall, up to the horizon and beyond, WallFoot locates the
/// wall. A wall on another side, found now or recently, must confirm that there is a room, because a floor
/// may extend up to a horizon of its own colour.
class WallFinder {
 public:
  static constexpr std::uint8_t kWall = LowWalls::kWall;
  static constexpr std::uint8_t kShadow = 2;  ///< mask value of floor in the shadow of objects at walls

  /// @param ground options of the floor: the same tolerances hold for walls
  WallFinder(const lens::Camera& camera, const FloorView& floor_view, const WallOptions& options,
             const SegmenterOptions& ground);

  enum Kind : std::uint8_t { kNeither = 0, kFloorGrown = 1, kWallGrown = 2 };

  /// @param image as segmented by `floor` @param regions of `floor`, as labelled
  /// @return whether there are walls, including LowWalls. If so, those among the regions have kWall or
  /// kShadow in the mask of `floor`, and regions() holds all others
  bool find(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px, GroundSegmenter& floor);
  const std::vector<Blob>& regions() const { return *regions_; }
  /// Result of the growing per cell, valid after find() returned true: reached by the floor, or by the walls
  /// only.
  const cv::Mat1b& kinds() const { return kinds_; }
  /// Foot of walls that are lit like the floor, valid after find() returned true.
  const WallFoot& foot() const { return foot_; }

 private:
  bool findHigh(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px,
                GroundSegmenter& floor);
  bool isWall(const Blob& region);
  int countWallSectors(const GroundSegmenter& floor);
  void findLeaks(const GroundSegmenter& floor);
  void markFloor(const GroundSegmenter& floor);
  void growDown(const GroundSegmenter& floor);
  void releaseShadow(GroundSegmenter& floor);
  bool isGrown(const Blob& region) const;
  bool isWide(int sectors) const { return 360.0 * sectors >= options_.min_arc_deg * Horizon::kSectors; }

  WallOptions options_;
  std::unique_ptr<FloorView>
      view_;  ///< up to the end of the lens, seeds along the horizon; nullptr: no horizon
  std::unique_ptr<GroundSegmenter> segmenter_;
  cv::Mat1b sectors_;  ///< per cell along the horizon: 1 + its sector; else 0
  cv::Mat1b kinds_, near_;
  WallFoot foot_;
  int known_frames_ = 0;  ///< frames, including this one, for which a room is known
  WallFoot::Sectors leaked_{};
  std::vector<cv::Point> queue_;
  std::vector<std::uint8_t> reached_;
  std::vector<const Blob*> walls_;
  BitMask before_, eroded_, objects_;
  Labeller labeller_;
  const std::vector<Blob>* regions_ = nullptr;
};

}  // namespace omnifleet::ground
