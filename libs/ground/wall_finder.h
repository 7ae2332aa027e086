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
  double min_arc_deg = 60.0;  ///< degrees of the horizon that a region must reach up to
  static WallOptions read(const options::Section& section);
};

/// Walls, and what stands before them. Whatever is lower than the camera ends below the horizon; a region
/// that reaches it over a wide arc is the room's walls, with all that covers their foot in the picture. Their
/// colours are those at and above the horizon, where nothing else is; from there they are followed down as
/// the floor is from the robot outward (GroundSegmenter, its seeds along the horizon). What is neither floor
/// nor wall stands before a wall, or is a part of it: FloorScan::isBeforeWalls() tells.
/// Of a wall of nearly the floor's colours, which leaves no region or passes for shade, it is told where the
/// floor's growth stopped: what goes on from above the horizon down to there, without an edge, is no floor.
/// Where the floor's growth climbed a wall, up to the horizon and what goes on above it, WallFoot tells; that
/// there is a room must be known by another of its sides, now or of late, for a floor may go on up to a
/// horizon of its colour.
class WallFinder {
 public:
  static constexpr std::uint8_t kWall = LowWalls::kWall;
  static constexpr std::uint8_t kShade = 2;  ///< likewise, of the floor that things at walls shade

  /// @param options of the floor: the same tolerances hold for walls
  WallFinder(const lens::Camera& camera, const FloorView& floor_view, const WallOptions& options,
             const SegmenterOptions& ground);

  enum Kind : std::uint8_t { kNeither = 0, kFloorGrown = 1, kWallGrown = 2 };

  /// @param image as `floor` has segmented it @param regions of `floor`, as labelled
  /// @return whether there are walls, LowWalls among them; then those among the regions have kWall or kShade
  /// in the mask of `floor`, and regions() holds all else
  bool find(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px, GroundSegmenter& floor);
  const std::vector<Blob>& regions() const { return *regions_; }
  /// Of each cell what growth got there, since find() found walls: the floor's, or the walls' and not the
  /// floor's.
  const cv::Mat1b& kinds() const { return kinds_; }
  /// Since then, where walls that are lit like the floor stand.
  const WallFoot& foot() const { return foot_; }

 private:
  bool findHigh(const cv::Mat& image, const std::vector<Blob>& regions, int min_area_px,
                GroundSegmenter& floor);
  bool isWall(const Blob& region);
  int countWallSectors(const GroundSegmenter& floor);
  void findClimbed(const GroundSegmenter& floor);
  void markFloor(const GroundSegmenter& floor);
  void growDown(const GroundSegmenter& floor);
  void freeShade(GroundSegmenter& floor);
  bool isGrown(const Blob& region) const;
  bool isWide(int sectors) const { return 360.0 * sectors >= options_.min_arc_deg * Horizon::kSectors; }

  WallOptions options_;
  std::unique_ptr<FloorView> view_;  ///< up to the end of the lens, seeds along the horizon; none: no horizon
  std::unique_ptr<GroundSegmenter> segmenter_;
  cv::Mat1b sectors_;  ///< per cell along the horizon: 1 + its sector; else 0
  cv::Mat1b kinds_, near_;
  WallFoot foot_;
  int known_frames_ = 0;  ///< this one too, for which it is known that there is a room
  WallFoot::Sectors climbed_{};
  std::vector<cv::Point> queue_;
  std::vector<std::uint8_t> reached_;
  std::vector<const Blob*> walls_;
  BitMask before_, eroded_, things_;
  Labeller labeller_;
  const std::vector<Blob>* regions_ = nullptr;
};

}  // namespace omnifleet::ground
