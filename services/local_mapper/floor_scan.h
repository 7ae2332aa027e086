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

/// Range per bearing from the camera's foot: the inner edge of the nearest region, else where the visible
/// floor ends.
class FloorScan {
 public:
  FloorScan(const lens::Camera& camera, const ground::FloorView& view, const ScanOptions& options);

  void begin();
  /// A region in the way; label 0 for one that is no object.
  void add(const FloorContour& contour, std::uint16_t label);
  /// All in a mask (0: nothing) that stands in the way, where a region closes around the robot: its contour
  /// is the far side of it.
  void addAll(const cv::Mat1b& objects);
  /// Where walls stand on the floor, or the floor ends that is looked at.
  struct Room {
    const cv::Mat& image;
    const cv::Mat1b& objects;      ///< WallFinder::kWall on walls that are regions, other values on what else
                                   ///< is in the way
    const cv::Mat1b& kinds;        ///< per cell, WallFinder::Kind
    int block_px;                  ///< of the growth
    const ground::WallFoot& foot;  ///< of walls that are lit like the floor
  };
  void findWalls(const Room& room);
  /// Ends rays at them.
  void addWalls();
  /// Does it stand before the walls, as they go on to both sides of it? What is on a wall or is a part of it,
  /// a door, a skirting, touches the floor where they do. False where neither wall nor free floor is seen
  /// beside it.
  bool isBeforeWalls(const FloorContour& contour, const Eigen::Vector2d& contact_m) const;
  /// Share of the visible floor's depth that is free, the middle one of all bearings that see floor; since
  /// finish().
  double freeShare() const { return free_share_; }
  enum class Doubt {
    kRegion,  ///< may be floor or a thing
    kBoard,   ///< may be a wall, or a thing's shade: no doubt where most of it is of walls that are told
    kStep     ///< may be a wall's foot: likewise
  };
  /// What may be floor or a thing of its colour: floor is known up to there and nothing beyond. Returns
  /// where it begins, base_link; none where nothing of it is on the floor.
  std::optional<Eigen::Vector2d> addUndecided(const ground::Blob& blob, Doubt doubt);
  /// Ranges, σ and labels: kFloorEnd, kObstacle (a wall), kUnknown (something stands there) or kUndecided
  /// (floor or a thing of its colour), kInvalid where no floor is ever visible.
  void finish(Scan& scan);

 private:
  static constexpr std::size_t kSectors = 512;  ///< of a turn; so many that one holds few rays
  double rangeAt(std::size_t ray, std::size_t step) const;
  double footByAll(std::size_t ray, const Room& room) const;
  std::size_t footOfWall(std::size_t ray, std::size_t step, const Room& room);
  static std::size_t sectorOf(const Eigen::Vector2d& to);
  void findSectors();
  /// The end of the nearest wall from a ray on, to one side; nothing within reach.
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
  std::vector<std::size_t> first_;        ///< per sector, a ray before its beginning
  std::vector<float> floor_begin_m_, floor_end_m_, floor_end_sigma_m_;
  int block_px_ = 0;  ///< of the last room
  std::vector<double> nearest_m_, undecided_m_, wall_m_;
  std::vector<std::uint16_t> object_;
  std::vector<std::uint8_t> meets_wall_, ends_at_wall_;
  struct Step {
    std::int16_t u, v;
  };
  std::vector<Step> steps_;  ///< pixels of the visible floor along the bearings, kMarch_m apart
  struct Seen {
    std::size_t step;
    cv::Vec3f sum_before;  ///< of the colours of those before
  };
  std::vector<Seen> along_;              ///< a ray
  std::vector<std::size_t> step_begin_;  ///< of each bearing; one more for the end
  std::vector<float> shares_;
  double free_share_ = 1.0;
  double blind_m_ = 0.0;  ///< where on some ray the visible floor begins, at most
};

}  // namespace omnifleet::local_mapper
