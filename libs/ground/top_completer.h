#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "ground/convex_part.h"
#include "ground/floor_frame.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Completes objects lighter than the floor and of its hue. Their tops are plainly visible. Their sides, in
/// less light, have about the floor's brightness, slightly more or less. If only the top face were segmented,
/// the object would move with the camera (wrong parallax).
///
/// Verticals lead towards the camera foot. Seen from height H, an upright object of height h therefore shows
/// the near edge of its foot, on each bearing, at the share 1 − h/H of the floor distance to which the near
/// edge of its top projects (docs/methods/local_mapper.md). In front of the top its sides extend to this
/// share, and the floor from there on. The share is the change point that best divides the pixels of all
/// bearings in two parts, each with its own brightness and variance (change point by likelihood; Basseville
/// and Nikiforov 1993). A patch of light has no such share, nor has an object that shows its sides as well as
/// its top.
class TopCompleter {
 public:
  TopCompleter(const lens::Camera& camera, cv::Size image);

  /// @param region of the floor's hue, and lighter than the floor in part
  /// @return the pixels of top and sides by rows; empty where they are not found; valid until the next call
  const std::vector<Run>& complete(const FloorFrame& frame, const Blob& region);
  /// Did the last region show a top with sides, but too far away to locate their end?
  bool isUndecided() const { return is_undecided_; }
  /// Did nothing but a top differ from the floor in the last region?
  bool isTopOnly() const { return is_top_only_; }

 private:
  /// Pixels of all bearings at one share: the sum of the gains, and half the squared differences of pairs of
  /// neighbours.
  struct Row {
    double count = 0.0, sum = 0.0, pairs = 0.0, squares = 0.0;
  };
  /// Cumulative sums over rows.
  struct Sums {
    double count = 0.0, within = 0.0, along = 0.0;
  };
  bool findTop(const FloorFrame& frame, const Blob& region);
  bool findNearEdge();
  void measureRows(const FloorFrame& frame);
  std::optional<std::size_t> findFoot(const FloorFrame& frame);
  double noise2OfFloor(const FloorFrame& frame) const;
  double logLikelihood(std::size_t begin, std::size_t end) const;
  std::optional<Eigen::Vector2d> pixelAt(const Eigen::Vector2d& floor_m, double share) const;
  double gainAlong(const FloorFrame& frame, const Eigen::Vector2d& floor_m, double share) const;
  double metresPerPixel(double share) const;
  void take(const FloorFrame& frame, double share);
  double shareInHull(const Blob& region);
  cv::Rect drawHull();

  lens::Camera camera_;
  cv::Size size_;
  cv::Mat1f gains_;          ///< brightness of the pixels relative to the floor's
  cv::Mat1b light_, whole_;  ///< 255 where it is lighter than halfway to the top; result
  ConvexPart convex_;
  std::vector<float> lights_;
  cv::Rect around_;
  std::vector<cv::Point> hull_, outline_;  ///< of the top; of the whole object
  std::vector<Eigen::Vector2d>
      top_m_;  ///< outline of the top projected to the floor, metres from the camera foot
  std::vector<Eigen::Vector2d> near_m_;  ///< near edge of the top, by bearing
  std::vector<Row> rows_;                ///< from the near edge inward
  std::vector<Sums> until_;              ///< sums of the rows before each row
  float limit_ = 0.0f;                   ///< of the floor's light, from which a pixel may belong to the top
  bool is_undecided_ = false, is_top_only_ = false;
  bool is_cut_ = false;         ///< the view ends where the rows end
  std::vector<double> shares_;  ///< of the rows
  std::vector<Run> runs_;
};

}  // namespace omnifleet::ground
