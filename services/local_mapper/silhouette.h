#pragma once

#include <string>
#include <utility>
#include <vector>

#include "ground/contour.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "lens/camera.h"
#include "lens/floor_table.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct SilhouetteOptions {
  std::string outline = "contour";  ///< contour | features: hull of the vectors' ends, as in Choi §III.5
  double max_contact_m = 2.0;       ///< metres: a blob whose contact with the floor is farther is no object
  double far_contact_m = 2.8;    ///< metres: up to here it is one, if it fulfils the following two conditions
  double far_solidity = 0.95;    ///< 1: minimum solidity, and not truncated
  int far_area_px = 60;          ///< pixels: minimum area
  double sigma_px = 0.4;         ///< pixels: σ of a contour point, used at the supporting point
  double sigma_floor_m = 0.001;  ///< metres: σ of the calibration, added in quadrature
  double support_bias_px =
      0.0;               ///< pixels subtracted from every support: the maximum of noisy points is too large
  int min_area_px = 24;  ///< pixels: smaller regions are noise
  static SilhouetteOptions read(const options::Section& section);
};

/// The outline of one region, projected to the floor point by point. Only contour points are corrected, never
/// the image (Choi §III.4, with the camera's own lens instead of eq. 6–7).
struct FloorContour {
  std::vector<Eigen::Vector2d> points_m;  ///< base_link
  std::vector<Eigen::Vector2f> pixels;    ///< the pixel of each
  std::vector<std::uint8_t> cut;  ///< 1: cut by the edge of the valid image or the self mask, or hidden there
  std::vector<std::size_t> loop_begin;  ///< first point of each closed loop

  /// First point of a closed loop, and one past its last.
  std::pair<std::size_t, std::size_t> loop(std::size_t k) const {
    return {loop_begin[k], k + 1 < loop_begin.size() ? loop_begin[k + 1] : points_m.size()};
  }
};

/// Fills an ObjectObservation, except for label and vectors.
class Silhouette {
 public:
  Silhouette(const lens::Camera& camera, const ground::FloorView& view, const SilhouetteOptions& options);

  /// @param hides per value of Contour::beside: whether the region there stands in front of this one, so that
  /// the outline there is not its own; empty: none does
  /// @return false where the region is no object: too small, too far, no floor point, closed around the robot
  bool measure(const ground::Blob& blob, const ground::Contour& contour, const std::vector<bool>& hides,
               ObjectObservation& object);
  /// The region of the last measure() closes around the camera foot, as the walls of a room do. Its contour
  /// is then that of its far side.
  bool isAround() const { return is_around_; }
  /// The region of the last measure() is a line on the floor: tape, a seam, a cable. Its mean width (2·area ÷
  /// perimeter) is a few centimetres and a small part of its length. In addition, one of two conditions must
  /// exclude an upright object. An upright object without thickness appears wider where it runs across the
  /// lines of sight: its far side appears d·h/(H − h) farther, so a small width implies a height below what
  /// is mapped. For a region that points at the camera this does not apply; there, the sides of an upright
  /// object diverge with the distance, and those of a line do not.
  bool isLine() const;
  /// Distance from the camera foot to the nearest point of an outline that borders on floor, metres; infinite
  /// where there is none.
  double contactDistance(const ground::Contour& contour) const;

  /// Choi §III.5: hull and support function from the outermost feature points, the ends of the object's
  /// vectors. With fewer than three of them the object has no outline and none of its support values is
  /// usable.
  void measureFeatures(ObjectObservation& object);

  /// Points for which the lens has no floor point (r ≥ F in Choi eq. 7), since forgetRejected().
  std::size_t rejected() const { return rejected_; }
  void forgetRejected() { rejected_ = 0; }

  /// The floor contour of the last measure(); empty where no part of it lies on the floor.
  const FloorContour& floorContour() const { return floor_; }

 private:
  void projectToFloor(const ground::Contour& contour, const std::vector<bool>& hides);
  bool closesAroundFoot() const;
  bool hasParallelSides() const;
  void findContact(ObjectObservation& object) const;
  void measureHull(ObjectObservation& object);
  void findOutermost();
  void measureCentroid(const ground::Blob& blob, ObjectObservation& object) const;
  void measureSupports(ObjectObservation& object);
  void supportsFromCorners(ObjectObservation& object);
  /// ∂floor/∂pixel at a contour point, metres per pixel.
  Eigen::Matrix2d jacobian(const Eigen::Vector2f& pixel) const;

  /// A corner of the hull with the properties of its pixel.
  struct Corner {
    Eigen::Vector2d from_foot_m;
    Eigen::Matrix2d metres_per_px;
    bool cut;
  };

  const lens::Camera* camera_;
  const ground::FloorView* view_;
  lens::FloorTable floor_table_;
  SilhouetteOptions options_;
  std::vector<Eigen::Vector2d> directions_;
  FloorContour floor_;
  std::vector<std::size_t> outermost_;  ///< points of floor_ that may be corners of its hull
  Polygon outermost_m_;
  std::size_t rejected_ = 0;
  bool is_around_ = false;
  bool is_hidden_ = false;  ///< something stands in front of the region
  std::vector<Corner> corners_;
};

}  // namespace omnifleet::local_mapper
