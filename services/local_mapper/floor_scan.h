#pragma once

#include <optional>
#include <vector>

#include "ground/floor_view.h"
#include "ground/wall_foot.h"
#include "lens/camera.h"
#include "local_mapper/silhouette.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct ScanOptions {
  int rays = 360;            ///< bearings over the full turn, 8–3600
  double max_range_m = 2.5;  ///< metres: floor is trusted up to here
  double sigma_px = 1.0;     ///< pixels: radial σ of an edge
  static ScanOptions read(const options::Section& section);
};

/// One range per bearing from the camera foot: the inner edge of the nearest region, or else the end of the
/// visible floor.
class FloorScan {
 public:
  FloorScan(const lens::Camera& camera, const ground::FloorView& view, const ScanOptions& options);

  void begin();
  /// Adds a region that stands in the way; label 0 for one that is no object.
  void add(const FloorContour& contour, std::uint16_t label);
  /// Adds everything in a mask (0: nothing) that stands in the way. Needed where a region surrounds the
  /// robot, because its contour is that of its far side.
  void addAll(const cv::Mat1b& objects);
  /// Input of findWalls(), which determines where walls stand on the floor, or where the examined floor ends.
  struct Room {
    const cv::Mat& image;
    const cv::Mat1b&
        objects;             ///< WallFinder::kWall on walls that are regions, other values on other obstacles
    const cv::Mat1b& kinds;  ///< per cell, WallFinder::Kind
    int block_px;            ///< block size of the region growing
    const ground::WallFoot& foot;  ///< of walls that are lit like the floor
  };
  void findWalls(const Room& room);
  /// Ends rays at the walls.
  void addWalls();
  /// Does a region stand in front of the walls that continue on both sides of it? What is attached to a wall
  /// or part of it (a door, a skirting board) touches the floor where the wall does. False where neither wall
  /// nor free floor is visible beside the region.
  bool isInFrontOfWalls(const FloorContour& contour, const Eigen::Vector2d& contact_m) const;
  /// Free share of the depth of the visible floor, the median over all bearings with visible floor. Valid
  /// after finish().
  double freeShare() const { return free_share_; }
  enum class Candidate {
    kRegion,        ///< may be floor or an object
    kBoard,         ///< may be a wall or an object's shadow; ignored if most of it belongs to known walls
    kIntensityEdge  ///< may be the foot of a wall; ignored if most of it belongs to known walls
  };
  /// Adds a region that is not decided: the floor is known up to it and not beyond.
  /// @return where it begins, base_link; none if no part of it is on the floor, or if it is ignored
  std::optional<Eigen::Vector2d> addUndecided(const ground::Blob& blob, Candidate candidate);
  /// Sets ranges, σ and labels: kFloorEnd, kObstacle (a wall), kUnknown (something stands there), kUndecided
  /// (floor or an object of its colour), kInvalid (no floor is ever visible).
  void finish(Scan& scan);

 private:
  static constexpr std::size_t kSectors = 512;  ///< of the full turn; so many that one contains few rays
  double rangeAt(std::size_t ray, std::size_t step) const;
  double footByLines(std::size_t ray, const Room& room) const;
  std::size_t footOfWall(std::size_t ray, std::size_t step, const Room& room);
  static std::size_t sectorOf(const Eigen::Vector2d& to);
  void findSectors();
  /// End of the nearest wall from a ray on, to one side; none within reach.
  std::optional<Eigen::Vector2d> wallBeside(long ray, long step) const;
  std::size_t rayBefore(const Eigen::Vector2d& to) const;
  template <typename Visit>
  void forFloor(const ground::Blob& blob, Visit visit) const;
  bool isOfWalls(const ground::Blob& blob, double blocks) const;
  void addSegment(const Eigen::Vector2d& a, std::size_t before_a, const Eigen::Vector2d& b,
                  std::size_t before_b, std::uint16_t label);

  const lens::Camera* camera_;
  ScanOptions options_;
  std::vector<Eigen::Vector2d> bearing_;  ///< unit vectors
  std::vector<std::size_t> first_;        ///< per sector: a ray before its beginning
  std::vector<float> floor_begin_m_, floor_end_m_, floor_end_sigma_m_;
  int block_px_ = 0;  ///< of the last room
  std::vector<double> nearest_m_, undecided_m_, wall_m_;
  std::vector<std::uint16_t> object_;
  std::vector<std::uint8_t> meets_wall_, ends_at_wall_;
  struct Step {
    std::int16_t u, v;
  };
  std::vector<Step> steps_;  ///< pixels of the visible floor along the bearings, kMarch_m apart
  struct Sample {
    std::size_t step;
    cv::Vec3f sum_before;  ///< sum of the colours of the previous pixels
  };
  std::vector<Sample> ray_samples_;      ///< along one ray
  std::vector<std::size_t> step_begin_;  ///< of each bearing; one more for the end
  std::vector<float> shares_;
  double free_share_ = 1.0;
  double blind_m_ = 0.0;  ///< greatest distance at which the visible floor begins on any ray
};

}  // namespace omnifleet::local_mapper
